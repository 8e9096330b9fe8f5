#pragma once

#include <random>

#include "plant/beam.h"
#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_stability/chart/chart.h"
#include "stability/study_range.h"

namespace smartmill::stability {

/// A random machine for bulk charts: an end mill in a spindle that is softer in one direction, and a
/// material.
struct ChartMachine {
  plant::ToolInSpindle x, y;  ///< the same tool
  int teeth = 0;
  double helix = 0.0;               ///< [rad]
  double ktc = 0.0, krc = 0.0;      ///< [N/m2]
  double torque = 0.0;              ///< [N m] rated, of the spindle
  double power = 0.0;               ///< [W] rated
  double fluted_share = 0.0;        ///< [1] of the overhang, 0..1
  void setOverhang(double length);  ///< [m] with a constant fluted share
};
ChartMachine drawChartMachine(std::mt19937_64& random);

/// Relative standard deviations of the measurements of a machine, which are passed to the chart.
struct ChartDoubt {
  double frequency = 0.005, damping = 0.05, gain = 0.05, ktc = 0.03, krc = 0.10;
};

struct BulkChart {
  StabilityChart chart;      ///< of the product, from the measurements
  double first_mode = 0.0;   ///< [Hz] lowest of the true machine in either direction
  double probability = 0.0;  ///< [1] of chatter at the best recommended point, from the measurements
  bool chatters = false;     ///< stability of the true machine there
};

/// Measures a machine with errors, computes its chart as stability_node does (ChartMaker), and tests the best
/// recommended point on the true machine.
/// @param parameters arc, speeds, risk; a method based on modes. @throws Error when no chart can be computed
BulkChart bulkChart(const ChartMachine& machine, const ChartParameters& parameters, const ChartDoubt& doubt,
                    std::mt19937_64& random);

}  // namespace smartmill::stability
