#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace smartmill::daq {

/// Value read by a channel with its present sensitivity over the true one. The right sensitivity is the
/// present one times this ratio, negative where the direction is reversed.
struct ReadingRatio {
  double value = 1.0;     ///< [1]
  double std_dev = 0.0;   ///< [1] from the scatter between the parts of the record, widened by Student's t
  std::size_t parts = 0;  ///< pieces or hits that were evaluated
};

/// An accelerometer on a handheld exciter, whose effective acceleration is known (ISO 16063-44). The
/// frequency is searched within 2 % of the stated one.
/// @param samples [m/s2] or in the unit of the channel @param rate [Hz] @param frequency [Hz]
/// @param rms of the exciter, in the unit of the channel
/// @throws Error: shorter than three pieces of 50 periods, not finite, or not a sine (distortion above 10 %)
ReadingRatio ratioByExciter(const std::vector<double>& samples, double rate, double frequency, double rms);

/// A force sensor loaded by a known mass.
/// @param without, with [N] records without the mass and with it, each at rest
/// @param force [N] of the mass along the channel, positive in its direction
/// @throws Error: shorter than four pieces, not finite, or the load does not exceed the scatter
ReadingRatio ratioByMass(const std::vector<double>& without, const std::vector<double>& with, double force);

/// A hammer on a freely hanging rigid mass with a calibrated accelerometer: F = m a during contact.
/// @param force, acceleration [N], [m/s2] of the same instants @param mass [kg] with the accelerometer
/// @throws Error: no three hits, not finite, or force and acceleration are not in proportion (above 5 %)
ReadingRatio ratioByHits(const std::vector<double>& force, const std::vector<double>& acceleration,
                         double rate, double mass);

/// Replaces sensitivity, sensitivity_std and sensitivity_date of a channel in an instrument file; the rest,
/// comments included, stays.
/// @param sensitivity, std_dev [V/unit] @param date YYYY-MM-DD
/// @throws Error "FILE: what"; the file is then unchanged.
void storeSensitivity(const std::string& file, const std::string& topic, const std::string& channel,
                      double sensitivity, double std_dev, const std::string& date);

}  // namespace smartmill::daq
