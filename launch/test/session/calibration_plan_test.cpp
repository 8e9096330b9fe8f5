#include "smartmill_launch/session/calibration_plan.h"

#include <array>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill::session {
namespace {

using Kind = CalibrationStep::Kind;

std::vector<CalibrationStep> stepsOf(const CalibrationParameters& parameters) {
  std::vector<CalibrationStep> steps;
  for (const CalibrationStage& stage : calibrationPlan(parameters))
    steps.insert(steps.end(), stage.steps.begin(), stage.steps.end());
  return steps;
}

TEST(CalibrationPlan, ATableNeedsNone) {
  EXPECT_TRUE(calibrationPlan({}).empty());
}

// Burzoni 3.2: each axis at each length is a test of its own, whose drift is known from readings without load
// before and after; the tool of the session is clamped and unloaded at the end.
TEST(CalibrationPlan, TheSpindleIsLoadedAlongEveryAxisAtEveryLength) {
  CalibrationParameters parameters;
  parameters.sensor = "spindle";
  parameters.validate();
  double length = 0.0;
  std::array<double, 3> load{};
  std::set<unsigned> fitted, referenced;
  bool fit = false;
  for (const CalibrationStep& step : stepsOf(parameters)) {
    if (step.kind == Kind::change_tool) {
      EXPECT_EQ(load, (std::array<double, 3>{}));  // no weight on a tool that is changed
      length = step.length;
    }
    if (step.kind == Kind::hang_weight || step.kind == Kind::press_workpiece) load = step.load;
    fit = fit || step.kind == Kind::fit;
    if (step.kind != Kind::reading) continue;
    EXPECT_EQ(step.load, load);
    EXPECT_EQ(step.length, length);
    EXPECT_EQ(step.reference, fit);
    (step.reference ? referenced : fitted).insert(step.test);
  }
  EXPECT_EQ(fitted.size(), 3 * parameters.lengths.size());
  EXPECT_EQ(referenced.size(), 3u);
  EXPECT_EQ(*referenced.begin(), *fitted.rbegin() + 1);
  EXPECT_EQ(length, parameters.length);
  EXPECT_EQ(load, (std::array<double, 3>{}));
}

TEST(CalibrationPlan, ThePlateIsTappedAtEveryPointAndVerifiedElsewhere) {
  CalibrationParameters parameters;
  parameters.sensor = "plate";
  const std::vector<CalibrationStep> steps = stepsOf(parameters);
  std::set<std::array<double, 3>> fitted, referenced;
  for (const CalibrationStep& step : steps) {
    if (step.kind == Kind::taps) (step.reference ? referenced : fitted).insert(step.point);
  }
  EXPECT_EQ(fitted.size(), 8u);
  ASSERT_EQ(referenced.size(), 3u);
  for (const auto& point : referenced) EXPECT_EQ(fitted.count(point), 0u);
  EXPECT_EQ(steps.back().kind, Kind::verify);
}

TEST(CalibrationPlan, RequestsAreWords) {
  CalibrationStep step;
  step.kind = Kind::hang_weight;
  step.load = {0.0, 150.0, 0.0};
  EXPECT_EQ(step.request(), "load the tool by a weight of 150.0 N along y");
  step.load = {};
  EXPECT_EQ(step.request(), "take all weights off the tool");
  step.kind = Kind::reading;
  EXPECT_FALSE(step.isManual());
}

TEST(CalibrationPlan, InvalidParametersAreNamed) {
  CalibrationParameters parameters;
  parameters.sensor = "spindle";
  parameters.loads = {150.0, 0.0, 0.0};
  EXPECT_EQ(errorOf([&] { parameters.validate(); }),
            "calibration_loads: expected three or more, the first and the last without load");
  parameters = {};
  parameters.points_y.pop_back();
  EXPECT_EQ(errorOf([&] { parameters.validate(); }),
            "tap_points_y: 5 numbers, expected x, y, z of one point or more");
  parameters = {};
  parameters.reference_points.clear();
  EXPECT_EQ(errorOf([&] { parameters.validate(); }),
            "reference_points: 0 numbers, expected 9 (a point each along x, y and z)");
}

}  // namespace
}  // namespace smartmill::session
