#include "tip_fit.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::hammer {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Step of an unknown for derivatives, with modes to first order.
constexpr double STEP = 1e-5;

double scaled(const UncertainValue& known, double z) {
  return known.value * std::exp(z * known.std / known.value);
}

/// For each measured mode the index of the model's mode that corresponds to it.
std::vector<std::size_t> matchModes(const TipProblem& problem, const std::vector<HeldMode>& held) {
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

/// Residuals of measured values and of priors, for a fixed match of the modes.
class TipResiduals : public fit::Residuals {
 public:
  TipResiduals(const TipProblem& problem, std::vector<std::size_t> match, std::size_t held_modes)
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
      add(z[at] / problem_.options.frequency_spread);
      add(z[at + 1] / problem_.options.gain_spread);
      add(z[at + 2]);
    }
    for (std::size_t i = 1; i < problem_.measurements.size(); ++i) add(z[problem_.scaleOf(i)]);
    const double small = problem_.options.model_small * problem_.largestGain();
    for (std::size_t r = 0; r < match_.size(); ++r) {
      const Mode& m = problem_.modes()[r];
      const HeldMode& h = held[match_[r]];
      add(std::log(h.frequency / m.frequency) /
          std::hypot(problem_.options.model_frequency, finiteOrZero(m.frequency_std) / m.frequency));
      const OffsetMeasurement& first = problem_.measurements.front();
      const double here = problem_.gainOf(h, first, z);
      add((here - m.gain) /
          std::hypot(problem_.options.model_gain * m.gain, small, finiteOrZero(m.gain_std)));
      for (std::size_t i = 1; i < problem_.measurements.size(); ++i) {
        // The model error of a ratio of two heights is smaller than that of a gain.
        const OffsetMeasurement& at = problem_.measurements[i];
        const Mode* other = nearestMode(at.modes, m.frequency);
        const double ratio = other ? other->gain / m.gain : 1.0;
        const double scale = 1.0 + std::hypot(first.scale_std, at.scale_std) * z[problem_.scaleOf(i)];
        add(other ? (scale * problem_.gainOf(h, at, z) - here * ratio) /
                        std::hypot(problem_.options.model_ratio * other->gain, finiteOrZero(other->gain_std),
                                   ratio * finiteOrZero(m.gain_std))
                  : 0.0);
      }
    }
    for (std::size_t k = 0; k < held_modes_; ++k) {
      const bool is_matched = std::find(match_.begin(), match_.end(), k) != match_.end();
      const OffsetMeasurement& at = problem_.measurements.front();
      const bool should_be_measured = !is_matched && held[k].frequency < problem_.high;
      add(should_be_measured ? problem_.gainOf(held[k], at, z) /
                                   (problem_.options.largest_unmeasured * problem_.largestGain())
                             : 0.0);
    }
  }

  const TipProblem& problem_;
  std::vector<std::size_t> match_;
  std::size_t held_modes_;
};

std::size_t modesBelow(const std::vector<HeldMode>& held, double high) {
  return static_cast<std::size_t>(
      std::count_if(held.begin(), held.end(), [&](const HeldMode& h) { return h.frequency < 1.5 * high; }));
}

}  // namespace

double finiteOrZero(double std) {
  return std::isfinite(std) ? std : 0.0;
}

ToolInHolder toolInHolder(const TipProblem& problem, const VectorXd& z) {
  ToolInHolder t;
  t.young = scaled(problem.tool.young, z[YOUNG]);
  t.density = scaled(problem.tool.density, z[DENSITY]);
  t.stickout = scaled(problem.tool.stickout, z[STICKOUT]);
  t.diameter = scaled(problem.tool.diameter, z[DIAMETER]);
  t.fluted_length = std::min(scaled(problem.tool.fluted_length, z[FLUTED]), t.stickout);
  t.fluted_diameter = t.diameter * std::min(1.0, scaled(problem.tool.flute_ratio, z[RATIO]));
  t.lateral_stiffness = problem.prior.lateral_stiffness / std::max(z[LATERAL], problem.options.rigid_seat);
  t.rotational_stiffness = problem.prior.rotational_stiffness *
                           std::pow(t.diameter / problem.options.seat_diameter, 3) /
                           std::max(z[ROTATIONAL], problem.options.rigid_seat);
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

TipFit fitTip(const TipProblem& problem) {
  TipFit best;
  best.z = VectorXd::Zero(problem.unknowns());
  best.z[LATERAL] = best.z[ROTATIONAL] = problem.options.seat_start;
  std::vector<fit::Parameter> unknowns(
      static_cast<std::size_t>(problem.unknowns()),
      {0.0, -problem.options.unknown_bound, problem.options.unknown_bound, 1.0});
  unknowns[LATERAL].low = unknowns[ROTATIONAL].low = problem.options.rigid_seat;
  for (std::size_t i = 0; i < problem.spindleModes(); ++i) {
    unknowns[SHARED + 3 * i] = {0.0, -0.7, 0.7, 0.05};
    unknowns[SHARED + 3 * i + 1] = {0.0, -3.0, 3.0, 0.1};
  }
  fit::Options options;
  options.name = "tip correction";
  options.iterations = problem.options.iterations;
  options.function_tolerance = 1e-8;
  for (int round = 0; round < problem.options.rounds; ++round) {
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

}  // namespace smartmill::hammer
