#include "smartmill_kalman/following/harmonic_mode_follower.h"

#include <cmath>
#include <complex>

#include "smartmill_core/units.h"

namespace smartmill::kalman {

HarmonicModeFollower::HarmonicModeFollower(const CuttingCondition& cut, int harmonics,
                                           const ModeFollowerParameters& parameters, int revolutions,
                                           double memory_revolutions)
    : follower_(cut.tool, cut.engagement, harmonics, parameters),
      revolutions_(revolutions),
      memory_revolutions_(memory_revolutions) {
}

std::optional<ModeFollower::Update> HarmonicModeFollower::update(double now, const SpindleAngle& spindle,
                                                                 const std::vector<HarmonicFilter>& filters,
                                                                 const std::array<ModalModel, 2>& sensor,
                                                                 double noise_rms, double sample_rate) {
  const double revolution = units::TWO_PI / spindle.speed;
  if (next_update_ == 0.0) next_update_ = now + revolutions_ * revolution;
  if (now < next_update_ || !filters[0].memory().settled() || !filters[1].memory().settled())
    return std::nullopt;
  next_update_ = now + revolutions_ * revolution;
  const double angle = spindle.angle + spindle.speed * (now - spindle.stamp);
  ModeFollower::Harmonics harmonics;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    harmonics[axis] = filters[axis].pairs().measuredHarmonics();
    for (std::size_t n = 0; n < harmonics[axis].size(); ++n)
      harmonics[axis][n] *= std::polar(1.0, -static_cast<double>(n) * angle);
  }
  const double memory = memory_revolutions_ * revolution * sample_rate;  // [samples]
  return follower_.update(harmonics, noise_rms / std::sqrt(memory), sensor, spindle.speed);
}

}  // namespace smartmill::kalman
