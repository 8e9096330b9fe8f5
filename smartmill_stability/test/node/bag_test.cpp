#include <algorithm>
#include <cmath>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>

#include "node/sound_parameters.h"
#include "recordings/bag_charts.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/shipped_parameters.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_ros/conversions.h"
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
  void operator()(const MeasuredModes& m) { write(names::TOOL_MODES, toMsg(m)); }
  void operator()(const IdentifiedForceCurves& f) { write(names::FORCE_CURVE, toMsg(f)); }
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

TEST(Bag, givesTheChartAndVerdictsOfTheNode) {
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

MeasuredModes modes(const char* direction) {
  MeasuredModes m;
  m.stamp = 1.0;
  m.tool = "tool";
  m.point = POINT_TOOL_TIP;
  m.direction = direction;
  Mode mode;
  mode.frequency = 900.0;
  mode.damping_ratio = 0.03;
  mode.gain = 1.0 / 2e7;
  m.model.modes = {mode};
  return m;
}

/// Force curve Kc h + Ke: the spline coefficients of a straight line are its values at the Greville
/// abscissae.
IdentifiedForceCurves straight(double kc, double ke, int teeth) {
  constexpr int PIECES = 8;
  constexpr double TOP = 2e-4;
  IdentifiedForceCurves found;
  found.stamp = 2.0;
  found.material = "steel";
  found.teeth = teeth;
  const auto knot = [&](int k) { return TOP * std::clamp(k, 0, PIECES) / PIECES; };
  for (auto [curve, share] : {std::pair{&found.curves.tangential, 1.0}, {&found.curves.radial, 0.3}}) {
    for (int k = 0; k <= PIECES; ++k) curve->knots.push_back(knot(k));
    for (int k = 0; k < PIECES + 3; ++k)
      curve->value.push_back(share * (kc * (knot(k - 2) + knot(k - 1) + knot(k)) / 3.0 + ke));
    curve->std_dev.assign(PIECES + 1, 0.0);
  }
  return found;
}

// For a linear force law the limits of small and large vibrations are those of its slope Kc.
TEST(Bag, givesTheLimitsForItsForceCurve) {
  const TemporaryFolder folder;
  const std::string file = folder.file("run.bag");
  CoefficientSet set = coefficients();
  set.value.ktc = 1.3e9;  // replaced by the curve
  const double kc = 700e6;
  {
    Recorder bag(file);
    bag(modes("x"));
    bag(modes("y"));
    bag(set);
    bag(straight(kc, 10e3, machine().needTool("cut").teeth));
  }
  NodeParameters p = parameters();
  p.chart.use_modes = true;
  p.bistable_speeds = 8;
  const BagCharts found = chartsFromBag(file, machine(), p);
  ASSERT_TRUE(found.bistable);
  EXPECT_EQ(found.bistable->material, "steel");
  EXPECT_NEAR(found.bistable->slope, kc, 1e-4 * kc);
  ASSERT_EQ(found.bistable->limits.size(), 8u);
  ChartMaker maker(p.chart, machine());
  maker.handle(modes("x"));
  maker.handle(modes("y"));
  maker.handle(set);
  RegenerativeSystem linear = *maker.system({});
  linear.kt = kc;
  linear.kr = 0.3 * kc;
  const auto solver = makeSolver(Method::collocation, linear, {});
  for (const BistableLimit& b : found.bistable->limits) {
    const Limit limit = solver->limit(b.speed, p.chart.max_depth);
    if (!std::isfinite(limit.depth)) continue;
    EXPECT_NEAR(b.small.depth, limit.depth, 2e-3 * limit.depth) << b.speed;
    EXPECT_NEAR(b.large.depth, limit.depth, 2e-3 * limit.depth) << b.speed;
    EXPECT_LT(b.secant.depth, 0.95 * limit.depth) << b.speed;
  }
}

TEST(Bag, listsMissingInputs) {
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

TEST(Parameters, theShippedFilesMatchTheTables) {
  expectShipped<NodeParameters>(LAUNCH_CONFIG_FOLDER "/stability.yaml", "smartmill_stability stability_node");
  EXPECT_NO_THROW(NodeParameters().validate());
  expectShipped<SoundNodeParameters>(LAUNCH_CONFIG_FOLDER "/sound.yaml", "smartmill_stability sound_node");
  expectShipped<ControlStreamParameters>("config/chatter_control.yaml",
                                         "smartmill_stability chatter_control_node");
}

TEST(Parameters, errorsNameWrongTypesUnknownKeysAndRanges) {
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
