#pragma once

#include <cstddef>
#include <string>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_kalman/filter/harmonic_filter.h"
#include "smartmill_kalman/following/mode_follower.h"
#include "smartmill_kalman/following/speed_tracker.h"

namespace smartmill::kalman {

/// A setting that the program chooses, unless it is fixed: auto, always or never. (on and off are booleans to
/// YAML.)
struct AutoSetting {
  std::string word = "auto";

  AutoSetting() = default;
  AutoSetting(bool fixed) : word(fixed ? "always" : "never") {}  // NOLINT: a fixed setting is a flag
  bool isAuto() const { return word == "auto"; }
  bool isAlways() const { return word == "always"; }
};

/// Choice and settings of the compensation method.
struct CompensationParameters {
  HarmonicFilterParameters filter;
  double least_speed = 20.0;
  double speed_tolerance = 0.002;
  double lag = 0.0;
  bool delay_form = false;
  AutoSetting track_speed;
  double angle_timeout = 0.6;  ///< longer than the longest period of a tachometer with one pulse (0.5 s)
  SpeedTrackerParameters tracker;
  double settling_periods = 5.0;
  bool follow = false;
  int follow_revolutions = 8;
  ModeFollowerParameters follower;
  double saturation = 0.0;
  double retune_tolerance = 1e-6;  ///< [1] change of speed at which filters are retuned; a retune is cheap
  /// [s] of the stamps for which blocks wait for readings of the spindle, with track_speed auto: longer than
  /// any transport and than a player that is faster than real time runs ahead. A node stops waiting earlier
  /// (CompensationPipeline::anglesStopped).
  double angle_patience = 10.0;
  /// [1] memory_revolutions at most, with an estimated speed: 8 cost up to 0.8 % of the force more
  /// (track_speed in results.md).
  double estimated_speed_memory = 2.0;
  std::size_t retune_interval = 32;  ///< [samples] after which a tracked speed is checked for retuning
  double speed_converged = 1e-4;  ///< [1] standard deviation of a tracked speed above which a block settles
  /// Half samples of the period that the gains of the delay form may be off before they are replaced; 3
  /// diverge.
  double delay_hysteresis = 0.7;
  /// [1] RMS of a block's innovations over their standard deviation by design above which it is TRANSIENT: it
  /// is 0.95 to 1.05 in steady cuts and 5 to 11 where the tool enters or leaves.
  double innovation_limit = 3.0;
  double zero_time = 2.0;  ///< [s] time constant of the zero's average: long against a revolution

  void declare(ParameterTable& table) {
    filter.declare(table);
    table.number("least_speed", least_speed, "rad/s", Range::positive(),
                 "spindle speed below which samples pass through");
    table.number("speed_tolerance", speed_tolerance, "1", Range::open(0.0, 0.5),
                 "relative change of speed within 50 ms above which samples pass through");
    table.number("lag", lag, "s", Range::closed(0.0, 10.0),
                 "delay of the blocks; each force is estimated from the samples up to this time after it; "
                 "0: causal");
    table.flag(
        "delay_form", delay_form,
        "true: force model F(t) = F(t - T) in place of harmonics; no band limit, three times the cost; "
        "requires lag 0, no follow and no sensor_matrix, excludes an estimated speed");
    table.choice(
        "track_speed", track_speed.word, {"auto", "always", "never"},
        "estimates the spindle speed from the force, starting at the controller's speed or the cutting "
        "condition's; auto: where spindle/angle is missing or the speed ripples; the diagnostics state the "
        "reason");
    table.number("angle_timeout", angle_timeout, "s", Range::positive(),
                 "time without spindle/angle after which it is missing (track_speed auto)");
    tracker.declare(table);
    table.number("settling_periods", settling_periods, "1", Range::notNegative(),
                 "settling times after a start or a gap that are marked SETTLING");
    table.flag("follow", follow,
               "true: tracks shifts of the sensor's modes from the harmonics of the cutting force");
    table.number("follow_revolutions", follow_revolutions, "1", Range::positive(),
                 "revolutions between two updates of the modes");
    table.part("follow_", follower);
    table.number("saturation", saturation, "N", Range::notNegative(),
                 "magnitude from which a sample counts as clipped; 0: not checked");
  }
  /// These with the speed estimated or measured throughout.
  CompensationParameters withSpeed(bool estimated) const;
  /// @throws Error naming key and value.
  void validate() const;
};

}  // namespace smartmill::kalman
