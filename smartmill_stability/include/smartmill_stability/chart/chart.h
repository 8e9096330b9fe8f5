#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "smartmill_core/cutting/same_tool.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_stability/chart/measured_machine.h"
#include "smartmill_stability/chart/what_if.h"
#include "smartmill_stability/learning/probing_choice.h"

namespace smartmill::stability {

/// Whether a cut is stable.
struct Prediction {
  bool stable = false;
  bool within_spindle_limits = false;
  StabilityPoint point;
};

/// Computes charts from measurements: FRFs or modes of x and y, and coefficients, in any order.
class ChartMaker {
 public:
  /// @param model tool, spindle limits, process damping and modes of the workpiece; its sections tool_tip and
  /// cutting are not used. @throws Error on bad parameters or a model without a tool.
  ChartMaker(const ChartParameters& parameters, const MachineModel& model);

  /// As MeasuredMachine::handle().
  template <class Measured>
  void handle(const Measured& measured) {
    machine_.handle(measured);
  }

  /// List of the missing inputs; empty when a chart can be computed.
  std::string missing() const { return machine_.missing(cut_.parameters); }

  /// @throws Error when an input is missing or inputs contradict each other.
  StabilityChart chart() const;
  /// Solver of the chart, for people: "collocation" or "zero_order (no modes in x)".
  std::string solver() const;

  /// As MeasuredMachine::system().
  std::optional<RegenerativeSystem> system(const Engagement& engagement) const {
    return machine_.system(cut_, engagement);
  }
  /// As MeasuredMachine::uncertainSystem().
  std::optional<UncertainSystem> uncertainSystem(const Engagement& engagement) const {
    return machine_.uncertainSystem(cut_, engagement);
  }
  int teeth() const { return cut_.tool.teeth; }
  /// Whether the tool of a condition is that of the model, to which modes and charts belong.
  bool hasTool(const CuttingCondition& condition) const { return isSameTool(cut_.tool, condition.tool); }
  std::size_t modesInX() const { return machine_.modesInX(); }
  double highestSpeed() const { return cut_.parameters.speed_high; }  ///< [rad/s]

  /// @throws Error as chart(), and on a speed [rad/s] or depth [m] that is not positive.
  Prediction predict(double spindle_speed, double axial_depth) const;

  /// As whatIfChart().
  WhatIfChart whatIf(const WhatIf& request) const { return whatIfChart(cut_, machine_, request); }
  /// As smartmill::stability::chooseProbingCut(); requires no measurement.
  ProbingChoice chooseProbingCut(const ProbingRequest& request) const {
    return stability::chooseProbingCut(cut_, request);
  }
  double feedPerTooth() const { return cut_.parameters.feed_per_tooth; }  ///< [m]

 private:
  ChartCut cut_;
  MeasuredMachine machine_;
};

}  // namespace smartmill::stability
