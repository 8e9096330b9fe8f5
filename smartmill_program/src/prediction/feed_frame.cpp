#include "feed_frame.h"

#include <array>
#include <cmath>

#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/model_system.h"

namespace smartmill::program {
namespace {

constexpr double DIRECTION_STEP = 15.0;  // [deg]

/// A vector of the machine's axes in the feed frame.
std::array<double, 2> inFeedFrame(const std::array<double, 2>& v, double cosine, double sine, double side) {
  return {cosine * v[0] + sine * v[1], side * (-sine * v[0] + cosine * v[1])};
}

}  // namespace

int directionCell(double feed_angle) {
  const int count = static_cast<int>(std::lround(180.0 / DIRECTION_STEP));
  const int cell = static_cast<int>(std::lround(units::degFromRad(feed_angle) / DIRECTION_STEP));
  return ((cell % count) + count) % count;
}

stability::RegenerativeSystem systemInFeedFrame(const MachineModel& model, double entry_deg, double exit_deg,
                                                int direction, bool left_hand) {
  stability::RegenerativeSystem system = stability::systemOf(model, entry_deg, exit_deg);
  const double angle = units::radFromDeg(direction * DIRECTION_STEP), side = left_hand ? -1.0 : 1.0;
  for (stability::SystemMode& mode : system.modes) {
    mode.input = inFeedFrame(mode.input, std::cos(angle), std::sin(angle), side);
    mode.output = inFeedFrame(mode.output, std::cos(angle), std::sin(angle), side);
  }
  return system;
}

}  // namespace smartmill::program
