#include "smartmill_program/prediction/wall_errors.h"

#include <algorithm>
#include <cmath>

#include "feed_frame.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/surface_error.h"

namespace smartmill::program {
namespace {

constexpr double SHARE_STEP = 0.02;  // [1] of depth and feed per tooth
constexpr int DEGREES = 180;

int logarithmicCell(double value) {
  return static_cast<int>(std::lround(std::log(value) / SHARE_STEP));
}
double ofLogarithmicCell(int cell) {
  return std::exp(cell * SHARE_STEP);
}

}  // namespace

bool WallErrors::available() const {
  const bool modes = !model_.tool_tip.x.modes.empty() || !model_.tool_tip.y.modes.empty();
  return modes && model_.tool->edge.straight() && model_.cutting && std::isfinite(model_.cutting->kte) &&
         std::isfinite(model_.cutting->kre);
}

double WallErrors::error(const Contact& contact, double feed_angle, bool left_hand, double speed,
                         double feed_per_tooth) {
  if (contact.arcs.size() != 1 || contact.arcs[0].bottom > 0.0 || !(feed_per_tooth > 0.0))
    return NOT_A_NUMBER;
  const int entry = static_cast<int>(std::lround(units::degFromRad(contact.entry())));
  const int exit = static_cast<int>(std::lround(units::degFromRad(contact.exit())));
  if ((entry == 0) == (exit == DEGREES) || exit <= entry) return NOT_A_NUMBER;
  const int direction = directionCell(feed_angle), depth = logarithmicCell(contact.axialDepth()),
            feed = logarithmicCell(feed_per_tooth);
  const int rpm = std::max(1, static_cast<int>(std::lround(units::rpmFromRadPerSec(speed))));
  const auto [place, is_new] =
      errors_.try_emplace(Cell{entry, exit, direction, depth, feed, left_hand ? -rpm : rpm}, NOT_A_NUMBER);
  if (!is_new) return place->second;
  stability::RegenerativeSystem system = systemInFeedFrame(model_, entry, exit, direction, left_hand);
  system.chip = stability::finishingChip(model_, ofLogarithmicCell(feed));
  place->second =
      stability::WallPrediction(system).at(units::radPerSecFromRpm(rpm), ofLogarithmicCell(depth)).error;
  return place->second;
}

}  // namespace smartmill::program
