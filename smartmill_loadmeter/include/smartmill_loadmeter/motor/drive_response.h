#pragma once

#include <optional>
#include <vector>

#include "smartmill_loadmeter/calibration/machine_calibration.h"

namespace smartmill::loadmeter {

/// How a feed drive's current follows its load: H(f) = 1 / (1 + i f / bandwidth), and what it shows of a
/// load that varies.

/// One move in air from rest to rest at constant acceleration: a line in rapid traverse.
struct DriveMove {
  std::vector<double> current;  ///< [A] of one phase, from before the move until after it
  double sample_rate = 0.0;     ///< [Hz]
  double begin = 0.0;           ///< [s] about when it begins, since the first sample
  double distance = 0.0;        ///< [m] of the axis, without sign
  double velocity = 0.0;        ///< [m/s] about, of the axis at its fastest
  double acceleration = 0.0;    ///< [m/s2] about, of the axis
};

struct DriveResponse {
  Estimate bandwidth;     ///< [Hz]
  Estimate acceleration;  ///< [A s2/m] of the range: moved mass over force an ampere
  double friction = 0.0;  ///< [A] of the range at the move's fastest
  double left = 0.0;      ///< [1] root mean square that the model leaves of the current's
};

/// The move's profile (begin, acceleration, speed), the lag and what acceleration and friction take, by
/// least squares of the phase current: its phase tells the position, its amplitude the load, which steps at
/// the ends of the ramps. @param phase_per_metre [1/m] electrical periods.
/// @return empty where the model leaves a tenth of the current or more, or the record is too short.
std::optional<DriveResponse> identifyResponse(const DriveMove& move, double phase_per_metre);

/// Weighted mean of what several moves say; the scatter between them counts. @throws Error without any.
Estimate together(const std::vector<Estimate>& estimates);

/// |H|, and by how much its logarithm changes with that of the bandwidth.
struct Following {
  double gain = 1.0, slope = 0.0;
};
Following following(double frequency, double bandwidth);

constexpr int TOOTH_LINES = 4;  ///< harmonics of tooth passing that are looked at

/// Strength of a load's line at one frequency, as the drive's lag leaves it.
struct VariationLine {
  double frequency = 0.0;  ///< [Hz]
  int tooth = 0;           ///< harmonic of tooth passing; 0: of the revolution
  double power = 0.0;      ///< [A2] of the range, or [N2]: squared amplitude, less what the noise adds
  double power_std = 0.0;  ///< the same
};
/// The lines of a cut: revolution, tooth passing and its harmonics. @param speed [rad/s] of the spindle
std::vector<VariationLine> linesOfCut(double speed, int teeth);

/// Lines of the range of a phase current while the axis moves evenly: the range modulates the phase, so a
/// line stands at both sides of it; all at once by least squares, beside the phase's fifth harmonic.
/// @param frequency [Hz] of the phase current. Lines that a sample rate of this size does not hold are left
/// out; none is told where the amplitudes are not of one carrier (a wrong frequency).
std::vector<VariationLine> linesOf(const std::vector<double>& current, double sample_rate, double frequency,
                                   const std::vector<VariationLine>& lines);

}  // namespace smartmill::loadmeter
