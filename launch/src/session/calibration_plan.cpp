#include "smartmill_launch/session/calibration_plan.h"

#include <cmath>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::session {
namespace {

using Step = CalibrationStep;
using Kind = CalibrationStep::Kind;

Step manual(Kind kind, const std::array<double, 3>& load) {
  Step step;
  step.kind = kind;
  step.load = load;
  return step;
}

Step changeTool(double length) {
  Step step;
  step.kind = Kind::change_tool;
  step.length = length;
  return step;
}

Step evaluation(Kind kind) {
  Step step;
  step.kind = kind;
  return step;
}

/// Loads along x, y and z at one length, each axis a test. @param test number of the first test
void addReadings(std::vector<Step>& steps, const CalibrationParameters& parameters, double length,
                 bool reference, unsigned& test) {
  const Kind action = reference ? Kind::press_workpiece : Kind::hang_weight;
  steps.push_back(changeTool(length));
  for (std::size_t axis = 0; axis < 3; ++axis, ++test) {
    for (const double load : parameters.loads) {
      Step reading;
      reading.load[axis] = load;
      reading.length = length;
      reading.test = test;
      reading.reference = reference;
      steps.push_back(manual(action, reading.load));
      steps.push_back(reading);
    }
  }
  steps.push_back(manual(action, {0.0, 0.0, 0.0}));
}

/// Taps along an axis at each of the points, given as x, y, z in turn.
void addTaps(std::vector<Step>& steps, const std::vector<double>& points, std::size_t axis, bool reference) {
  for (std::size_t i = 0; i + 3 <= points.size(); i += 3) {
    Step step;
    step.point = {points[i], points[i + 1], points[i + 2]};
    step.direction = AXIS_NAMES[axis];
    step.reference = reference;
    for (const Kind kind : {Kind::tap_point, Kind::point, Kind::taps}) {
      step.kind = kind;
      steps.push_back(step);
    }
  }
}

std::vector<CalibrationStage> spindlePlan(const CalibrationParameters& parameters) {
  std::vector<CalibrationStage> stages;
  unsigned test = 0;
  for (const double length : parameters.lengths) {
    stages.push_back({formatted("weights on the tool, %.0f mm of tool and holder", length / units::MM), {}});
    addReadings(stages.back().steps, parameters, length, false, test);
  }
  stages.push_back({"constants of the spindle sensor", {evaluation(Kind::fit)}});
  stages.push_back(
      {formatted("reference forces, %.0f mm of tool and holder", parameters.reference_length / units::MM),
       {}});
  addReadings(stages.back().steps, parameters, parameters.reference_length, true, test);
  stages.back().steps.push_back(evaluation(Kind::verify));
  stages.back().steps.push_back(changeTool(parameters.length));
  return stages;
}

std::vector<CalibrationStage> platePlan(const CalibrationParameters& parameters) {
  std::vector<CalibrationStage> stages{{"taps on the plate", {}},
                                       {"matrix of the plate", {evaluation(Kind::fit)}},
                                       {"reference taps on the plate", {}}};
  const std::array<const std::vector<double>*, 3> points{
      {&parameters.points_x, &parameters.points_y, &parameters.points_z}};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    addTaps(stages[0].steps, *points[axis], axis, false);
    const auto first = parameters.reference_points.begin() + static_cast<std::ptrdiff_t>(3 * axis);
    addTaps(stages[2].steps, {first, first + 3}, axis, true);
  }
  stages[2].steps.push_back(evaluation(Kind::verify));
  return stages;
}

}  // namespace

void CalibrationParameters::declare(ParameterTable& table) {
  const Range lengths_range = Range::openLow(0.0, 1.0);
  const std::string points = ", from the sensor's origin, x, y, z of each";
  table.section("Calibration of a force sensor in the spindle or of a plate (docs/force_sensors.md).");
  table.choice(
      "sensor", sensor, forceSensorWords(),
      "force sensor of the machine: table: dynamometer, taps only; spindle, plate: calibrated first");
  table.text("calibration_file", file, "file for the calibration, absolute path; empty: none");
  table.number("tool_length", length, "m", lengths_range, "length of tool and holder in the cuts");
  table.list("calibration_lengths", lengths, "m", lengths_range,
             "spindle: lengths of tool and holder that weights are hung on");
  table.number("reference_length", reference_length, "m", lengths_range,
               "spindle: length that is pressed against a reference sensor");
  table.list("calibration_loads", loads, "N", Range::notNegative(),
             "spindle: loads along each axis in turn, without load first and last");
  table.number("reading_time", reading_time, "s", Range::openLow(0.0, 60.0),
               "spindle: averaging time of a load");
  table.number("load_settling", load_settling, "s", Range::closed(0.0, 60.0),
               "spindle: from the operator's answer to the reading");
  table.list(
      "tuning_speeds", tuning_speeds, "rad/s", Range::positive(),
      "spindle: spindle speeds (13950 rpm) at which the process noise of the force filter is tuned, each "
      "from two air cuts and a slot of the resonance's depth and feed; empty: none");
  const Range point_range = Range::closed(-2.0, 2.0);
  table.list("tap_points_x", points_x, "m", point_range, "plate: points of the taps along x" + points);
  table.list("tap_points_y", points_y, "m", point_range, "plate: points of the taps along y" + points);
  table.list("tap_points_z", points_z, "m", point_range, "plate: points of the taps along z" + points);
  table.list("reference_points", reference_points, "m", point_range,
             "plate: points of the taps along x, y and z that verify the matrix" + points);
  table.number("point_hits", point_hits, "1", Range::closed(1, 1000), "plate: hits at each point");
  table.number("operator_timeout", operator_timeout, "s", Range::closed(1.0, 1e5),
               "until the operator has answered a request");
}

void CalibrationParameters::validate() const {
  if (kind() == ForceSensorKind::spindle) {
    if (lengths.empty()) throw Error("calibration_lengths: empty, expected one length or more");
    if (loads.size() < 3 || loads.front() != 0.0 || loads.back() != 0.0)
      throw Error("calibration_loads: expected three or more, the first and the last without load");
  }
  for (const auto& [key, points] :
       {std::pair{"tap_points_x", &points_x}, {"tap_points_y", &points_y}, {"tap_points_z", &points_z}}) {
    if (points->empty() || points->size() % 3 != 0)
      throw Error(formatted("%s: %zu numbers, expected x, y, z of one point or more", key, points->size()));
  }
  if (reference_points.size() != 9) {
    throw Error(formatted("reference_points: %zu numbers, expected 9 (a point each along x, y and z)",
                          reference_points.size()));
  }
}

std::string CalibrationStep::request() const {
  const auto axis = [](const std::array<double, 3>& v) -> std::string {
    for (std::size_t k = 0; k < 3; ++k) {
      if (v[k] != 0.0) return formatted("%.1f N along %s", v[k], AXIS_NAMES[k]);
    }
    return "";
  };
  switch (kind) {
    case Kind::hang_weight:
      return axis(load).empty() ? "take all weights off the tool"
                                : "load the tool by a weight of " + axis(load);
    case Kind::press_workpiece:
      return axis(load).empty() ? "lift the tool off the reference sensor"
                                : "press the tool against the reference sensor with " + axis(load);
    case Kind::change_tool:
      return formatted("clamp tool and holder of %.1f mm", length / units::MM);
    case Kind::tap_point:
      return formatted("the next hits along %s are at %.1f, %.1f, %.1f mm from the sensor's origin",
                       direction.c_str(), point[0] / units::MM, point[1] / units::MM, point[2] / units::MM);
    default:
      return "";
  }
}

std::vector<CalibrationStage> calibrationPlan(const CalibrationParameters& parameters) {
  switch (parameters.kind()) {
    case ForceSensorKind::spindle:
      return spindlePlan(parameters);
    case ForceSensorKind::plate:
      return platePlan(parameters);
    default:
      return {};
  }
}

}  // namespace smartmill::session
