#include "smartmill_launch/session/cut_planner.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "session/number_text.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::session {
namespace {

constexpr int DECIMALS = 3;  // of lengths in mm: the controller's increment

/// The controller accepts integer revolutions per minute.
double wholeRpm(double speed) {
  return std::round(units::rpmFromRadPerSec(speed));
}

}  // namespace

double PlannedCut::cuttingTime() const {
  return (feed > 0.0 ? (to[0] - from[0]) / feed : 0.0) +
         (leave_y ? std::abs(*leave_y - to[1]) / leave_feed : 0.0);
}

double PlannedCut::duration() const {
  return spin_up + dwell + cuttingTime();
}

const char* wordOf(Immersion immersion) {
  switch (immersion) {
    case Immersion::half_up:
      return "half_up";
    case Immersion::half_down:
      return "half_down";
    case Immersion::slot:
      break;
  }
  return "slot";
}

void PathParameters::declareNames(ParameterTable& table) {
  table.text("tool", tool, "name of the tool in all results");
  table.text("material", material, "material of the stock; empty: workpiece.material of the model");
}

void PathParameters::declarePaths(ParameterTable& table) {
  table.section("Paths.");
  table.number("lane_margin", lane_margin, "m", Range::positive(), "width of the stock between two slots");
  table.number("clearance", clearance, "m", Range::positive(),
               "distance between tool and stock where the tool descends");
  table.number("safe_height", safe_height, "m", Range::positive(),
               "height above the stock at which lateral motion is safe");
  table.number("plunge_feed", plunge_feed, "m/s", Range::positive(),
               "feed of the descent to the cutting height");
  table.number("spin_up_time", spin_up_time, "s", Range::positive(),
               "spin-up time to any speed, if the model has no spindle acceleration");
  table.number("feed_block", feed_block, "1", Range::closed(0, 99999),
               "N word of the feed block, as a trigger for a record of Servo Guide; 0: none");
}

CutPlanner::CutPlanner(const MachineModel& model, const PathParameters& parameters)
    : parameters_(parameters),
      file_(model.file),
      tool_(model.needTool("plan the cuts")),
      spindle_(model.needSpindle("plan the cuts")),
      axes_(model.needAxes("plan the cuts")),
      stock_(model.needWorkpiece("plan the cuts")) {
  // The force law that a session identifies is that of vertical edges with one helix.
  ToolGeometry of_law = tool_;
  of_law.edge.helix.clear();
  try {
    requireStraightEdge(of_law, "to identify its coefficients in a session");
  } catch (const Error& error) {
    throw Error(file_ + ": " + error.what());
  }
  material_ = parameters_.material.empty() ? stock_.material : parameters_.material;
  const double width = stock_.high[1] - stock_.low[1] - 2.0 * parameters_.lane_margin - tool_.diameter;
  lanes_ = width < 0.0 ? 0 : static_cast<std::size_t>(std::floor(width / laneWidth() + 1e-9)) + 1;
  if (stock_.high[2] + parameters_.safe_height > axes_.travel[2][1]) {
    throw Error(file_ + ": safe_height " + mm(parameters_.safe_height) +
                " above the stock is beyond the travel of z");
  }
}

void CutPlanner::requireLanes(std::size_t needed, const std::string& purpose) const {
  if (needed <= lanes_) return;
  throw Error(file_ + ": the stock is " + mm(stock_.high[1] - stock_.low[1]) +
              " wide in y and has space for " + std::to_string(lanes_) + " slots of " + mm(tool_.diameter) +
              ", expected " + std::to_string(needed) + " (" + purpose + ")");
}

double CutPlanner::laneWidth() const {
  return tool_.diameter + parameters_.lane_margin;
}

double CutPlanner::height() const {
  return stock_.high[2] - stock_.low[2];
}

double CutPlanner::feedPerTooth(double speed) const {
  return axes_.rapid * 60.0 / (wholeRpm(speed) * tool_.teeth);
}

double CutPlanner::stripWidth() const {
  return tool_.radius();
}

double CutPlanner::width() const {
  return stock_.high[1] - stock_.low[1] - parameters_.lane_margin;
}

double CutPlanner::laneY(const SlotRequest& request) const {
  const double before = static_cast<double>(request.lane);
  switch (request.immersion) {
    case Immersion::half_up:
      return stock_.low[1] + before * stripWidth();
    case Immersion::half_down:
      return stock_.high[1] - before * stripWidth();
    case Immersion::slot:
      break;
  }
  return stock_.low[1] + request.shift + parameters_.lane_margin + tool_.radius() + before * laneWidth();
}

double CutPlanner::spinUp(double speed) const {
  const double time = spindle_.acceleration ? speed / *spindle_.acceleration : parameters_.spin_up_time;
  return parameters_.reserves.spin_up_factor * time + parameters_.reserves.spin_up_extra;
}

void CutPlanner::checkSpeed(const std::string& name, double speed) const {
  if (spindle_.max_speed && wholeRpm(speed) > units::rpmFromRadPerSec(*spindle_.max_speed) * (1.0 + 1e-9)) {
    throw Error(name + ": " + numberText(wholeRpm(speed), 0) + " rpm, the maximum speed of the spindle of " +
                file_ + " is " + numberText(units::rpmFromRadPerSec(*spindle_.max_speed), 0) + " rpm");
  }
}

PlannedCut CutPlanner::air(double speed, double time) const {
  PlannedCut air;
  const double rpm = wholeRpm(speed);
  air.condition.kind = CuttingCondition::Kind::air;
  air.condition.name = "air_" + numberText(rpm, 0);
  air.condition.material = material_;
  air.condition.tool_name = parameters_.tool;
  air.condition.tool = tool_;
  air.condition.spindle_speed = units::radPerSecFromRpm(rpm);
  checkSpeed(air.condition.name, speed);
  air.spin_up = spinUp(speed);
  air.dwell = time;
  return air;
}

PlannedCut CutPlanner::slot(const SlotRequest& request) const {
  checkSpeed(request.name, request.speed);
  if (!(request.depth > 0.0) || request.depth > stock_.high[2] - stock_.low[2]) {
    throw Error(request.name + ": a depth of " + mm(request.depth) + ", the height of the stock is " +
                mm(stock_.high[2] - stock_.low[2]));
  }
  const double rpm = wholeRpm(request.speed);
  const double feed_per_revolution = request.feed_per_tooth * tool_.teeth;
  PlannedCut planned;
  planned.feed = feed_per_revolution * rpm / 60.0;
  if (planned.feed > axes_.rapid) {
    throw Error(request.name + ": a feed of " + numberText(planned.feed / units::MM * 60.0) +
                " mm/min, the maximum feed of the axes of " + file_ + " is " +
                numberText(axes_.rapid / units::MM * 60.0) + " mm/min");
  }
  planned.spin_up = spinUp(request.speed);
  const double y = laneY(request), z = stock_.high[2] - request.depth;
  planned.from = {stock_.low[0] - tool_.radius() - parameters_.clearance, y, z};
  const double steady_from = stock_.low[0] + tool_.radius() + feed_per_revolution;
  const double far_end = stock_.high[0] - tool_.radius() - parameters_.reserves.exit;
  const double run_out = planned.feed * parameters_.reserves.run_out_time;
  const double steady_to = std::min(far_end, steady_from + planned.feed * request.time);
  const double time = (steady_to - steady_from) / planned.feed;
  if (!(time >= std::min(request.least_time, request.time))) {
    throw Error(request.name + ": steady cutting for " + numberText(std::max(time, 0.0), 2) + " s along " +
                mm(stock_.high[0] - stock_.low[0]) + " of stock, expected at least " +
                numberText(request.least_time, 2) + " s (reduce the feed or use a longer stock)");
  }
  planned.to = {std::max(steady_to + run_out, std::min(request.least_end, stock_.high[0])), y, z};
  const bool half = request.immersion != Immersion::slot, down = request.immersion == Immersion::half_down;
  if (half) {
    const double away = tool_.radius() + parameters_.clearance;
    planned.leave_y = down ? y + away : y - away;
    planned.leave_feed = parameters_.plunge_feed;
  }
  CuttingCondition& condition = planned.condition;
  condition.kind = CuttingCondition::Kind::cut;
  condition.name = request.name;
  condition.material = material_;
  condition.tool_name = parameters_.tool;
  condition.tool = tool_;
  condition.engagement = {down ? 0.5 * units::PI : 0.0, half && !down ? 0.5 * units::PI : units::PI,
                          request.depth, request.feed_per_tooth};
  condition.spindle_speed = units::radPerSecFromRpm(rpm);
  condition.steady_from = {steady_from, y, z};
  condition.steady_to = {steady_to, y, z};
  checkTravel(planned);
  return planned;
}

void CutPlanner::checkTravel(const PlannedCut& cut) const {
  const std::array<double, 3> left{cut.to[0], cut.leave_y.value_or(cut.to[1]), cut.to[2]};
  for (const std::array<double, 3>& point : {cut.from, cut.to, left}) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (point[axis] < axes_.travel[axis][0] || point[axis] > axes_.travel[axis][1]) {
        throw Error(cut.condition.name + ": " + "xyz"[axis] + " = " + mm(point[axis]) +
                    " is beyond the machine's travel");
      }
    }
  }
}

PlannedCut CutPlanner::airMove(double speed, double feed, double time, double distance) const {
  PlannedCut planned = air(speed, 0.0);
  CuttingCondition& condition = planned.condition;
  condition.name = "air_x_" + numberText(feed / units::MM * 60.0, 0);
  if (feed > axes_.rapid) {
    throw Error(condition.name + ": a feed of " + numberText(feed / units::MM * 60.0) +
                " mm/min, the maximum feed of the axes of " + file_ + " is " +
                numberText(axes_.rapid / units::MM * 60.0) + " mm/min");
  }
  planned.feed = feed;
  const double run_in = feed * parameters_.reserves.run_out_time, y = laneY({}),
               z = stock_.high[2] + parameters_.safe_height;
  condition.steady_from = {stock_.low[0] + run_in, y, z};
  condition.steady_to = {condition.steady_from[0] + std::max(distance, feed * time), y, z};
  planned.from = {stock_.low[0], y, z};
  planned.to = {condition.steady_to[0] + run_in, y, z};
  checkTravel(planned);
  return planned;
}

std::string CutPlanner::program(const PlannedCut& cut, const std::array<double, 3>& position) const {
  std::string text = "(" + cut.condition.name + ")\nG91\n";
  // Rounding errors do not accumulate: every target is an integer number of controller increments from the
  // start.
  std::array<long, 3> at{{0, 0, 0}};
  const double step = units::MM * std::pow(10.0, -DECIMALS);
  const auto go = [&](const std::array<std::optional<double>, 3>& target, double feed) {
    std::string words;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!target[axis]) continue;
      const long goal = std::lround((*target[axis] - position[axis]) / step);
      if (goal == at[axis]) continue;
      words += " " + std::string(1, "XYZ"[axis]) +
               numberText(static_cast<double>(goal - at[axis]) * step / units::MM, DECIMALS);
      at[axis] = goal;
    }
    if (words.empty()) return;
    text += feed > 0.0 ? "G1 F" + numberText(feed / units::MM * 60.0, DECIMALS) + words + "\n"
                       : "G0" + words + "\n";
  };
  const auto dwell = [&](double time) { text += "G4 P" + std::to_string(std::lround(time * 1000.0)) + "\n"; };
  const std::string speed = numberText(units::rpmFromRadPerSec(cut.condition.spindle_speed), 0);
  if (!(cut.feed > 0.0)) {
    text += "S" + speed + " M3\n";
    dwell(cut.spin_up + cut.dwell);
    return text + "M5\n";
  }
  const double safe = stock_.high[2] + parameters_.safe_height;
  if (position[2] < safe) go({std::nullopt, std::nullopt, safe}, 0.0);
  go({cut.from[0], cut.from[1], std::nullopt}, 0.0);
  go({std::nullopt, std::nullopt, safe}, 0.0);
  text += "S" + speed + " M3\n";
  dwell(cut.spin_up);
  go({std::nullopt, std::nullopt, cut.from[2]}, parameters_.plunge_feed);
  if (parameters_.feed_block > 0) text += "N" + std::to_string(parameters_.feed_block) + " ";
  go({cut.to[0], std::nullopt, std::nullopt}, cut.feed);
  if (cut.leave_y) go({std::nullopt, *cut.leave_y, std::nullopt}, cut.leave_feed);
  go({std::nullopt, std::nullopt, safe}, 0.0);
  return text + "M5\n";
}

}  // namespace smartmill::session
