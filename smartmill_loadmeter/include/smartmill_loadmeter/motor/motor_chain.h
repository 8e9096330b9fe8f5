#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/motor/drive_response.h"
#include "smartmill_loadmeter/motor/joint.h"
#include "smartmill_loadmeter/motor/motor_calibration.h"

namespace smartmill::loadmeter {

/// How the currents of the motors tell where they stand: electrical periods by travel and by revolution.
struct MotorParameters {
  std::array<double, 3> phase_per_metre{{0.0, 0.0, 0.0}};
  double phase_per_revolution = 0.0;
  double smallest_velocity = 1.0e-4;
  double largest_slip = 0.02;

  void declare(ParameterTable& table) {
    table.list("phase_per_metre", phase_per_metre, "1/m", Range::openHigh(0.0, 1e7),
               "electrical periods to a metre of X, Y, Z (pole pairs / lead); 0: none");
    table.number("phase_per_revolution", phase_per_revolution, "1", Range::closed(0.0, 1000.0),
                 "electrical periods to a revolution of the spindle; 0: none");
    table.number("smallest_velocity", smallest_velocity, "m/s", Range::openLow(0.0, 0.1),
                 "below it an axis stands still: its force is not observable");
    table.number("largest_slip", largest_slip, "1", Range::closed(0.0, 0.1),
                 "of the spindle's phase frequency above the speed's; 0: a synchronous motor");
  }
  bool any() const;
  /// @throws Error naming key and value.
  void validate() const;
};

/// A record of Servo Guide (daq/servo): currents with their sign that make force, and a trigger.
bool isServoRecord(const SampleBlock& block);

/// Samples of the channels x, y, z, spindle of daq/motor_current while a test is steady; or of current_x,
/// current_y, current_z of a Servo Guide record, from its trigger on.
class MotorRecord {
 public:
  void clear();
  /// Goes on with what has come so far; after a jump of the running index a longer part replaces a shorter
  /// one.
  void add(const SampleBlock& block);
  void dropAfter(double stamp);
  /// The last of it. @param duration [s]
  MotorRecord last(double duration) const;
  bool empty() const { return rate_ == 0.0; }
  double rate() const { return rate_; }  ///< [Hz]
  /// Currents have a sign: a record of Servo Guide.
  bool isSigned() const { return signed_; }
  /// [A] of channel x, y, z, spindle (0..3); empty without the channel.
  const std::vector<double>& channel(std::size_t index) const { return samples_[index]; }

 private:
  static constexpr std::size_t LONGEST = 1u << 20;
  std::array<std::vector<double>, 4> samples_;
  double rate_ = 0.0, start_ = 0.0;
  std::uint64_t next_ = 0;
  bool signed_ = false;
};

/// One test by its motors.
struct MotorReading {
  std::array<double, 3> velocity{{0, 0, 0}};   ///< [m/s] of the tool, machine axes
  double spindle_speed = 0.0;                  ///< [rad/s]
  std::array<std::optional<double>, 3> range;  ///< [A] X, Y, Z; empty: at rest, or not measured
  std::optional<double> spindle_range;         ///< [A]
  /// [A] of a range beyond the scatter of the calibration's cuts: of a record much shorter than theirs.
  std::array<double, 4> short_std{{0, 0, 0, 0}};
  std::array<std::string, 4> reason;  ///< why there is none
  bool is_signed = false;  ///< ranges are mean currents, positive where they push on: their sign is known
  std::array<std::vector<VariationLine>, 3> lines;  ///< [A2] of ranges that vary with a cut's revolution
};
/// @param is_short of a part of a cut: the noise counts beside the calibration's scatter
/// @param teeth of the tool in a cut; 0: no lines are looked for
MotorReading readMotors(const MotorRecord& record, const MotorParameters& parameters,
                        const std::array<double, 3>& velocity, double spindle_speed, bool is_short = false,
                        int teeth = 0);

/// Cutting force by the motors: F = m (I - Ia), T = a(N) dI^b(N).
struct MotorForce {
  double stamp = 0.0;                            ///< [s] last reading of the test
  std::string name;                              ///< of the test
  std::array<std::optional<Estimate>, 3> force;  ///< [N] mean force on the tool, machine X, Y, Z
  /// [N] what it is where the cut pulls the axis on harder than friction holds it: a range has no sign.
  std::array<std::optional<Estimate>, 3> other;
  std::array<std::vector<VariationLine>, 3> lines;  ///< [N2] its variation, as the drives' lag leaves it
  std::optional<Estimate> torque;                   ///< [N m] of the spindle
  std::array<std::string, 4> reason;                ///< why X, Y, Z, torque are not known
  /// E.g. "Fx -120.1 +- 3.0 N; Fy not observable: the axis stands still".
  std::string text() const;
};
/// @param air readings of air cuts so far: the one in the same direction and nearest velocity (within a
/// factor two) is subtracted, of the spindle the one at nearest speed (within a tenth).
MotorForce forceFromMotors(const MotorReading& cut, const std::vector<MotorReading>& air,
                           const MotorCalibration& calibration, const MotorParameters& parameters);

}  // namespace smartmill::loadmeter
