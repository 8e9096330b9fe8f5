#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "smartmill_kalman/compensation/compensation_method.h"
#include "smartmill_kalman/filter/harmonic_gain.h"
#include "smartmill_kalman/tuning/memory_schedule.h"

namespace smartmill::kalman {

struct GainScheduleOptions {
  double spacing = 0.01;    ///< [1] of the grid of speeds; the gains of neighbours differ little
  double hysteresis = 0.7;  ///< [spacings] that gains serve from their own speed, so that a speed halfway
                            ///< between two points does not switch gains at every block
  double frequency_tolerance = 0.01;  ///< [1] shift of a mode's frequency that the gains tolerate
};

/// Gains of three axes on a logarithmic grid of spindle speed, designed on demand and kept.
class GainSchedule {
 public:
  explicit GainSchedule(const HarmonicFilterParameters& parameters, const GainScheduleOptions& options = {})
      : parameters_(parameters), options_(options) {}

  /// Nearest grid point. @param speed [rad/s]
  int gridPointOf(double speed) const;
  /// Whether the gains of a grid point still suit a speed [rad/s].
  bool covers(int grid_point, double speed) const;

  /// Gains from quick to slow. @param sample_rate [Hz]; gains of another rate are dropped.
  const std::vector<HarmonicGain>& gains(std::size_t axis, const SensorAxis& sensor, int grid_point,
                                         double sample_rate);
  /// Whether the modes are close enough to those of the last design for its gains.
  bool suits(std::size_t axis, const ModalModel& sensor) const;
  /// Process noise over the speed from now on. Speeds without one have the fixed design.
  void setMemory(const MemorySchedule& memory);
  void clear() { gains_.clear(); }
  void clear(std::size_t axis);

 private:
  HarmonicFilterParameters parameters_;
  GainScheduleOptions options_;
  MemorySchedule memory_;
  std::map<std::pair<std::size_t, int>, std::vector<HarmonicGain>> gains_;  // by axis and grid point
  std::array<std::vector<double>, 3> design_frequencies_;                   // [Hz] of the modes, last design
  double sample_rate_ = 0.0;                                                // [Hz]
};

}  // namespace smartmill::kalman
