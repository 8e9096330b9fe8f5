#include "smartmill_program/prediction/stability_limits.h"

#include <algorithm>
#include <cmath>

#include "feed_frame.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::program {
namespace {

constexpr double ARC_STEP = 5.0;     // [deg]
constexpr double SAME_ANGLE = 0.05;  // [deg] rounding of a contact at a multiple of ARC_STEP

}  // namespace

double StabilityLimits::limit(const Contact& contact, double feed_angle, bool left_hand, double speed) {
  const int entry =
      static_cast<int>(std::floor((units::degFromRad(contact.entry()) + SAME_ANGLE) / ARC_STEP));
  const int exit = std::max(
      entry + 1, static_cast<int>(std::ceil((units::degFromRad(contact.exit()) - SAME_ANGLE) / ARC_STEP)));
  const int direction = directionCell(feed_angle);
  const int rpm = std::max(1, static_cast<int>(std::lround(units::rpmFromRadPerSec(speed))));
  const auto [place, is_new] = limits_.try_emplace(Cell{entry, exit, direction, left_hand ? -rpm : rpm}, 0.0);
  if (!is_new) return place->second;
  const stability::RegenerativeSystem system =
      systemInFeedFrame(model_, entry * ARC_STEP, exit * ARC_STEP, direction, left_hand);
  const auto solver =
      stability::makeSolver(stability::Method::collocation, system, stability::SolverOptions::ofManyPoints());
  const double most = MOST_DEPTH * model_.tool->radius();
  place->second = std::min(most, solver->limit(units::radPerSecFromRpm(rpm), most).depth);
  return place->second;
}

}  // namespace smartmill::program
