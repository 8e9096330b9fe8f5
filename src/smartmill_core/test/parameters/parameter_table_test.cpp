#include "smartmill_core/parameters/parameter_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <limits>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

struct Filter {
  double bandwidth = 5000.0;
  int harmonics = 50;

  void declare(ParameterTable& table) {
    table.number("bandwidth", bandwidth, "Hz", Range::positive(), "harmonics up to here");
    table.number("harmonics", harmonics, "1", Range::closed(0, 200), "at most so many");
  }
};

struct Everything {
  Filter filter;
  double share = 5e-5;
  std::uint64_t seed = 1;
  bool follow = false;
  std::string host = "127.0.0.1";
  std::string method = "auto";
  std::vector<double> speeds{100.0, 3.141592653589793};
  std::array<double, 3> per_metre{{0.0, 0.0, 0.0}};
  std::string model;
  double memory = 0.25;

  void declare(ParameterTable& table) {
    table.title("Parameters of a test.");
    table.atLaunch("model", model, "path of a file");
    table.section("Filter.");
    table.part("filter_", filter);
    table.section();
    table.number("share", share, "1", Range::openHigh(0.0, 1.0), "of the whole");
    table.number("seed", seed, "1", Range::notNegative(), "of noise");
    table.flag("follow", follow, "moves the modes");
    table.text("host", host, "name or address");
    table.choice("method", method, {"auto", "exact"}, "how");
    table.list("speeds", speeds, "rad/s", Range::positive(), "of air cuts");
    table.list("per_metre", per_metre, "1/m", Range::notNegative(), "of X, Y, Z");
    table.internal("memory", memory, "s", Range::positive());
  }
};

std::string errorOf(const Everything& e) {
  try {
    checkBounds(e);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(ParameterTable, DefaultsAreWithinTheirBounds) {
  EXPECT_EQ(errorOf(Everything()), "");
}

TEST(ParameterTable, ValuesOutOfBoundsAreNamedInOneLine) {
  const auto with = [](auto change) {
    Everything e;
    change(e);
    return errorOf(e);
  };
  EXPECT_EQ(with([](auto& e) { e.filter.bandwidth = 0.0; }), "filter_bandwidth: 0 is out of range (> 0 Hz)");
  EXPECT_EQ(with([](auto& e) { e.filter.harmonics = 201; }),
            "filter_harmonics: 201 is out of range (0 <= value <= 200)");
  EXPECT_EQ(with([](auto& e) { e.share = 1.0; }), "share: 1 is out of range (0 <= value < 1)");
  EXPECT_EQ(with([](auto& e) { e.share = std::nan(""); }), "share: nan is out of range (0 <= value < 1)");
  EXPECT_EQ(with([](auto& e) { e.filter.bandwidth = std::numeric_limits<double>::infinity(); }),
            "filter_bandwidth: inf is out of range (> 0 Hz)");
  EXPECT_EQ(with([](auto& e) { e.method = "guess"; }), "method: 'guess' is not one of auto | exact");
  EXPECT_EQ(with([](auto& e) { e.speeds[1] = -2.5; }), "speeds: -2.5 is out of range (> 0 rad/s)");
  EXPECT_EQ(with([](auto& e) { e.per_metre[2] = -1.0; }), "per_metre: -1 is out of range (>= 0 1/m)");
  EXPECT_EQ(with([](auto& e) { e.memory = 0.0; }), "memory: 0 is out of range (> 0 s)");
  EXPECT_EQ(with([](auto& e) { e.speeds.clear(); }), "");
}

TEST(ParameterTable, RejectsARepeatedKey) {
  double value = 0.0;
  ParameterTable table;
  table.number("a", value, "1", {}, "");
  EXPECT_THROW(table.flag("a", *std::make_unique<bool>(), ""), std::logic_error);
  EXPECT_EQ(table.parameters().size(), 1u);
  EXPECT_NE(table.find("a"), nullptr);
  EXPECT_EQ(table.find("b"), nullptr);
}

TEST(ParameterTable, PointsIntoItsStruct) {
  Everything e;
  const ParameterTable table = tableOf(e);
  *std::get<double*>(table.find("filter_bandwidth")->address) = 7.0;
  EXPECT_EQ(e.filter.bandwidth, 7.0);
}

TEST(ParameterTable, TheFileIsCompleteAndReadsBack) {
  Everything e;
  const std::string text = tableOf(e).yaml();
  EXPECT_THAT(text, HasSubstr("# Parameters of a test.\n"));
  EXPECT_THAT(text, HasSubstr("# model: set by the launch file; path of a file\n"));
  EXPECT_THAT(text, HasSubstr("\n\n# Filter.\nfilter_bandwidth: 5000.0 "));
  EXPECT_THAT(text, HasSubstr("# [Hz] > 0, harmonics up to here\n"));
  EXPECT_THAT(text, HasSubstr("# [1] 0..200, at most so many\n"));
  EXPECT_THAT(text, HasSubstr("# [1] 0 <= value < 1, of the whole\n"));
  EXPECT_THAT(text, HasSubstr("share: 5.0e-05 "));
  EXPECT_THAT(text, HasSubstr("# moves the modes\n"));
  EXPECT_THAT(text, HasSubstr("speeds: [100.0, 3.141592653589793] # [rad/s] > 0, of air cuts\n"));
  const YAML::Node node = YAML::Load(text);
  EXPECT_EQ(node["filter_bandwidth"].as<double>(), 5000.0);
  EXPECT_EQ(node["filter_harmonics"].as<int>(), 50);
  EXPECT_EQ(node["share"].as<double>(), 5e-5);
  EXPECT_EQ(node["seed"].as<int>(), 1);
  EXPECT_FALSE(node["follow"].as<bool>());
  EXPECT_EQ(node["host"].as<std::string>(), "127.0.0.1");
  EXPECT_EQ(node["method"].as<std::string>(), "auto");
  EXPECT_EQ(node["speeds"].as<std::vector<double>>(), e.speeds);
  EXPECT_EQ(node["per_metre"].size(), 3u);
  EXPECT_FALSE(node["model"]);
  EXPECT_FALSE(node["memory"]);
}

TEST(ParameterTable, WrapsLongComments) {
  struct Long {
    double a = 1.0;
    void declare(ParameterTable& table) {
      std::string comment;
      for (int i = 0; i < 40; ++i) comment += "word ";
      table.number("a", a, "1", {}, comment);
    }
  } l;
  std::istringstream lines(tableOf(l).yaml());
  std::string line;
  int count = 0;
  while (std::getline(lines, line)) {
    EXPECT_LE(line.size(), 140u);
    EXPECT_THAT(line, HasSubstr("#"));
    EXPECT_THAT(line, Not(HasSubstr("# #")));
    ++count;
  }
  EXPECT_EQ(count, 3);  // the rule about numbers, two lines of words
}

}  // namespace
}  // namespace smartmill
