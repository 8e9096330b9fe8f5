#pragma once

#include <string>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {

/// Parameters of a chart; units and ranges in declare().
struct ChartParameters {
  /// [1] Least ratio of depth to limit of a point proposed for a check, so that its outcome is unambiguous.
  static constexpr double CLEARLY_UNSTABLE = 1.5;

  double entry = 0.0, exit = units::PI;
  double feed_per_tooth = 1.0e-4;
  double radial_ratio = 0.3;
  double speed_low = 200.0, speed_high = 0.0;
  int speeds = 1500;
  double frequency_low = 50.0, frequency_high = 10000.0;
  double line_error = 0.05;
  std::string method = "auto";
  double modes_error = 0.1;
  bool use_modes = false;
  double max_depth = 0.02;
  double depth_margin = 0.2;
  double speed_margin = 0.01;
  double risk = 0.05;
  double frequency_std = 0.01, gain_std = 0.05, radial_std = 0.3;
  double load_share = 0.9;
  double surface_tolerance = 0.0;
  int recommended = 5;
  double unstable_factor = 1.75;
  int unstable = 5;

  void declare(ParameterTable& table);
  /// @throws Error naming key and value.
  void validate() const;
};

/// The cut of a chart.
struct ChartCut {
  ChartParameters parameters;
  ToolGeometry tool;
  Spindle spindle;
  double process_damping = 0.0;  ///< [N/m] radial, as RegenerativeSystem::setProcessDamping()
  WorkpieceModes workpiece;      ///< where the tool cuts; without modes: rigid
};

}  // namespace smartmill::stability
