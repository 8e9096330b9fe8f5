#include "smartmill_hammer/analysis/tip_correction.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>
#include <set>
#include <string>

#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/statistics.h"
#include "tool_in_holder.h"

namespace smartmill::hammer {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::VectorXd;

/// [1] model error of the beam: of the ratio of two heights, of a factor to the tip; of a frequency, of a
/// gain, and of a gain over the largest.
constexpr double MODEL_RATIO = 0.005, MODEL_FACTOR = 0.025;
constexpr double MODEL_FREQUENCY = 0.01, MODEL_GAIN = 0.03, MODEL_SMALL = 0.003;
/// Standard deviation of the measured gain of a mode that is not measured, over the largest gain.
constexpr double LARGEST_UNMEASURED = 0.03;
/// Bound of an unknown, in standard deviations of its prior.
constexpr double UNKNOWN_BOUND = 6.0;
/// Frequency of a tool mode over that of the clamped tool.
constexpr double TOOL_LOW = 0.35, TOOL_HIGH = 1.5;
constexpr std::size_t MOST_TOOL_MODES = 2;
/// Seat compliance, in standard deviations, that counts as rigid, and at the start; diameter [m] of the
/// prior.
constexpr double RIGID_SEAT = 0.01, SEAT_START = 0.3, SEAT_DIAMETER = 0.012;
/// Spread of a spindle mode without the tool about the measured one, logarithmic.
constexpr double FREQUENCY_SPREAD = 0.4, GAIN_SPREAD = 2.0;
constexpr int ROUNDS = 3, ITERATIONS = 40;
/// Step of an unknown for derivatives, with modes to first order.
constexpr double STEP = 1e-5;
/// Relative, of the damping of a mode that is not measured.
constexpr double PREDICTED_DAMPING_STD = 0.5;

enum Unknown : Index {
  YOUNG,
  DENSITY,
  STICKOUT,
  DIAMETER,
  FLUTED,
  RATIO,
  LATERAL,
  ROTATIONAL,
  HEIGHT,
  SHARED
};

/// Indices of the measured modes that are tool modes; each other one is a spindle mode.
using ToolModes = std::set<std::size_t>;

struct Problem {
  const std::vector<OffsetMeasurement>& measurements;
  const ToolBeam& tool;
  const HolderPrior& prior;
  double high;
  ToolModes of_tool;

  const std::vector<Mode>& modes() const { return measurements.front().modes.modes; }
  std::size_t spindleModes() const { return modes().size() - of_tool.size(); }
  /// Index of the scale of a further measurement over the first.
  Index scaleOf(std::size_t measurement) const {
    return SHARED + static_cast<Index>(3 * spindleModes() + measurement - 1);
  }
  Index unknowns() const { return scaleOf(measurements.size()); }
  double shift(const VectorXd& z) const { return prior.height * z[HEIGHT]; }
  double gainOf(const HeldMode& mode, const OffsetMeasurement& at, const VectorXd& z) const {
    return mode.gain(at.struck + shift(z), at.read + shift(z));
  }
  double largestGain() const {
    double largest = 0.0;
    for (const Mode& m : modes()) largest = std::max(largest, std::abs(m.gain));
    return largest;
  }
};

double scaled(const UncertainValue& known, double z) {
  return known.value * std::exp(z * known.std / known.value);
}

/// Unknowns in standard deviations of their priors; frequencies and gains of the spindle modes as logarithms
/// over their starts.
ToolInHolder toolInHolder(const Problem& problem, const VectorXd& z) {
  ToolInHolder t;
  t.young = scaled(problem.tool.young, z[YOUNG]);
  t.density = scaled(problem.tool.density, z[DENSITY]);
  t.stickout = scaled(problem.tool.stickout, z[STICKOUT]);
  t.diameter = scaled(problem.tool.diameter, z[DIAMETER]);
  t.fluted_length = std::min(scaled(problem.tool.fluted_length, z[FLUTED]), t.stickout);
  t.fluted_diameter = t.diameter * std::min(1.0, scaled(problem.tool.flute_ratio, z[RATIO]));
  t.lateral_stiffness = problem.prior.lateral_stiffness / std::max(z[LATERAL], RIGID_SEAT);
  t.rotational_stiffness = problem.prior.rotational_stiffness * std::pow(t.diameter / SEAT_DIAMETER, 3) /
                           std::max(z[ROTATIONAL], RIGID_SEAT);
  Index at = SHARED;
  for (std::size_t r = 0; r < problem.modes().size(); ++r) {
    if (problem.of_tool.count(r) > 0) continue;
    const Mode& measured = problem.modes()[r];
    const double tilt = problem.prior.tilt.value + problem.prior.tilt.std * z[at + 2];
    t.spindle.push_back(
        {measured.frequency * std::exp(z[at]), std::abs(measured.gain) * std::exp(z[at + 1]), tilt});
    at += 3;
  }
  return t;
}

/// For each measured mode the index of the model's mode that corresponds to it.
std::vector<std::size_t> matchModes(const Problem& problem, const std::vector<HeldMode>& held) {
  std::vector<std::size_t> order(problem.modes().size()), match(problem.modes().size(), held.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto& modes = problem.modes();
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return std::abs(modes[a].gain) > std::abs(modes[b].gain); });
  std::vector<bool> used(held.size(), false);
  const OffsetMeasurement& first = problem.measurements.front();
  for (const std::size_t r : order) {
    double least = INFINITY;
    for (std::size_t k = 0; k < held.size(); ++k) {
      if (used[k]) continue;
      const double gain =
          std::max(std::abs(held[k].gain(first.struck, first.read)), 1e-3 * std::abs(modes[r].gain));
      const double far = std::abs(std::log(held[k].frequency / modes[r].frequency)) / 0.05 +
                         0.3 * std::abs(std::log(gain / std::abs(modes[r].gain)));
      if (far < least) least = far, match[r] = k;
    }
    if (match[r] < held.size()) used[match[r]] = true;
  }
  return match;
}

const Mode* nearestMode(const ModalModel& model, double frequency) {
  const Mode* found = nullptr;
  for (const Mode& m : model.modes) {
    if (std::abs(m.frequency - frequency) > 0.02 * frequency) continue;
    if (!found || std::abs(m.frequency - frequency) < std::abs(found->frequency - frequency)) found = &m;
  }
  return found;
}

double finiteOrZero(double std) {
  return std::isfinite(std) ? std : 0.0;
}

/// Residuals of measured values and of priors, for a fixed match of the modes.
class TipResiduals : public fit::Residuals {
 public:
  TipResiduals(const Problem& problem, std::vector<std::size_t> match, std::size_t held_modes)
      : problem_(problem), match_(std::move(match)), held_modes_(held_modes) {}

  Index count() const override {
    const auto modes = static_cast<Index>(problem_.modes().size());
    const auto further = static_cast<Index>(problem_.measurements.size()) - 1;
    return SHARED + 3 * static_cast<Index>(problem_.spindleModes()) + further + modes * (2 + further) +
           static_cast<Index>(held_modes_);
  }

  bool evaluate(const VectorXd& z, VectorXd* residual, Eigen::MatrixXd* jacobian) const override {
    const HeldTool tool(toolInHolder(problem_, z));
    if (tool.modes().size() < held_modes_) return false;
    fillResiduals(z, tool.modes(), residual);
    if (jacobian) {
      VectorXd there(count());
      for (Index k = 0; k < z.size(); ++k) {
        VectorXd near = z;
        near[k] += STEP;
        fillResiduals(near, tool.modesOf(toolInHolder(problem_, near)), &there);
        jacobian->col(k) = (there - *residual) / STEP;
      }
    }
    return residual->allFinite();
  }

 private:
  void fillResiduals(const VectorXd& z, const std::vector<HeldMode>& held, VectorXd* residual) const {
    Index row = 0;
    const auto add = [&](double value) { (*residual)[row++] = value; };
    for (Index k = 0; k < SHARED; ++k) add(z[k]);
    for (std::size_t i = 0; i < problem_.spindleModes(); ++i) {
      const Index at = SHARED + 3 * static_cast<Index>(i);
      add(z[at] / FREQUENCY_SPREAD);
      add(z[at + 1] / GAIN_SPREAD);
      add(z[at + 2]);
    }
    for (std::size_t i = 1; i < problem_.measurements.size(); ++i) add(z[problem_.scaleOf(i)]);
    const double small = MODEL_SMALL * problem_.largestGain();
    for (std::size_t r = 0; r < match_.size(); ++r) {
      const Mode& m = problem_.modes()[r];
      const HeldMode& h = held[match_[r]];
      add(std::log(h.frequency / m.frequency) /
          std::hypot(MODEL_FREQUENCY, finiteOrZero(m.frequency_std) / m.frequency));
      const OffsetMeasurement& first = problem_.measurements.front();
      const double here = problem_.gainOf(h, first, z);
      add((here - m.gain) / std::hypot(MODEL_GAIN * m.gain, small, finiteOrZero(m.gain_std)));
      for (std::size_t i = 1; i < problem_.measurements.size(); ++i) {
        // The model error of a ratio of two heights is smaller than that of a gain.
        const OffsetMeasurement& at = problem_.measurements[i];
        const Mode* other = nearestMode(at.modes, m.frequency);
        const double ratio = other ? other->gain / m.gain : 1.0;
        const double scale = 1.0 + std::hypot(first.scale_std, at.scale_std) * z[problem_.scaleOf(i)];
        add(other ? (scale * problem_.gainOf(h, at, z) - here * ratio) /
                        std::hypot(MODEL_RATIO * other->gain, finiteOrZero(other->gain_std),
                                   ratio * finiteOrZero(m.gain_std))
                  : 0.0);
      }
    }
    for (std::size_t k = 0; k < held_modes_; ++k) {
      const bool is_matched = std::find(match_.begin(), match_.end(), k) != match_.end();
      const OffsetMeasurement& at = problem_.measurements.front();
      const bool should_be_measured = !is_matched && held[k].frequency < problem_.high;
      add(should_be_measured ? problem_.gainOf(held[k], at, z) / (LARGEST_UNMEASURED * problem_.largestGain())
                             : 0.0);
    }
  }

  const Problem& problem_;
  std::vector<std::size_t> match_;
  std::size_t held_modes_;
};

struct FittedProblem {
  VectorXd z;
  Eigen::MatrixXd covariance;
  std::vector<std::size_t> match;
  double squares = INFINITY;
};

std::size_t modesBelow(const std::vector<HeldMode>& held, double high) {
  return static_cast<std::size_t>(
      std::count_if(held.begin(), held.end(), [&](const HeldMode& h) { return h.frequency < 1.5 * high; }));
}

FittedProblem fitProblem(const Problem& problem) {
  FittedProblem best;
  best.z = VectorXd::Zero(problem.unknowns());
  best.z[LATERAL] = best.z[ROTATIONAL] = SEAT_START;
  std::vector<fit::Parameter> unknowns(static_cast<std::size_t>(problem.unknowns()),
                                       {0.0, -UNKNOWN_BOUND, UNKNOWN_BOUND, 1.0});
  unknowns[LATERAL].low = unknowns[ROTATIONAL].low = RIGID_SEAT;
  for (std::size_t i = 0; i < problem.spindleModes(); ++i) {
    unknowns[SHARED + 3 * i] = {0.0, -0.7, 0.7, 0.05};
    unknowns[SHARED + 3 * i + 1] = {0.0, -3.0, 3.0, 0.1};
  }
  fit::Options options;
  options.name = "tip correction";
  options.iterations = ITERATIONS;
  options.function_tolerance = 1e-8;
  for (int round = 0; round < ROUNDS; ++round) {
    const std::vector<HeldMode> held = HeldTool(toolInHolder(problem, best.z)).modes();
    const std::vector<std::size_t> match = matchModes(problem, held);
    if (std::count(match.begin(), match.end(), held.size()) > 0) return {};
    const TipResiduals residuals(problem, match, modesBelow(held, problem.high));
    for (std::size_t k = 0; k < unknowns.size(); ++k) unknowns[k].start = best.z[static_cast<Index>(k)];
    const fit::Result result = fit::minimise(residuals, unknowns, options);
    if (!result.usable()) return {};
    const bool converged = round > 0 && match == best.match && result.squares > 0.999 * best.squares;
    // Every unknown has a prior, so that this is regular at a bound too.
    VectorXd residual(residuals.count());
    Eigen::MatrixXd jacobian(residuals.count(), result.value.size());
    if (!residuals.evaluate(result.value, &residual, &jacobian)) return {};
    best = {result.value, linear::inverseSymmetric(Eigen::MatrixXd(jacobian.transpose() * jacobian)), match,
            result.squares};
    if (converged) break;
  }
  return best;
}

/// Predictions of a fit: of each measured mode the direct gain and the factor, gain(tip, tip) over
/// gain(struck, read), the correction; of each other mode frequency, direct gain and added gain.
struct Predictions {
  std::vector<double> direct, factor;                                // of measured modes
  std::vector<double> frequency, unmeasured_gain, unmeasured_added;  // of the others
};

Predictions predict(const Problem& problem, const FittedProblem& fit, const VectorXd& z) {
  Predictions a;
  const std::vector<HeldMode> held = HeldTool(toolInHolder(problem, z)).modes();
  const OffsetMeasurement& at = problem.measurements.front();
  for (const std::size_t k : fit.match) {
    a.direct.push_back(held[k].gain(0.0, 0.0));
    a.factor.push_back(held[k].gain(0.0, 0.0) / problem.gainOf(held[k], at, z));
  }
  for (std::size_t k = 0; k < held.size(); ++k) {
    if (std::find(fit.match.begin(), fit.match.end(), k) != fit.match.end()) continue;
    a.frequency.push_back(held[k].frequency);
    a.unmeasured_gain.push_back(held[k].gain(0.0, 0.0));
    a.unmeasured_added.push_back(held[k].gain(0.0, 0.0) - problem.gainOf(held[k], at, z));
  }
  return a;
}

VectorXd flatten(const Predictions& a) {
  std::vector<double> all;
  for (const auto* list : {&a.direct, &a.factor, &a.frequency, &a.unmeasured_gain, &a.unmeasured_added})
    all.insert(all.end(), list->begin(), list->end());
  return Eigen::Map<const VectorXd>(all.data(), static_cast<Index>(all.size()));
}

/// Standard deviations of the predictions, from the covariance of the unknowns.
VectorXd predictionStd(const Problem& problem, const FittedProblem& fit) {
  constexpr double SPAN = 1e-4;
  const Index n = fit.z.size();
  Eigen::MatrixXd map(flatten(predict(problem, fit, fit.z)).size(), n);
  for (Index k = 0; k < n; ++k) {
    VectorXd up = fit.z, down = fit.z;
    up[k] += SPAN;
    down[k] -= SPAN;
    map.col(k) = (flatten(predict(problem, fit, up)) - flatten(predict(problem, fit, down))) / (2.0 * SPAN);
  }
  return (map * fit.covariance * map.transpose()).diagonal().cwiseMax(0.0).cwiseSqrt();
}

TipMode measuredTipMode(const Mode& measured, double direct, double direct_std, double factor,
                        double factor_std) {
  TipMode tip;
  tip.direct = measured;
  tip.factor = factor;
  tip.factor_std = std::hypot(factor_std, MODEL_FACTOR * (factor - 1.0));
  // By the factor; near a node of the mode, where the factor is uncertain, by the beam.
  const double by_factor =
      std::hypot(factor * finiteOrZero(measured.gain_std), measured.gain * tip.factor_std);
  const double by_beam = std::hypot(direct_std, MODEL_GAIN * direct);
  tip.direct.gain = by_factor <= by_beam ? measured.gain * factor : direct;
  tip.direct.gain_std = std::min(by_factor, by_beam);
  tip.added = tip.direct.gain - measured.gain;
  return tip;
}

TipCorrection correctionOf(const Problem& problem, const FittedProblem& fit) {
  const Predictions a = predict(problem, fit, fit.z);
  const VectorXd std = predictionStd(problem, fit);
  const std::size_t measured = a.direct.size();
  const auto deviation = [&](std::size_t i) { return std[static_cast<Index>(i)]; };
  TipCorrection result;
  std::vector<double> damping;
  for (std::size_t r = 0; r < measured; ++r) {
    result.modes.push_back(
        measuredTipMode(problem.modes()[r], a.direct[r], deviation(r), a.factor[r], deviation(measured + r)));
    damping.push_back(problem.modes()[r].damping_ratio);
  }
  const std::size_t unmeasured = a.frequency.size();
  double variance = 0.0;
  for (std::size_t k = 0; k < unmeasured; ++k) {
    TipMode tip;
    tip.measured = false;
    tip.direct = {a.frequency[k], median(damping), a.unmeasured_gain[k]};
    tip.direct.frequency_std = std::hypot(deviation(2 * measured + k), MODEL_FREQUENCY * a.frequency[k]);
    tip.direct.damping_ratio_std = PREDICTED_DAMPING_STD * tip.direct.damping_ratio;
    tip.direct.gain_std =
        std::hypot(deviation(2 * measured + unmeasured + k), MODEL_GAIN * a.unmeasured_gain[k]);
    tip.added = a.unmeasured_added[k];
    tip.factor = tip.factor_std = INFINITY;
    if (a.frequency[k] < problem.high) {
      result.modes.push_back(tip);
      continue;
    }
    tip.direct.gain_std = std::hypot(deviation(2 * measured + 2 * unmeasured + k), MODEL_GAIN * tip.added);
    result.beyond.push_back(tip);
    result.direct += tip.added;
    variance += tip.direct.gain_std * tip.direct.gain_std;
  }
  std::sort(result.modes.begin(), result.modes.end(),
            [](const TipMode& x, const TipMode& y) { return x.direct.frequency < y.direct.frequency; });
  result.direct_std = std::sqrt(variance);
  return result;
}

/// Which measured modes may be tool modes, by the frequencies of the clamped tool.
std::vector<ToolModes> hypotheses(const Problem& problem) {
  ToolInHolder clamped = toolInHolder(problem, VectorXd::Zero(problem.unknowns()));
  clamped.spindle.clear();
  std::vector<double> own;
  const HeldTool alone(clamped);
  for (const HeldMode& h : alone.modes()) own.push_back(h.frequency);
  std::vector<ToolModes> all = {{}};
  const std::size_t n = problem.modes().size();
  const auto near = [&](std::size_t r, std::size_t k) {
    const double f = problem.modes()[r].frequency;
    return k < own.size() && f > TOOL_LOW * own[k] && f < TOOL_HIGH * own[k];
  };
  for (std::size_t r = 0; r < n; ++r) {
    if (near(r, 0)) all.push_back({r});
    for (std::size_t s = r + 1; s < n && MOST_TOOL_MODES > 1; ++s) {
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
                           const HolderPrior& prior, double high) {
  checkInput(measurements, tool);
  Problem problem{measurements, tool, prior, high, {}};
  std::vector<TipCorrection> found;
  std::vector<double> squares;
  for (const ToolModes& of_tool : hypotheses(problem)) {
    problem.of_tool = of_tool;
    const FittedProblem fit = fitProblem(problem);
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
