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

/// Electrical periods of the motors' phase currents, per travel and per revolution.
struct MotorParameters {
  std::array<double, 3> phase_per_metre{{0.0, 0.0, 0.0}};
  double phase_per_revolution = 0.0;
  double smallest_velocity = 1.0e-4;
  double largest_slip = 0.02;
  std::string method = "regression";

  void declare(ParameterTable& table) {
    table.list("phase_per_metre", phase_per_metre, "1/m", Range::openHigh(0.0, 1e7),
               "electrical periods per metre of X, Y, Z (pole pairs / lead); 0: not measured");
    table.number("phase_per_revolution", phase_per_revolution, "1", Range::closed(0.0, 1000.0),
                 "electrical periods per revolution of the spindle; 0: not measured");
    table.number("smallest_velocity", smallest_velocity, "m/s", Range::openLow(0.0, 0.1),
                 "velocity below which an axis is at rest and its force not observable");
    table.number("largest_slip", largest_slip, "1", Range::closed(0.0, 0.1),
                 "largest slip of the spindle motor's phase frequency; 0: a synchronous motor");
    table.choice("method", method, {"regression", "anfis"},
                 "force from the rise of a current: by regression or by ANFIS, both from the cuts of the "
                 "calibration; ANFIS needs 8 cuts of an axis, 24 of the spindle, and does not extrapolate");
  }
  /// The same with the other method.
  MotorParameters withOtherMethod() const {
    MotorParameters other = *this;
    other.method = motorMethod() == MotorMethod::anfis ? "regression" : "anfis";
    return other;
  }
  MotorMethod motorMethod() const { return method == "anfis" ? MotorMethod::anfis : MotorMethod::regression; }
  bool any() const;
  /// @throws Error naming key and value.
  void validate() const;
};

/// Whether a block is a record of Servo Guide (daq/servo): signed, force-producing currents and a trigger.
bool isServoRecord(const SampleBlock& block);

/// Samples of the channels x, y, z, spindle of daq/motor_current during a steady test; or of current_x,
/// current_y, current_z of a Servo Guide record from its trigger on.
class MotorRecord {
 public:
  void clear();
  /// Appends a contiguous block; after a gap in the sample index a longer segment replaces a shorter one.
  void add(const SampleBlock& block);
  void dropAfter(double stamp);
  /// The last `duration` [s].
  MotorRecord last(double duration) const;
  bool empty() const { return rate_ == 0.0; }
  double rate() const { return rate_; }  ///< [Hz]
  /// Whether currents have a sign (Servo Guide).
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

/// Motor currents of one test.
struct MotorMeasurement {
  std::array<double, 3> velocity{{0, 0, 0}};   ///< [m/s] of the tool, machine axes
  double spindle_speed = 0.0;                  ///< [rad/s]
  std::array<std::optional<double>, 3> range;  ///< [A] X, Y, Z; empty: at rest or not measured
  std::optional<double> spindle_range;         ///< [A]
  /// [A] standard deviation of a range from a record much shorter than those of the calibration.
  std::array<double, 4> short_std{{0, 0, 0, 0}};
  std::array<std::string, 4> reason;  ///< why a range is empty
  bool is_signed = false;             ///< ranges are mean currents, positive in the direction of motion
  std::array<std::vector<SpectralLine>, 3> lines;  ///< [A2] of the ranges' variation
  /// [K] of the servo motors X, Y, Z; NaN: unknown
  std::array<double, 3> temperature{{NOT_A_NUMBER, NOT_A_NUMBER, NOT_A_NUMBER}};
};
/// @param is_short the record is a window of a cut, whose noise is added to the calibration's scatter
/// @param teeth of the tool in a cut; 0: no spectral lines
MotorMeasurement measureMotors(const MotorRecord& record, const MotorParameters& parameters,
                               const std::array<double, 3>& velocity, double spindle_speed,
                               bool is_short = false, int teeth = 0);

/// Cutting force by the motors: F = m (I - Ia), T = a(N) dI^b(N).
struct MotorForce {
  double stamp = 0.0;                            ///< [s] of the last reading of the test
  std::string name;                              ///< of the test
  std::array<std::optional<Estimate>, 3> force;  ///< [N] mean force on the tool, machine X, Y, Z
  /// [N] alternative value if the cut pulls the axis along with more than the friction, because a range has
  /// no sign.
  std::array<std::optional<Estimate>, 3> other;
  std::array<std::vector<SpectralLine>, 3> lines;  ///< [N2] of the force, attenuated by the drives' lag
  std::optional<Estimate> torque;                  ///< [N m] of the spindle
  std::array<std::string, 4> reason;               ///< why X, Y, Z, torque are unknown
  /// The forces by the method that was not chosen, in one line; empty where its calibration has too few cuts.
  std::string by_other_method;
  /// For example "Fx -120.1 +- 3.0 N; Fy not observable: the axis is at rest".
  std::string text() const;
};
/// @param air measurements of previous air cuts. For a feed axis the one in the same direction with the
/// nearest velocity (within a factor of 2) is subtracted, for the spindle the one with the nearest speed
/// (within 10 %).
MotorForce forceFromMotors(const MotorMeasurement& cut, const std::vector<MotorMeasurement>& air,
                           const MotorCalibration& calibration, const MotorParameters& parameters);

}  // namespace smartmill::loadmeter
