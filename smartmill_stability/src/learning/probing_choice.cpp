#include "smartmill_stability/learning/probing_choice.h"

#include <algorithm>
#include <cmath>

#include "chart/spindle_load.h"
#include "smartmill_core/require.h"

namespace smartmill::stability {
namespace {

constexpr double UNSTATED_KTC = 0.1;  // [1] standard deviation of a coefficient without one
// [1] Of the coefficient in addition to that of the identification: it depends on speed and chip thickness.
constexpr double KTC_MODEL = 0.05;
constexpr double LEAST_GAIN = 1.05;  // [1] removal of the next cut over the recommended one

MachinePrior priorOf(const ChartCut& cut, const ProbingRequest& request) {
  requireStraightEdge(cut.tool, "to choose probing cuts");
  RegenerativeSystem system;
  system.teeth = cut.tool.teeth;
  system.pitch = cut.tool.pitch;
  system.helix = cut.tool.helix;
  system.diameter = cut.tool.diameter;
  system.entry = request.entry;
  system.exit = request.exit;
  MachinePrior prior = MachinePrior::wide(system);
  if (request.ktc) {
    const double stated =
        request.ktc->std_dev > 0.0 ? request.ktc->std_dev / request.ktc->value : UNSTATED_KTC;
    const double share = std::hypot(stated, KTC_MODEL);
    prior.kt = {request.ktc->value, std::sqrt(std::log1p(share * share))};
  }
  return prior;
}

CutRange rangeOf(const ChartCut& cut, const ProbingRequest& request) {
  const ChartParameters& chart = cut.parameters;
  CutRange range;
  range.speed_low = request.speed_low > 0.0 ? request.speed_low : chart.speed_low;
  range.speed_high = request.speed_high > 0.0 ? request.speed_high : chart.speed_high;
  range.max_depth = request.max_depth > 0.0 ? std::min(request.max_depth, chart.max_depth) : chart.max_depth;
  return range;
}

}  // namespace

void ProbingRequest::validate() const {
  require("entry angle [rad]", entry, Range::closed(0.0, units::TWO_PI));
  require(exit > entry && exit <= units::TWO_PI, "exit angle [rad]", exit,
          "more than the entry angle and at most 2 pi");
  require("lowest speed [rad/s]", speed_low, Range::notNegative());
  require("highest speed [rad/s]", speed_high, Range::notNegative());
  require("largest depth [m]", max_depth, Range::notNegative());
  require("edge coefficient [N/m]", kte, Range::notNegative());
  if (!ktc) return;
  require("tangential coefficient [N/m2]", ktc->value, Range::positive());
  require("standard deviation of the tangential coefficient [N/m2]", ktc->std_dev, Range::notNegative());
}

ProbingChoice chooseProbingCut(const ChartCut& cut, const ProbingRequest& request,
                               const LearningOptions& options) {
  request.validate();
  const MachinePrior prior = priorOf(cut, request);
  ChartCut requested = cut;
  requested.parameters.entry = request.entry;
  requested.parameters.exit = request.exit;
  CoefficientSet coefficients;
  coefficients.value.ktc = prior.kt.median;
  coefficients.value.kte = request.kte;
  CutRange range = rangeOf(cut, request);
  const SpindleLoad load(requested, coefficients);
  range.depth_limit = [&](double speed) {
    const auto [torque, power] = load.limits(speed);
    return cut.parameters.load_share * std::min(torque, power);
  };
  ChartLearning learning(prior, range, options);
  for (const JudgedCut& made : request.cuts) learning.add(made);
  ProbingChoice choice;
  choice.recommended = learning.recommended();
  if (request.last) return choice;
  const CutProposal next = learning.next();
  const double least = choice.recommended ? LEAST_GAIN * choice.recommended->removal() : 0.0;
  if (next.removal() > least) choice.next = next;
  return choice;
}

}  // namespace smartmill::stability
