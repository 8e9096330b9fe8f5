#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_daq/instrument/instrument.h"

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

/// Right sensitivity of a channel.
struct NewSensitivity {
  double value = 1.0, std_dev = 0.0;  ///< [V/unit]
  double before = 1.0;                ///< [V/unit]
  std::string unit;                   ///< of the channel
  std::size_t parts = 0;              ///< pieces or hits that were evaluated
};

/// @param channel with its present sensitivity @param reference_std [1] relative standard deviation of the
/// known quantity
NewSensitivity sensitivityOf(const Channel& channel, const ReadingRatio& ratio, double reference_std);
/// "fz: 0.01021 +- 3e-05 V/(N), so far 0.01 (+2.10 %), from 8 parts of the record"
std::string sensitivityText(const std::string& channel, const NewSensitivity& sensitivity);

/// Local date of today, YYYY-MM-DD.
std::string today();

constexpr double STANDARD_GRAVITY = 9.80665;   // [m/s2] ISO 80000-3
constexpr double EXCITER_FREQUENCY = 159.155;  // [Hz] of handheld exciters: 1000 rad/s

/// Replaces sensitivity, sensitivity_std and sensitivity_date of a channel in an instrument file; the rest,
/// comments included, stays.
/// @param sensitivity, std_dev [V/unit] @param date YYYY-MM-DD
/// @throws Error "FILE: what"; the file is then unchanged.
void storeSensitivity(const std::string& file, const std::string& topic, const std::string& channel,
                      double sensitivity, double std_dev, const std::string& date);

}  // namespace smartmill::daq
