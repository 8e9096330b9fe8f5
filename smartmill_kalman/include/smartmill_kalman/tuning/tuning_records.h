#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>

#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/tuning/memory_tuner.h"

namespace smartmill::kalman {

struct TuningRecordOptions {
  double air_length = 1.0;  ///< [s] few megabytes a speed
  double cut_length = 2.0;  ///< [s] from steady speed on: approach, tool entry and a steady part
  double least = 0.3;       ///< [s] a shorter record begins again when the speed changes, a longer one ends
  double speed_tolerance = 0.002;  ///< [1] of the change of speed at which a record begins again or ends
  double entry = 0.02;             ///< [s] start of a cut, which must be in air
  double quiet = 2.0;              ///< [1] RMS of the force there at most, of that in air
  double same_speed = 0.01;  ///< [1] air and cut within it belong together; a later pair replaces an earlier
  std::size_t most_speeds = 32;  ///< 5 MB each; the first of them are kept
};

/// Keeps the samples that tuning requires, each speed of a run-up: the last in air at a steady speed, and the
/// first at this speed of a cut that follows, from before tool entry. The spindle may run up and stop within
/// a condition. Inputs in stamp order.
class TuningRecords {
 public:
  explicit TuningRecords(const TuningRecordOptions& options = {}) : options_(options) {}

  void handle(const SpindleAngle& angle) { speed_ = angle.speed; }
  void handle(const CuttingCondition& condition);
  /// Forces of the sensor, fx, fy, fz.
  void handle(const SampleBlock& forces);
  void reset() { *this = TuningRecords(options_); }

  /// Complete pairs by ascending speed.
  std::vector<TuningRecord> records() const;

 private:
  void closeSegment();
  bool startsInAir() const;

  TuningRecordOptions options_;
  double speed_ = 0.0;  // [rad/s] newest
  std::optional<CuttingCondition::Kind> kind_;
  TuningRecord air_, cut_;
  bool valid_ = false;     // the running segment is finite
  bool complete_ = false;  // its record has ended
  std::optional<std::uint64_t> next_index_;
  std::map<double, TuningRecord> records_;  // by speed
};

}  // namespace smartmill::kalman
