#include "smartmill_program/prediction/stability_limits.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/model_system.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::program {
namespace {

using stability::SystemMode;

constexpr double ARC_STEP = 5.0, DIRECTION_STEP = 15.0;  // [deg]
constexpr double SAME_ANGLE = 0.05;  // [deg] rounding of a contact at a multiple of ARC_STEP

/// A vector of the machine's axes in the feed frame.
std::array<double, 2> inFeedFrame(const std::array<double, 2>& v, double cosine, double sine, double side) {
  return {cosine * v[0] + sine * v[1], side * (-sine * v[0] + cosine * v[1])};
}

}  // namespace

double StabilityLimits::limit(const Contact& contact, double feed_angle, bool left_hand, double speed) {
  const int entry =
      static_cast<int>(std::floor((units::degFromRad(contact.entry()) + SAME_ANGLE) / ARC_STEP));
  const int exit = std::max(
      entry + 1, static_cast<int>(std::ceil((units::degFromRad(contact.exit()) - SAME_ANGLE) / ARC_STEP)));
  // Opposite directions have the same dynamics.
  const int directions = static_cast<int>(std::lround(180.0 / DIRECTION_STEP));
  const int direction =
      ((static_cast<int>(std::lround(units::degFromRad(feed_angle) / DIRECTION_STEP)) % directions) +
       directions) %
      directions;
  const int rpm = std::max(1, static_cast<int>(std::lround(units::rpmFromRadPerSec(speed))));
  const auto [place, is_new] = limits_.try_emplace(Cell{entry, exit, direction, left_hand ? -rpm : rpm}, 0.0);
  if (!is_new) return place->second;
  stability::RegenerativeSystem system = stability::systemOf(model_, entry * ARC_STEP, exit * ARC_STEP);
  const double angle = units::radFromDeg(direction * DIRECTION_STEP), side = left_hand ? -1.0 : 1.0;
  for (SystemMode& mode : system.modes) {
    mode.input = inFeedFrame(mode.input, std::cos(angle), std::sin(angle), side);
    mode.output = inFeedFrame(mode.output, std::cos(angle), std::sin(angle), side);
  }
  const auto solver =
      stability::makeSolver(stability::Method::collocation, system, stability::SolverOptions::ofManyPoints());
  const double most = MOST_DEPTH * model_.tool->radius();
  place->second = std::min(most, solver->limit(units::radPerSecFromRpm(rpm), most).depth);
  return place->second;
}

}  // namespace smartmill::program
