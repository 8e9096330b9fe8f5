#pragma once

#include <map>
#include <optional>
#include <string>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_stability/chart/chart_parameters.h"
#include "smartmill_stability/chart/chart_solver.h"
#include "smartmill_stability/chart/uncertainty.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Measured FRFs or modes of x and y, and coefficients, in any order.
class MeasuredMachine {
 public:
  /// Points other than the tool tip are ignored; the first result of a new tool discards those of the old
  /// one.
  void handle(const MeasuredFrf& frf);
  void handle(const MeasuredModes& modes);
  void handle(const CoefficientSet& coefficients);

  /// List of the inputs that a chart lacks; empty when it can be computed.
  std::string missing(const ChartParameters& parameters) const;
  /// Whether the limits of the chart are computed by collocation.
  bool byCollocation(const ChartParameters& parameters) const;
  /// Why the parameter `auto` selects the zero-order solution, for example "no modes in x"; empty where it
  /// does not.
  std::string fallbackReason(const ChartParameters& parameters) const;
  /// @throws Error when an input is missing or inputs contradict each other.
  ChartSolver solver(const ChartCut& cut) const;

  /// The machine, with the workpiece of the cut, in a cut with another engagement (exit <= entry: the angles
  /// of the chart); empty while modes of x and y or the tangential coefficient are missing.
  std::optional<RegenerativeSystem> system(const ChartCut& cut, const Engagement& engagement = {}) const;
  /// The same with the standard deviations of the measurements, combined with those of the parameters.
  std::optional<UncertainSystem> uncertainSystem(const ChartCut& cut,
                                                 const Engagement& engagement = {}) const;
  /// The same with those of the measurements alone. @param system of this machine, possibly modified
  UncertainSystem measuredSpread(const ChartCut& cut, const RegenerativeSystem& system) const;

  const CoefficientSet& coefficients() const { return *coefficients_; }  ///< only if none is missing
  std::size_t modesInX() const;  ///< first modes of system(); those of y and of the workpiece follow
  const std::string& tool() const { return tool_; }
  double stamp() const { return stamp_; }  ///< [s] of the newest input

 private:
  void use(const std::string& tool, double stamp);
  RegenerativeSystem cutOf(const ChartCut& cut, const Engagement& engagement) const;
  FrequencyResponse crossFrf(const ChartParameters& parameters) const;
  ToolTipResponse measuredResponse(const ChartParameters& parameters) const;

  std::map<std::string, MeasuredFrf> frfs_;
  std::map<std::string, MeasuredModes> modes_;
  std::optional<CoefficientSet> coefficients_;
  std::string tool_;
  double stamp_ = 0.0;
};

}  // namespace smartmill::stability
