#pragma once

#include <array>
#include <limits>
#include <optional>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/identification/identification_parameters.h"
#include "smartmill_loadmeter/identification/load_test.h"

namespace smartmill::loadmeter {

/// Steady part of the present test: samples in an air cut at steady speed, and in a cut while the tool moves
/// between steady_from and steady_to or, where the feed turns, during the test, in all cases after the load
/// meter has settled. Where the feed turns, force and motors have no mean and are not recorded.
class SteadyRecord {
 public:
  enum class Reading { ignored, steady, unknown };

  SteadyRecord(const Spindle& spindle, const IdentificationParameters& parameters);

  /// Starts a test. @param condition empty: none.
  void begin(const std::optional<CuttingCondition>& condition);
  /// Drops the samples just before the end of the test, because stamps are times of replies.
  void end() { dropAfter(last_load_ - parameters_.guard_time); }
  void clear();  ///< the samples; the test remains
  void reset();  ///< initial state (a bag was restarted)

  void handle(const CncState& state);
  Reading handle(const LoadSample& sample);
  void handle(const SampleBlock& block);
  void handle(const ForceBlock& block);

  /// Of the present test; empty: none.
  const std::optional<CuttingCondition>& condition() const { return condition_; }
  /// Whether this is the present condition: a latched one is received again when a subscriber reconnects.
  bool isPresent(const CuttingCondition& condition) const;
  bool isTest() const { return condition_ && condition_->isSteady(); }
  bool isCut() const { return condition_ && condition_->kind == CuttingCondition::Kind::cut; }

  std::size_t readings() const { return readings_.size(); }
  /// Load samples of the test that are not numbers: the steady part ends there, and another begins after
  /// them.
  std::size_t unknown() const { return unknown_; }
  double firstStamp() const { return readings_.front().stamp; }  ///< [s] of the first of the readings
  /// Mean of the readings and force of the sensor since a stamp [s].
  LoadTest test(double since = -std::numeric_limits<double>::infinity()) const;
  const MotorRecord& motor() const { return motor_; }
  std::array<double, 3> velocity() const;  ///< [m/s] mean along the path

 private:
  struct Sample {
    double stamp, voltage, speed;  // [s], [V], [rad/s]
  };
  struct PathPoint {
    double stamp;
    std::array<double, 3> position;
  };
  bool isSteadyAt(double stamp) const;
  void dropAfter(double stamp, bool with_readings = true);

  Spindle spindle_;
  IdentificationParameters parameters_;
  double settle_time_;  // [s] of the load meter

  std::optional<CuttingCondition> condition_;
  std::optional<double> at_speed_since_, on_path_since_;  // [s] start of the steady state
  double last_load_ = 0.0, last_state_ = 0.0;             // [s]
  std::vector<PathPoint> path_;                           // in a cut, or along its line in air
  std::vector<Sample> readings_;                          // of the load meter
  std::size_t unknown_ = 0;                               // load samples of the test
  MotorRecord motor_;
  ForceRecord force_;
};

}  // namespace smartmill::loadmeter
