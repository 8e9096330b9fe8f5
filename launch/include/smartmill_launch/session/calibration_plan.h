#pragma once

#include <array>
#include <string>
#include <vector>

#include "smartmill_core/model/force_sensor_kind.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::session {

/// How a session calibrates a sensor in the spindle or a plate. Units and meaning: declare().
struct CalibrationParameters {
  std::string sensor = "table";
  std::string file;
  double length = 0.139;                             // Burzoni, table 3
  std::vector<double> lengths{0.110, 0.139, 0.170};  // about it, so that the line over length is interpolated
  double reference_length = 0.125;
  std::vector<double> loads{0.0, 150.0, 300.0,
                            0.0};  // Burzoni 3.2: weights of up to 30 kg, zero before and after
  double reading_time = 0.1;
  double load_settling = 0.2;
  std::vector<double> tuning_speeds{1460.84};  // resonance_speed of the session
  std::vector<double> points_x{0.045, -0.02, 0.012, 0.045, 0.02, 0.028};
  std::vector<double> points_y{-0.02, -0.04, 0.028, 0.02, -0.04, 0.012};
  std::vector<double> points_z{-0.03, -0.025, 0.03, -0.03, 0.025, 0.03,
                               0.03,  -0.025, 0.03, 0.03,  0.025, 0.03};
  std::vector<double> reference_points{0.045, 0.0, 0.02, 0.0, -0.04, 0.02, 0.0, 0.0, 0.03};
  int point_hits = 4;
  double operator_timeout = 600.0;

  ForceSensorKind kind() const { return forceSensorKind(sensor); }
  void declare(ParameterTable& table);
  /// @throws Error naming key and value.
  void validate() const;
};

/// A manual action, a goal of kalman/calibrate, or taps of kalman/measure_frf.
struct CalibrationStep {
  enum class Kind { hang_weight, press_workpiece, change_tool, tap_point, reading, point, taps, fit, verify };
  Kind kind = Kind::reading;
  std::array<double, 3> load{{0, 0, 0}};   ///< [N] on the tool
  std::array<double, 3> point{{0, 0, 0}};  ///< [m] from the sensor's origin
  double length = 0.0;                     ///< [m] of tool and holder
  unsigned test = 0;                       ///< readings of one test have a common drift
  bool reference = false;                  ///< for verify, not for fit
  std::string direction;                   ///< of taps

  bool isManual() const { return kind <= Kind::tap_point; }
  /// The request to the operator in words; only of a manual action.
  std::string request() const;
};

/// Steps that a session reports together.
struct CalibrationStage {
  std::string name;
  std::vector<CalibrationStep> steps;
};

/// Calibration of the sensor; none for a dynamometer on the table. Spindle (Burzoni 3.2): weights along x, y,
/// z at every length of tool and holder, a fit, and the comparison with a reference at a further length; taps
/// on the tool and a second fit (dynamic cross-talk) follow. Plate (Bachrathy and Stepan, section 2): taps at
/// several points, a fit, and the comparison with the hammer at further points.
std::vector<CalibrationStage> calibrationPlan(const CalibrationParameters& parameters);

}  // namespace smartmill::session
