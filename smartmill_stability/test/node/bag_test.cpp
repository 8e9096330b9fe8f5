#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>

#include "node/bag_charts.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/testing/shipped_parameters.h"
#include "smartmill_stability/control/control_stream.h"
#include "smartmill_stability_testing/benchmark.h"
#include "smartmill_stability_testing/cutting_scene.h"

namespace smartmill::stability {
namespace {

using ::testing::HasSubstr;

/// Writes messages into a bag.
class Recorder {
 public:
  explicit Recorder(const std::string& file) : bag_(file, rosbag::bagmode::Write) {}
  void operator()(const CuttingCondition& c) { write(names::CUTTING_CONDITION, toMsg(c)); }
  void operator()(const CncState& s) { write(names::CNC_STATE, toMsg(s)); }
  void operator()(const SpindleAngle& a) { write(names::SPINDLE_ANGLE, toMsg(a)); }
  void operator()(const ForceBlock& b) { write(names::FORCE_COMPENSATED, toMsg(b, "machine")); }
  void operator()(const MeasuredFrf& f) { write(names::TOOL_FRF, toMsg(f)); }
  void operator()(const CoefficientSet& s) { write(names::COEFFICIENTS, toMsg(s)); }

 private:
  template <typename Message>
  void write(const std::string& topic, const Message& message) {
    bag_.write("/smartmill/" + topic, message.header.stamp, message);
  }
  rosbag::Bag bag_;
};

NodeParameters parameters() {
  NodeParameters p;
  p.chart.radial_ratio = 1.0 / 3.0;
  p.chart.speed_low = 500.0;
  p.chart.speeds = 300;
  return p;
}

TEST(Bag, givesTheChartAndVerdictsOfTheLiveClasses) {
  const TemporaryFolder folder;
  const std::string file = folder.file("run.bag");
  Scene scene;
  scene.chatter = 150.0;
  {
    Recorder bag(file);
    bag(frf("x", 1.0));
    bag(frf("y", 1.0));
    bag(coefficients());
    play(
        scene, [&](const auto& input) { bag(input); }, 100.0);
  }
  const BagCharts found = chartsFromBag(file, machine(), parameters());

  ChartMaker maker(parameters().chart, machine());
  maker.handle(frf("x", 1.0));
  maker.handle(frf("y", 1.0));
  maker.handle(coefficients());
  const StabilityChart chart = maker.chart();
  ASSERT_TRUE(found.chart);
  EXPECT_EQ(found.chart->limit.depth, chart.limit.depth);
  EXPECT_EQ(found.chart->recommended.size(), chart.recommended.size());
  EXPECT_EQ(found.chart->stamp, 20.0);

  int chatter = 0, valid = 0;
  for (const ChatterState& state : found.states) {
    valid += state.valid;
    chatter += state.chatter;
  }
  EXPECT_GT(valid, 10);
  EXPECT_EQ(chatter, valid);
}

TEST(Bag, saysWhatIsMissing) {
  const TemporaryFolder folder;
  const std::string file = folder.file("run.bag");
  {
    Recorder bag(file);
    bag(frf("x", 1.0));
  }
  const BagCharts found = chartsFromBag(file, machine(), parameters());
  EXPECT_FALSE(found.chart);
  EXPECT_EQ(found.missing, "FRF in y, tangential coefficient");
}

TEST(Parameters, theShippedFilesAreTheTables) {
  expectShipped<NodeParameters>(LAUNCH_CONFIG_FOLDER "/stability.yaml", "smartmill_stability stability_node");
  EXPECT_NO_THROW(NodeParameters().validate());
  expectShipped<ControlStreamParameters>("config/chatter_control.yaml",
                                         "smartmill_stability chatter_control_node");
}

TEST(Parameters, wrongTypesUnknownKeysAndRangesAreNamed) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& text) {
    return errorOf(
        [&] { ParameterReader::fromFile(folder.write("p.yaml", text)).readAll<NodeParameters>(); });
  };
  EXPECT_THAT(error("max_depth: 2e-2\n"), HasSubstr("max_depth"));
  EXPECT_THAT(error("max_depht: 0.02\n"), HasSubstr("max_depht"));
  EXPECT_THAT(error("depth_margin: 1.5\n"), HasSubstr("depth_margin: 1.5"));
  EXPECT_THAT(error("speeds: 10.5\n"), HasSubstr("speeds"));
  EXPECT_EQ(error("speeds: 10\n"), "");
}

}  // namespace
}  // namespace smartmill::stability
