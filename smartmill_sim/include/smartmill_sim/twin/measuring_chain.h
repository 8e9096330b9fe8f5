#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/model/effect.h"
#include "smartmill_sim/effects/delay_line.h"
#include "smartmill_sim/effects/shelf_filter.h"
#include "smartmill_sim/twin/spindle_drive.h"

namespace smartmill::sim {

/// Channels of many steps before the signal stage: one row each; nullptr: not requested.
using ChannelRows = std::array<std::vector<double>*, CHANNEL_COUNT>;

/// Cutting forces of many steps.
struct ForceHistory {
  CuttingForce before;  ///< at the step before the first one
  std::vector<CuttingForce> force;
  std::vector<std::array<double, 3>> applied;  ///< [N] force on the sensor; empty: the cutting force alone
  std::vector<std::pair<std::size_t, double>> jumps;  ///< steps with a jump of the force, share of the jump
};

/// Force sensor, load meter and the filters of the channels, in constant time steps.
class MeasuringChain {
 public:
  /// @param sensor_tolerance [1] relative change of a sensor mode that updates its filter: far below the
  /// uncertainty of a mode
  MeasuringChain(const TwinSetup& setup, double time_step, double sensor_tolerance = 1e-5);

  /// Changes of sensor and drive by the effects.
  void update(const TwinState& state);
  /// Of forces and load meter only these channels are measured from here on.
  void select(const std::vector<std::size_t>& channels);
  /// Sets the load meter to its steady value in an air cut. @return [V]
  double resetLoad(double spindle_speed);
  /// Sets the past of a delayed channel to a constant value.
  void resetDelay(std::size_t channel, double value);

  /// Measures one step. @param before cutting force at the last step @param jump [1] share of its change that
  /// is a jump @param applied [N] force on the sensor
  void measure(const CuttingForce& before, const CuttingForce& now, double jump,
               const std::array<double, 3>& applied, double speed, ChannelValues& channels);
  /// Resonances, shelves and delays of the channels.
  void filter(ChannelValues& channels);
  /// As measure() and filter(), for many steps at constant speed.
  void measure(const ForceHistory& history, double speed, const ChannelRows& rows);
  void filter(std::size_t steps, const ChannelRows& rows);

  /// Whether a filter feeds one channel into another.
  bool mixes() const { return !resonances_.empty(); }
  /// Voltage rounded to the load meter's resolution [V].
  double rounded(double voltage) const { return drive_ ? drive_->rounded(voltage) : voltage; }

 private:
  double sensor_tolerance_;
  std::array<ModalModel, 3> model_;  // of the force sensor
  double rate_, force_sign_;
  std::vector<ModalFilter> sensor_;  // x, y, z
  double sensor_frequency_ = 1.0;    // present frequency of the first modes over the model's
  std::optional<SpindleDrive> drive_;
  std::array<bool, 3> force_selected_{{true, true, true}};
  bool load_selected_ = true;
  std::vector<std::pair<Resonance, ModalFilter>> resonances_;
  std::vector<std::pair<std::size_t, ShelfFilter>> shelves_;
  std::vector<std::pair<std::size_t, DelayLine>> delays_;
};

}  // namespace smartmill::sim
