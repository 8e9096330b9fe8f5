#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <string>

#include "node/angle_parameters.h"
#include "node/parameters.h"
#include "node/tachometer_parameters.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/shipped_parameters.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill::cnc {
namespace {

const char* const SHIPPED = "../launch/config/cnc.yaml";  // tests run in the package's folder

std::string refusal(const std::string& yaml) {
  const TemporaryFolder temporary;
  const std::string file = temporary.file("cnc_parameters_test.yaml");
  std::ofstream(file) << yaml;
  std::string message;
  try {
    ParameterReader::fromFile(file).readAll<NodeParameters>().completed();
  } catch (const Error& e) {
    message = e.what();
  }
  std::remove(file.c_str());
  return message;
}

std::string good() {
  return "travel_x: [-0.2, 0.2]\ntravel_y: [-0.1, 0.1]\ntravel_z: [-0.3, 0.0]\nmax_feed: 0.25\n"
         "max_spindle_speed: 1256\n";
}

TEST(Parameters, ShippedFileMatchesTheTableAndTakesTheLimitsFromTheModel) {
  expectShipped<NodeParameters>(SHIPPED, "smartmill_cnc cnc_node");
  try {
    ParameterReader::fromFile(SHIPPED).readAll<NodeParameters>().completed();
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("travel_x"), std::string::npos) << e.what();
  }
}

TEST(Parameters, ValidOnesAreAccepted) {
  EXPECT_EQ(refusal(good()), "");
}

TEST(Parameters, InvalidOnesAreNamed) {
  struct Case {
    const char* line;
    const char* key;
  };
  for (const Case& c :
       {Case{"settle_time: 1e-2\n", "settle_time"}, Case{"settle_time: -1.0\n", "settle_time"},
        Case{"port: 0\n", "port"}, Case{"port: 8193.5\n", "port"}, Case{"rate: 1000.0\n", "rate"},
        Case{"hots: localhost\n", "hots"}, Case{"host: 5\n", "host"},
        Case{"orient_macro: 100\n", "marker_macro"}}) {
    const std::string message = refusal(good() + c.line);
    EXPECT_NE(message.find(c.key), std::string::npos) << c.line << " gives '" << message << "'";
    EXPECT_EQ(message.find('\n'), std::string::npos);
  }
  EXPECT_NE(refusal("travel_x: [0.2, -0.2]\n" + good().substr(22)).find("travel_x"), std::string::npos);
}

TEST(TachometerParameters, ShippedFileMatchesTheTable) {
  expectShipped<TachometerNodeParameters>("../launch/config/tachometer.yaml",
                                          "smartmill_cnc tachometer_node");
  TachometerNodeParameters parameters;
  parameters.input.clear();
  EXPECT_THROW(parameters.validate(), Error);
}

TEST(AngleParameters, ShippedFileMatchesTheTable) {
  expectShipped<AngleNodeParameters>("../launch/config/angle.yaml", "smartmill_cnc angle_node");
}

}  // namespace
}  // namespace smartmill::cnc
