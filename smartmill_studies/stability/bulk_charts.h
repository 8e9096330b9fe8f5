#pragma once

#include <random>

#include "plant/beam.h"
#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_stability/chart/chart.h"
#include "stability/study_range.h"

namespace smartmill::stability {

/// A drawn machine of a bulk of charts: an end mill in a spindle that is softer in one direction than in the
/// other, and a material.
struct ChartMachine {
  plant::ToolInSpindle x, y;  ///< the same tool
  int teeth = 0;
  double helix = 0.0;               ///< [rad]
  double ktc = 0.0, krc = 0.0;      ///< [N/m2]
  double torque = 0.0;              ///< [N m] rated, of the spindle
  double power = 0.0;               ///< [W] rated
  double fluted_share = 0.0;        ///< [1] of the overhang, 0..1
  void setOverhang(double length);  ///< [m] the flutes keep their share
};
ChartMachine drawChartMachine(std::mt19937_64& random);

/// Standard deviations of what is measured of a machine, as shares; the chart is told them.
struct ChartDoubt {
  double frequency = 0.005, damping = 0.05, gain = 0.05, ktc = 0.03, krc = 0.10;
};

struct BulkChart {
  StabilityChart chart;      ///< the product's, from what was measured
  double first_mode = 0.0;   ///< [Hz] lowest of the true machine in either direction
  double probability = 0.0;  ///< [1] of chatter at the best recommended point, by what was measured
  bool chatters = false;     ///< what the true machine does there
};

/// Measures a machine with deviations, makes the chart that stability_node would make of it (ChartMaker), and
/// asks the true machine about the best recommended point.
/// @param parameters arc, speeds, risk; a method that takes modes. @throws Error where no chart can be made
BulkChart bulkChart(const ChartMachine& machine, const ChartParameters& parameters, const ChartDoubt& doubt,
                    std::mt19937_64& random);

}  // namespace smartmill::stability
