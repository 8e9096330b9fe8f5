#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "smartmill_core/signal/hit.h"

namespace smartmill {

struct HitCollectorOptions {
  double trigger_force = 10.0;  ///< [N] above the level before; > 0
  double pre_trigger = 0.01;    ///< [s] recorded before the trigger, > 0
  double record_length = 0.2;   ///< [s] of a record, pre-trigger included, > pre_trigger
};

/// Extracts hits from the stream of hammer force and gap voltage, sample by sample. A record is complete with
/// its last sample; missing or NaN samples make it faulty.
class HitCollector {
 public:
  explicit HitCollector(const HitCollectorOptions& options);

  /// The next force above the trigger starts a record.
  void arm();
  void disarm();
  bool armed() const { return armed_; }
  bool recording() const { return recording_; }

  /// One sample. @param time [s] @param index running index of the device @param rate [Hz]
  /// @return a complete record, once.
  struct Record {
    Hit hit;
    std::string fault;  ///< lost or NaN samples; empty: none
  };
  std::optional<Record> add(double time, std::uint64_t index, double rate, double force, double volt);

  void reset();

 private:
  void clearPreTrigger();

  HitCollectorOptions options_;
  bool armed_ = false, recording_ = false;
  double rate_ = 0.0;
  std::uint64_t next_index_ = 0;
  std::deque<double> force_before_, volt_before_;  // pre-trigger
  double sum_before_ = 0.0;                        // of these forces
  Hit hit_;
  std::string fault_;
};

}  // namespace smartmill
