#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>

#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/tuning/memory_tuner.h"

namespace smartmill::kalman {

struct TuningRecordOptions {
  double length = 1.0;  ///< [s] of air and of cut: tool entry and a steady part, few megabytes a speed
  double speed_tolerance = 0.002;  ///< [1] a segment whose speed changes by more is not used
  double same_speed = 0.01;  ///< [1] air and cut within it belong together; a later pair replaces an earlier
  std::size_t most_speeds = 32;  ///< 5 MB each; the first of them are kept
};

/// Keeps the samples that tuning requires: the last in air and the first of a cut that follows at the same
/// speed, each speed of a run-up. Inputs in stamp order.
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

  TuningRecordOptions options_;
  double speed_ = 0.0;  // [rad/s] newest
  std::optional<CuttingCondition::Kind> kind_;
  TuningRecord air_, cut_;
  bool valid_ = false;  // the running segment: steady, no gap, finite
  std::optional<std::uint64_t> next_index_;
  std::map<double, TuningRecord> records_;  // by speed
};

}  // namespace smartmill::kalman
