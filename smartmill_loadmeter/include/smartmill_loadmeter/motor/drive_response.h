#pragma once

#include <optional>
#include <vector>

#include "smartmill_loadmeter/calibration/machine_calibration.h"

namespace smartmill::loadmeter {

/// Lag of a feed drive's current behind its load, H(f) = 1 / (1 + i f / bandwidth), and the spectral lines of
/// a varying load.

/// Rapid move in air from rest to rest at constant acceleration.
struct DriveMove {
  std::vector<double> current;  ///< [A] of one phase, from before to after the move
  double sample_rate = 0.0;     ///< [Hz]
  double begin = 0.0;           ///< [s] approximate start, since the first sample
  double distance = 0.0;        ///< [m] of the axis, absolute
  double velocity = 0.0;        ///< [m/s] approximate largest velocity of the axis
  double acceleration = 0.0;    ///< [m/s2] approximate, of the axis
};

struct DriveResponse {
  Estimate bandwidth;     ///< [Hz]
  Estimate acceleration;  ///< [A s2/m] of the range: moved mass over force per ampere
  double friction = 0.0;  ///< [A] of the range at the largest velocity
  double residual = 0.0;  ///< [1] RMS of the residual over that of the current
};

/// Fits the move's profile (start, acceleration, velocity), the lag, and the current for acceleration and
/// friction to the phase current by least squares: its phase follows the position, its amplitude the load,
/// which steps at the ends of the ramps. @param phase_per_metre [1/m] electrical periods.
/// @return empty when the residual is a tenth of the current or more, or the record is too short.
std::optional<DriveResponse> identifyResponse(const DriveMove& move, double phase_per_metre);

/// Weighted mean; its standard deviation includes the scatter. @throws Error without estimates.
Estimate weightedMean(const std::vector<Estimate>& estimates);

/// |H| and the derivative of its logarithm with respect to that of the bandwidth.
struct LagResponse {
  double gain = 1.0, slope = 0.0;
};
LagResponse lagResponse(double frequency, double bandwidth);

constexpr int TOOTH_HARMONICS = 4;  ///< harmonics of the tooth passing frequency that are used

/// Spectral line of a load, as attenuated by the drive's lag.
struct SpectralLine {
  double frequency = 0.0;  ///< [Hz]
  int tooth = 0;           ///< harmonic of the tooth passing frequency; 0: spindle frequency
  double power = 0.0;  ///< [A2] of the range, or [N2]: squared amplitude without the contribution of noise
  double power_std = 0.0;  ///< of `power`
};
/// Frequencies of a cut: spindle, tooth passing and its harmonics. @param speed [rad/s] of the spindle
std::vector<SpectralLine> cutLines(double speed, int teeth);

/// Lines of the range of a phase current during an even motion of the axis: the range modulates the phase, so
/// that each line appears as two sidebands. All lines and the fifth harmonic of the phase are fitted
/// together. @param frequency [Hz] of the phase current. Lines beyond the sample rate are left out;
/// no line is returned when the amplitudes do not belong to one carrier (wrong frequency).
std::vector<SpectralLine> fitSpectralLines(const std::vector<double>& current, double sample_rate,
                                           double frequency, const std::vector<SpectralLine>& lines);

}  // namespace smartmill::loadmeter
