#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_loadmeter/calibration/machine_calibration.h"
#include "smartmill_loadmeter/motor/anfis.h"
#include "smartmill_loadmeter/motor/motor_current.h"

namespace smartmill::loadmeter {

/// Standard cut whose forces a remote dynamometer recorded once for all machines (Cheng & Venuvinod).
struct StandardCut {
  std::string name;
  /// [N] mean, X, Y, Z, positive against the motion of the axis; empty: not recorded.
  std::array<std::optional<double>, 3> force;
  std::optional<double> torque;  ///< [N m] mean, of the spindle
};

/// The same cut on this machine: ranges of phase currents in the cut and in air with the same motion. Empty:
/// axis at rest.
struct MachineCurrents {
  std::string name;
  double spindle_speed = 0.0;                          ///< [rad/s]
  std::array<std::optional<double>, 3> current, air;   ///< [A] X, Y, Z
  std::optional<double> spindle_current, spindle_air;  ///< [A]
};

/// Methods that turn the rise of a motor's current into force or torque.
enum class MotorMethod : std::uint8_t {
  regression,  ///< F = m (I - Ia), T = a(N) dI^b(N) (Cheng & Venuvinod, section 9)
  anfis        ///< adaptive neuro-fuzzy inference (section 11)
};

/// Cuts of a calibration as inputs and output of an ANFIS: rise [A] and force [N] of a drive; rise [A], speed
/// [rpm] and torque [N m] of the spindle.
struct CalibrationSamples {
  std::vector<std::vector<double>> inputs;
  std::vector<double> outputs;

  void add(std::vector<double> input, double output);
  /// Two cuts for each unknown of its rules' lines.
  std::size_t required() const;
  /// Empty with fewer samples than required.
  std::optional<Anfis> learn() const;
};

/// RMS errors [N or N m] of both methods at the cuts of a calibration, each predicted from the others, where
/// it lies within their range (ANFIS does not extrapolate). Cheng & Venuvinod, table 1.
struct MethodErrors {
  double regression = 0.0, anfis = 0.0;
  std::size_t cuts = 0;  ///< that were predicted
};
/// Of a feed drive, F = m (I - Ia). Empty where the others are too few for ANFIS.
std::optional<MethodErrors> driveErrors(const CalibrationSamples& samples);
/// Of the spindle, T = a(N) dI^b(N), one law over all speeds.
std::optional<MethodErrors> spindleErrors(const CalibrationSamples& samples);
/// "error of the next cut 3.1 N by regression, 4.0 N by ANFIS (7 cuts)"
std::string textOf(const MethodErrors& errors, const char* unit);

/// F = m (I - Ia) of one feed drive.
struct DriveCalibration {
  Estimate
      newton_per_ampere;  ///< [N/A] m; negative when the weight aids the motion more than friction opposes it
  double scatter = 0.0;   ///< [N] standard deviation of one cut about the law
  int cuts = 0;
  CalibrationSamples samples;
  std::optional<Anfis> anfis;  ///< of the samples; empty: too few

  /// Force of a new cut against the motion [N], by regression.
  Estimate opposing(double current, double air) const;
};

struct MotorCalibration {
  std::array<std::optional<DriveCalibration>, 3> drive;  ///< X, Y, Z; empty: did not move in a standard cut
  std::optional<TorquePowerLaw> spindle;
  CalibrationSamples spindle_samples;
  std::optional<Anfis> spindle_anfis;  ///< of the samples; empty: too few
  /// Whether a drive or the spindle has enough cuts for ANFIS, so that both methods can be compared.
  bool hasAnfis() const;
  std::vector<std::string> notes;  ///< rejected cuts and inconsistencies; one line each
};

/// Tables "cut,force_x[N],force_y[N],force_z[N],torque[N m]" and "cut,spindle_speed[rpm],current_x[A],
/// air_x[A],..,current_spindle[A],air_spindle[A]"; columns in any order, missing columns and empty cells:
/// unknown. @throws Error with file, line and column.
std::vector<StandardCut> readStandardCuts(const std::string& file);
std::vector<MachineCurrents> readMachineCurrents(const std::string& file);

/// Calibration of this machine from standard cuts and its currents, matched by name.
/// @param base_speed [rad/s] of the spindle motor.
/// @throws Error when no axis has three cuts, or a name is repeated.
MotorCalibration calibrateMotors(const std::vector<StandardCut>& cuts,
                                 const std::vector<MachineCurrents>& currents, double base_speed);

/// YAML, format smartmill-motor-calibration/1. @throws Error.
void writeMotorCalibration(const MotorCalibration& calibration, const std::string& file);
MotorCalibration readMotorCalibration(const std::string& file);

}  // namespace smartmill::loadmeter
