#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>

#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_core/signal/unwrapped_angle.h"
#include "smartmill_program/tool/sharp_tools.h"
#include "smartmill_program/tool/tooth_watch.h"
#include "smartmill_program/tool/wear_estimate.h"

namespace smartmill::program {

struct ToolMonitorParameters {
  ToothWatchParameters watch;
  WearParameters wear;
  double maximum_gap = 0.2;
  double path_tolerance = 1.0e-3;
  double report_period = 1.0;

  void declare(ParameterTable& table) {
    table.section("Loss of a tooth.");
    watch.declare(table);
    table.section("Wear of steady cuts.");
    wear.declare(table);
    table.number("path_tolerance", path_tolerance, "m", Range::openLow(0.0, 1.0),
                 "largest distance of the tool from the path of the steady cut");
    table.number("report_period", report_period, "s", Range::positive(),
                 "time between reports within a steady cut");
    table.section();
    table.number("maximum_gap", maximum_gap, "s", Range::openLow(0.0, 60.0),
                 "longest interval without controller state or spindle angle");
  }
  /// @throws Error naming key and value.
  void validate() const { checkBounds(*this); }
};

/// Condition of the tool (topic tool/condition).
struct ToolReport {
  double stamp = 0.0;  ///< [s]
  std::string condition, tool;
  int teeth = 0;
  bool new_loss = false;          ///< this report is that of a loss
  std::optional<ToothLoss> loss;  ///< the last one of this tool
  std::optional<CutWear> wear;    ///< of the steady cut
};

/// ToothWatch and WearEstimate behind a StreamSorter: force, spindle angle, controller states, conditions in;
/// reports out. The loss of a tooth does not need a condition.
class ToolMonitor {
 public:
  using Output = std::function<void(const ToolReport&)>;

  /// @param tools with their models @param hold_back [s] see StreamSorter @throws Error on a
  /// parameter out of range.
  ToolMonitor(const ToolMonitorParameters& parameters, SharpTools tools, double hold_back, Output output);

  /// Coefficients of the sharp tools, to which cuts that begin are compared.
  SharpTools& tools() { return tools_; }
  void push(const CuttingCondition& condition);
  void push(const CncState& state);
  void push(const SpindleAngle& angle);
  void push(const ForceBlock& block);
  /// Channels fx and fy. @throws Error when one is missing.
  void push(const SampleBlock& block);
  /// The tool has been replaced by a new one of the same name: clears the loss and the cuts for the wear, and
  /// reports.
  /// @param stamp [s] of the report
  void newTool(double stamp);
  void flush() { sorter_.flush(); }  ///< at the end of the data

  /// The name of the stream that delays the others; empty: none.
  std::string waitingFor() const { return sorter_.waitingFor(); }
  const std::optional<ToothLoss>& loss() const { return loss_; }  ///< of the present tool
  const ToolGeometry& tool() const { return tool_; }              ///< the present one
  const CuttingCondition& condition() const { return condition_; }

 private:
  struct Sample {
    double time, fx, fy;
  };
  void handle(const CuttingCondition& condition);
  void handle(const CncState& state);
  void handle(const SpindleAngle& angle);
  void handle(const ForceBlock& block);
  void changeTool(const std::string& name);
  void restart();
  void gap();
  void take(const ForceSample& sample);
  void report(double stamp, bool new_loss, const std::optional<CutWear>& wear);

  ToolMonitorParameters parameters_;
  SharpTools tools_;
  ToothWatch watch_;
  WearEstimate wear_;
  Output output_;
  StreamSorter sorter_;
  StreamSorter::Stream conditions_, states_, angles_, blocks_;

  ToolGeometry tool_;
  CuttingCondition condition_;
  std::optional<ToothLoss> loss_;            // of the present tool
  std::map<std::string, ToothLoss> losses_;  // of the others, by name
  std::deque<Sample> samples_;               // later than the last angle
  std::optional<UnwrappedAngle> angle_;
  double speed_ = 0.0;  // [rad/s] of the last reading
  std::uint64_t next_index_ = 0;
  ForceBlock::Status status_ = ForceBlock::Status::measured;    // of the last block; transient: compensated
  std::optional<double> steady_since_;                          // [s]
  double steady_ = 0.0;                                         // [s] last state on the steady path
  double reported_ = -std::numeric_limits<double>::infinity();  // [s]
};

}  // namespace smartmill::program
