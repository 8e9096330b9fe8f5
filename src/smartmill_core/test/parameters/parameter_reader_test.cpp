#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <iterator>
#include <sstream>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_options.h"
#include "smartmill_core/parameters/parameter_reader.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {
namespace {

using ::testing::HasSubstr;

struct Part {
  double share = 0.5;
  void declare(ParameterTable& table) {
    table.number("share", share, "1", Range::openHigh(0.0, 1.0), "of all");
  }
};

struct Parameters {
  double bandwidth = 5000.0;
  int hits = 10;
  std::uint64_t seed = 1;
  bool follow = false;
  std::string method = "auto";
  std::vector<double> speeds{1.0, 2.0};
  std::array<double, 3> per_metre{{0.0, 0.0, 0.0}};
  Part part;
  double memory = 0.25;

  void declare(ParameterTable& table) {
    table.number("bandwidth", bandwidth, "Hz", Range::positive(), "up to here");
    table.number("hits", hits, "1", Range::closed(1, 100), "in a direction");
    table.number("seed", seed, "1", Range::notNegative(), "of noise");
    table.flag("follow", follow, "follows");
    table.choice("method", method, {"auto", "exact"}, "how");
    table.list("speeds", speeds, "rad/s", Range::positive(), "of air cuts");
    table.list("per_metre", per_metre, "1/m", Range::notNegative(), "of X, Y, Z");
    table.part("part_", part);
    table.internal("memory", memory, "s", Range::positive());
  }
  void validate() const {
    checkBounds(*this);
    if (part.share * hits > 50.0) throw Error("part_share: too many of hits");
  }
};

class ParameterFiles : public ::testing::Test {
 protected:
  std::string errorOf(const std::string& yaml) {
    try {
      read(yaml);
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      return error.what();
    }
    return {};
  }
  Parameters read(const std::string& yaml) {
    return ParameterReader::fromFile(folder_.write("p.yaml", yaml)).readAll<Parameters>();
  }
  TemporaryFolder folder_;
};

TEST_F(ParameterFiles, TheFileOfTheTableReadsBackToTheDefaults) {
  Parameters shipped;
  const Parameters p = read(tableOf(shipped).yaml());
  EXPECT_EQ(p.bandwidth, 5000.0);
  EXPECT_EQ(p.hits, 10);
  EXPECT_EQ(p.seed, 1u);
  EXPECT_EQ(p.method, "auto");
  EXPECT_EQ(p.speeds, shipped.speeds);
  EXPECT_EQ(p.part.share, 0.5);
}

TEST_F(ParameterFiles, ValuesAreAssignedToTheirMembers) {
  const Parameters p = read(
      "bandwidth: 800\nhits: 3\nseed: 7\nfollow: true\nmethod: exact\nspeeds: [5.0]\nper_metre: [1, 2.5, 3]\n"
      "part_share: 0.25\n");
  EXPECT_EQ(p.bandwidth, 800.0);
  EXPECT_EQ(p.hits, 3);
  EXPECT_EQ(p.seed, 7u);
  EXPECT_TRUE(p.follow);
  EXPECT_EQ(p.method, "exact");
  EXPECT_EQ(p.speeds, std::vector<double>{5.0});
  EXPECT_EQ(p.per_metre[1], 2.5);
  EXPECT_EQ(p.part.share, 0.25);
  EXPECT_EQ(read("").hits, 10);
}

TEST_F(ParameterFiles, EveryErrorIsOneLineWithKeyAndValue) {
  EXPECT_THAT(errorOf("bandwith: 1.0\n"), HasSubstr("bandwith is unknown"));
  EXPECT_THAT(errorOf("memory: 0.1\n"), HasSubstr("memory is unknown"));
  EXPECT_THAT(errorOf("share: 0.1\n"), HasSubstr("share is unknown"));
  EXPECT_THAT(errorOf("bandwidth: 1e3\n"), HasSubstr("bandwidth: '1e3' is a string, expected a number"));
  EXPECT_THAT(errorOf("bandwidth: .nan\n"), HasSubstr("bandwidth: not a finite number"));
  EXPECT_THAT(errorOf("bandwidth: -1.0\n"), HasSubstr("bandwidth: -1 is out of range (> 0 Hz)"));
  EXPECT_THAT(errorOf("hits: 2.5\n"), HasSubstr("hits: '2.500000' is a number, expected an integer"));
  EXPECT_THAT(errorOf("hits: 0\n"), HasSubstr("hits: 0 is out of range (1 <= value <= 100)"));
  EXPECT_THAT(errorOf("seed: -1\n"), HasSubstr("seed: -1 is out of range (>= 0)"));
  EXPECT_THAT(errorOf("follow: 1\n"), HasSubstr("follow: '1' is an integer, expected true or false"));
  EXPECT_THAT(errorOf("method: 5\n"), HasSubstr("method: '5' is an integer, expected a string"));
  EXPECT_THAT(errorOf("method: fast\n"), HasSubstr("method: 'fast' is not one of auto | exact"));
  EXPECT_THAT(errorOf("speeds: 5.0\n"),
              HasSubstr("speeds: '5.000000' is a number, expected a list of numbers"));
  EXPECT_THAT(errorOf("speeds: [1.0, a]\n"), HasSubstr("speeds[1]: 'a' is a string"));
  EXPECT_THAT(errorOf("speeds: [1.0, -1.0]\n"), HasSubstr("speeds: -1 is out of range (> 0 rad/s)"));
  EXPECT_THAT(errorOf("per_metre: [1.0, 2.0]\n"), HasSubstr("per_metre: 2 numbers, expected three"));
  EXPECT_THAT(errorOf("part_share: 1.0\n"), HasSubstr("part_share: 1 is out of range (0 <= value < 1)"));
  EXPECT_THAT(errorOf("part_share: 0.9\nhits: 100\n"), HasSubstr("part_share: too many of hits"));
}

// A flag of an earlier version.
TEST_F(ParameterFiles, ABooleanForAChoiceIsRefusedWithItsWords) {
  EXPECT_THAT(errorOf("method: true\n"),
              HasSubstr("method: 'true' is a boolean, expected a string: auto | exact"));
  EXPECT_THAT(errorOf("method: off\n"),
              HasSubstr("method: 'false' is a boolean, expected a string: auto | exact"));
}

class Options : public ParameterFiles {
 protected:
  struct Tool {
    Tool() : options(line, tableOf(parameters), "launch/config/x.yaml") {
      options.add("--bandwidth-hz", "bandwidth");
      options.add("--hits", "hits");
    }
    std::string run(const std::string& typed) {
      std::istringstream text("tool " + typed);
      const std::vector<std::string> words{std::istream_iterator<std::string>(text), {}};
      std::vector<const char*> argv;
      for (const std::string& word : words) argv.push_back(word.c_str());
      if (line.parse(static_cast<int>(argv.size()), argv.data()).stop) return "not parsed";
      try {
        line.runAfterParsing();
      } catch (const Error& error) {
        return error.what();
      }
      return {};
    }
    Parameters parameters;
    CommandLine line;
    ParameterOptions options;
  };
};

TEST_F(Options, OverrideTheFile) {
  Tool tool;
  const std::string file = folder_.write("p.yaml", "bandwidth: 800.0\nfollow: true\n");
  EXPECT_EQ(tool.run("--bandwidth-hz 1e3 --hits 4 --params " + file), "");
  EXPECT_EQ(tool.parameters.bandwidth, 1000.0);
  EXPECT_EQ(tool.parameters.hits, 4);
  EXPECT_TRUE(tool.parameters.follow);
}

TEST_F(Options, AreCheckedAgainstTheBoundsOfTheTable) {
  EXPECT_EQ(Tool().run("--bandwidth-hz 0"), "--bandwidth-hz: bandwidth: 0 is out of range (> 0 Hz)");
  EXPECT_EQ(Tool().run("--bandwidth-hz 5k"), "--bandwidth-hz: '5k' is not a number");
  EXPECT_EQ(Tool().run("--hits 2.5"), "--hits: '2.5' is not an integer");
  EXPECT_THAT(Tool().run("--params " + folder_.write("p.yaml", "hits: 0\n")),
              HasSubstr("hits: 0 is out of range"));
}

TEST_F(Options, HelpHasUnitBoundsMeaningAndDefault) {
  const std::string help = Tool().line.help();
  EXPECT_THAT(help, HasSubstr("[Hz] > 0, up to here (5000.0)"));
  EXPECT_THAT(help, HasSubstr("launch/config/x.yaml"));
  EXPECT_THAT(help, HasSubstr("part_share: 0.5"));
}

}  // namespace
}  // namespace smartmill
