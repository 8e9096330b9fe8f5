// libsigrok's demo device, which needs no hardware.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_daq_testing/listening.h"

namespace smartmill::daq {
namespace {

using ::testing::HasSubstr;
using testing::Listening;

std::string description(const std::string& device, const std::string& input) {
  return "format: smartmill-instrument/1\nname: demo\ndriver: sigrok\nsample_rate: 10000.0\noptions: "
         "{device: " +
         device +
         "}\nstreams:\n  - topic: daq/vibration\n    channels:\n"
         "      - {input: A1, name: x, unit: V, sensitivity: 1.0, range: 20.0}\n"
         "      - {input: " +
         input + ", name: y, unit: V, sensitivity: 1.0, range: 20.0}\n";
}

class SigrokDriver : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const DriverKind& kind : driverKinds())
      if (kind.name == "sigrok" && kind.make) return;
    GTEST_SKIP() << "./setup --with-instruments installs libsigrok";
  }
  TemporaryFolder folder_;
};

// Its A1 is a sine, its A2 a triangle of 10 V by default.
TEST_F(SigrokDriver, theDemoDeviceIsAlive) {
  Listening listening(folder_.file("demo.yaml"), description("demo", "A2"));
  ASSERT_TRUE(listening.until([&] { return listening.state().account.delivered > 10000; }));
  for (std::size_t channel = 0; channel < 2; ++channel) {
    double low = 0.0, high = 0.0;
    for (const SampleBlock& block : listening.blocks) {
      for (std::size_t i = 0; i < block.size(); ++i) {
        low = std::min(low, block.at(i, channel));
        high = std::max(high, block.at(i, channel));
      }
    }
    EXPECT_NEAR(low, -10.0, 1.0);
    EXPECT_NEAR(high, 10.0, 1.0);
  }
  const SampleAccount account = listening.state().account;
  EXPECT_EQ(account.lost + account.estimated_lost, 0u);
}

TEST_F(SigrokDriver, anotherDeviceOrInputIsRefused) {
  Listening device(folder_.file("device.yaml"), description("teleport", "A2"));
  EXPECT_THAT(errorOf([&] { device.until([] { return false; }); }),
              HasSubstr("options.device: libsigrok has no driver 'teleport'"));
  Listening input(folder_.file("input.yaml"), description("demo", "A77"));
  EXPECT_THAT(errorOf([&] { input.until([] { return false; }); }),
              HasSubstr("an input is not there, expected of A0"));
}

}  // namespace
}  // namespace smartmill::daq
