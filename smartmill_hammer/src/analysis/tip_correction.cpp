#include "smartmill_hammer/analysis/tip_correction.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "tip_fit.h"
#include "tip_prediction.h"

namespace smartmill::hammer {
namespace {

using Complex = std::complex<double>;
using Eigen::VectorXd;

/// Which measured modes may be tool modes, by the frequencies of the clamped tool.
std::vector<ToolModes> hypotheses(const TipProblem& problem) {
  ToolInHolder clamped = toolInHolder(problem, VectorXd::Zero(problem.unknowns()));
  clamped.spindle.clear();
  std::vector<double> own;
  const HeldTool alone(clamped);
  for (const HeldMode& h : alone.modes()) own.push_back(h.frequency);
  std::vector<ToolModes> all = {{}};
  const std::size_t n = problem.modes().size();
  const auto near = [&](std::size_t r, std::size_t k) {
    const double f = problem.modes()[r].frequency;
    return k < own.size() && f > problem.options.tool_low * own[k] && f < problem.options.tool_high * own[k];
  };
  for (std::size_t r = 0; r < n; ++r) {
    if (near(r, 0)) all.push_back({r});
    for (std::size_t s = r + 1; s < n && problem.options.most_tool_modes > 1; ++s) {
      if (near(r, 0) && near(s, 1)) all.push_back({r, s});
    }
  }
  return all;
}

void checkInput(const std::vector<OffsetMeasurement>& measurements, const ToolBeam& tool) {
  if (measurements.empty() || measurements.front().modes.modes.empty())
    throw Error("tip correction: no measured mode");
  for (const UncertainValue& k :
       {tool.stickout, tool.diameter, tool.fluted_length, tool.flute_ratio, tool.young, tool.density}) {
    if (!(k.value > 0.0 && std::isfinite(k.value) && k.std >= 0.0 && std::isfinite(k.std)))
      throw Error(
          "tip correction: stick-out, diameter, fluted length, flute ratio, Young's modulus and density of "
          "the "
          "tool: expected positive values with standard deviations, got " +
          shortNumber(k.value) + " +- " + shortNumber(k.std));
  }
  for (const OffsetMeasurement& m : measurements) {
    for (const double height : {m.struck, m.read}) {
      if (!(height >= 0.0 && height < tool.stickout.value))
        throw Error("tip correction: height " + shortNumber(1e3 * height) +
                    " mm: expected 0 up to less than the stick-out, " +
                    shortNumber(1e3 * tool.stickout.value) + " mm");
    }
  }
}

/// Weighted mean of several corrections; their scatter enters the standard deviations.
TipCorrection averageCorrections(const std::vector<TipCorrection>& all, const std::vector<double>& weights) {
  const auto best =
      static_cast<std::size_t>(std::max_element(weights.begin(), weights.end()) - weights.begin());
  TipCorrection result = all[best];
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (TipMode& tip : result.modes) {
    if (!tip.measured) continue;
    double mean = 0.0, square = 0.0, factor = 0.0;
    for (std::size_t k = 0; k < all.size(); ++k) {
      for (const TipMode& other : all[k].modes) {
        if (!other.measured || other.direct.frequency != tip.direct.frequency) continue;
        const double share = weights[k] / sum;
        mean += share * other.direct.gain;
        square += share * (std::pow(other.direct.gain, 2) + std::pow(other.direct.gain_std, 2));
        factor += share * other.factor;
      }
    }
    tip.added += mean - tip.direct.gain;
    tip.direct.gain = mean;
    tip.direct.gain_std = std::sqrt(std::max(square - mean * mean, 0.0));
    tip.factor = factor;
  }
  return result;
}

}  // namespace

void setMaterial(ToolBeam& tool, const std::string& material) {
  if (material == "carbide") {
    tool.young = ToolBeam().young;
    tool.density = ToolBeam().density;
  } else if (material == "steel") {
    tool.young = {2.1e11, 5.0e9};
    tool.density = {7900.0, 150.0};
  } else {
    throw Error("tool material '" + material + "': expected carbide or steel");
  }
}

ModalModel TipCorrection::model() const {
  ModalModel model;
  for (const TipMode& tip : modes) model.modes.push_back(tip.direct);
  model.direct = direct;
  model.direct_std = direct_std;
  return model;
}

TipCorrection correctToTip(const std::vector<OffsetMeasurement>& measurements, const ToolBeam& tool,
                           const HolderPrior& prior, double high, const TipFitOptions& options) {
  checkInput(measurements, tool);
  TipProblem problem{measurements, tool, prior, high, options, {}};
  std::vector<TipCorrection> found;
  std::vector<double> squares;
  for (const ToolModes& of_tool : hypotheses(problem)) {
    problem.of_tool = of_tool;
    const TipFit fit = fitTip(problem);
    if (!std::isfinite(fit.squares)) continue;
    found.push_back(correctionOf(problem, fit));
    squares.push_back(fit.squares);
  }
  if (found.empty()) throw Error("tip correction: no beam in a spindle explains the measured modes");
  const double least = *std::min_element(squares.begin(), squares.end());
  std::vector<double> weights;
  for (const double s : squares) weights.push_back(std::exp(-0.5 * std::min(s - least, 700.0)));
  TipCorrection result = averageCorrections(found, weights);
  result.direct += measurements.front().modes.direct;
  result.direct_std = std::hypot(result.direct_std, finiteOrZero(measurements.front().modes.direct_std));
  return result;
}

TipCorrection withoutBeyond(TipCorrection correction) {
  for (TipMode& tip : correction.beyond) {
    correction.direct -= tip.added;
    correction.direct_std = std::hypot(correction.direct_std, tip.added);
    tip.direct.gain -= tip.added;
    tip.direct.gain_std = std::hypot(tip.direct.gain_std, tip.added);
    tip.added = 0.0;
  }
  return correction;
}

FrequencyResponse tipResponse(const FrequencyResponse& measured, const TipCorrection& correction) {
  FrequencyResponse frf = measured;
  frf.std_dev.resize(frf.size(), 0.0);
  for (std::size_t i = 0; i < frf.size(); ++i) {
    const double f = frf.frequency[i];
    double variance = std::pow(finiteOrZero(frf.std_dev[i]), 2);
    for (const std::vector<TipMode>* modes : {&correction.modes, &correction.beyond}) {
      for (const TipMode& tip : *modes) {
        Mode one = tip.direct;
        one.gain = 1.0;
        const Complex u = one.response(f);
        frf.value[i] += tip.added * u;
        variance += std::norm(u) * std::pow(tip.direct.gain_std, 2);
        if (tip.measured) continue;
        one.frequency += tip.direct.frequency_std;
        variance += std::pow(tip.added, 2) * std::norm(one.response(f) - u);
      }
    }
    frf.std_dev[i] = std::sqrt(variance);
  }
  return frf;
}

}  // namespace smartmill::hammer
