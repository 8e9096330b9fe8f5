#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_program/live/live_program.h"

namespace smartmill::program {

/// Place of the tool at a state of the controller.
struct PartPlace {
  double stamp = 0.0;           ///< [s]
  std::optional<double> place;  ///< [m] on the path; empty: not known
  int line = 0, part = 0;
  double feed = 0.0;  ///< [m/s]
};

/// Verdict of the chatter detection.
struct PartVerdict {
  double stamp = 0.0;  ///< [s] end of its window
  bool chatter = false;
  double frequency = NOT_A_NUMBER;  ///< [Hz]
};

/// A stretch of the path that the tool has passed, next to its prediction (topic program/progress).
struct PartProgress {
  double begin = 0.0, stamp = 0.0;  ///< [s] begin and end
  double from = 0.0, to = 0.0;      ///< [m] places on the path
  int first_line = 0, last_line = 0, part = 0;
  double peak_force = NOT_A_NUMBER;  ///< [N] largest force across the tool axis; NaN: no force
  bool compensated = true;           ///< the force is free of the sensor's dynamics throughout
  PiecePrediction predicted;         ///< largest force, least margin of the pieces
  std::vector<PartVerdict> verdicts;
};

/// Compares what the tool meets along the path of a program with what is predicted there: places, compensated
/// force and verdicts in, a report for each stretch of a given time out.
class PartMonitor {
 public:
  using Output = std::function<void(const PartProgress&)>;

  /// @param period [s] of the reports @param hold_back [s] see StreamSorter
  PartMonitor(std::shared_ptr<const LiveProgram> program, double period, double hold_back, Output output);

  /// @param predictions one for each piece of the program
  void setPredictions(std::vector<PiecePrediction> predictions);
  void push(const PartPlace& place);
  void push(const ForceBlock& block);
  void push(const PartVerdict& verdict);
  void flush() { sorter_.flush(); }  ///< at the end of the data

 private:
  void handle(const PartPlace& place);
  void handle(const ForceBlock& block);
  PiecePrediction predictedBetween(double from, double to) const;

  std::shared_ptr<const LiveProgram> program_;
  double period_;
  Output output_;
  StreamSorter sorter_;
  StreamSorter::Stream places_, blocks_, verdicts_;
  std::vector<PiecePrediction> predictions_;
  std::optional<PartProgress> present_;  // since the last report
};

}  // namespace smartmill::program
