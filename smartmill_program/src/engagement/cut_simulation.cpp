#include "smartmill_program/engagement/cut_simulation.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"
#include "surroundings.h"

namespace smartmill::program {
namespace {

constexpr double CHORD_ERROR = 1e-6;  // [m] last digit of a program
constexpr double MOST_STEPS = 1e7;    // of a path: kilometres

/// Chords of an arc that is not about the tool axis; other paths as they are.
std::vector<nc::PathSegment> partsOf(const nc::PathSegment& path) {
  if (!path.isArc() || path.plane() == nc::Plane::xy) return {path};
  const double most = 2.0 * std::acos(std::max(0.0, 1.0 - CHORD_ERROR / path.radius()));
  const int count = std::max(1, static_cast<int>(std::ceil(std::abs(path.sweep()) / most)));
  std::vector<nc::PathSegment> chords;
  nc::PathSegment::Point from = path.start();
  for (int k = 1; k <= count; ++k) {
    const nc::PathSegment::Point to = path.at(path.length() * k / count);
    chords.push_back(nc::PathSegment::line(from, to));
    from = to;
  }
  return chords;
}

bool above(const nc::PathSegment& path, const StockBlock& block) {
  return std::min(path.start()[2], path.target()[2]) >= block.high[2];
}

}  // namespace

CutSimulation::CutSimulation(Stock& stock, const Tool& tool, const SimulationOptions& options)
    : stock_(stock), tool_(tool), options_(options) {
  require("step length per tool radius", options.step_share, Range::openLow(0.0, 1.0));
}

bool CutSimulation::run(const Move& move, const Visit& visit) {
  for (const nc::PathSegment& part : partsOf(move.path))
    if (!runPath(move, part, visit)) return false;
  return true;
}

bool CutSimulation::runPath(const Move& move, const nc::PathSegment& path, const Visit& visit) {
  if (path.length() == 0.0) return true;
  const ToolShape& tool = tool_(move.tool);
  const double steps = std::ceil(path.length() / (options_.step_share * tool.profile.radius()));
  if (!(steps < MOST_STEPS))
    throw Error(formatted("%s: path of %.4g m, expected less than %.4g steps", move.operation.c_str(),
                          path.length(), MOST_STEPS));
  const int count = above(path, stock_.block()) ? 1 : std::max(1, static_cast<int>(steps));
  stock_.begin(Sweep(path, tool.profile));
  for (int k = 0; k < count; ++k) {
    const Step done = step(move, path.length() * k / count, path.length() * (k + 1) / count, tool);
    if (!done.air() && !move.rapid && move.spindle_speed == 0.0)
      throw Error(move.operation + " cuts with the spindle at rest, expected S and M3 or M4 before it");
    if (!visit(done)) return false;
  }
  return true;
}

Step CutSimulation::step(const Move& move, double from, double to, const ToolShape& tool) {
  const Sweep& sweep = stock_.sweep();
  const nc::PathSegment& path = sweep.path();
  const double middle = 0.5 * (from + to);
  Step step;
  step.move = &move;
  step.start = path.at(from);
  step.tip = path.at(middle);
  step.end = path.at(to);
  step.length = to - from;
  const double feed = move.rapid ? options_.rapid : move.feed;
  step.time = feed > 0.0 ? step.length / feed : 0.0;
  const nc::PathSegment::Point direction = path.direction(middle);
  step.feed_share = std::hypot(direction[0], direction[1]);
  if (step.tip[2] - std::abs(direction[2]) * step.length < stock_.block().high[2]) {
    const ToolProfile& profile = tool.profile;
    if (direction[2] < 0.0)
      step.face_volume =
          stock_.faceVolume(step.tip[0], step.tip[1], profile.flatRadius(), step.start[2], step.end[2]);
    // At the middle a cylinder touches what it has cut, where a curved surface is what it has cut.
    if (profile.flat()) stock_.advance(middle);
    if (step.feed_share > LEVEL) step.feed_angle = std::atan2(direction[1], direction[0]);
    step.contact = contactOf(stock_, profile, {step.tip, direction, move.left_hand});
    // A tool that rises removes less than its horizontal feed would.
    step.side_volume = (step.contact.side_area + std::min(0.0, step.contact.end_area)) * step.length;
    step.face_volume += std::max(0.0, step.contact.end_area) * step.length;
    stock_.advance(to);
    if (tool.holder_radius > 0.0)
      step.holder_hit = stock_.reaches(step.end[0], step.end[1], tool.holder_radius,
                                       std::min(step.start[2], step.end[2]) + tool.holder_height);
  }
  return step;
}

}  // namespace smartmill::program
