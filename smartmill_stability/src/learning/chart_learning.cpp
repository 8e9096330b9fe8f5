#include "smartmill_stability/learning/chart_learning.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <utility>

#include "learning/geometric_grid.h"
#include "smartmill_core/error.h"
#include "smartmill_core/math/normal.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/learning/evidence.h"

namespace smartmill::stability {
namespace {

constexpr double INFINITE = std::numeric_limits<double>::infinity();
constexpr double SPEED_STEP = 0.015;     // [1] between speeds of the grid
constexpr double DEPTH_STEP = 0.06;      // [1] between depths of the grid
constexpr double LEAST_DEPTH = 0.01;     // [1] of the largest
constexpr double SAME_SPEED = 0.002;     // [1] of a cut that was made
constexpr int LINES = 24;                // frequencies of a mode, dense around it
constexpr double FREQUENCY_RANGE = 3.0;  // [1] of the logarithm of chatter frequencies, 200 Hz .. 4 kHz
constexpr int EXAMINED = 12;             // most cuts that collocation judges for a recommendation
constexpr double LOOSE = 2.0;  // [1] probability of chatter over the risk, up to which a cut is examined

/// Nodes for a verdict, 0.1 % of the depth.
SolverOptions verdictOptions() {
  SolverOptions options;
  options.nodes = 8;
  return options;
}

std::unique_ptr<FloquetSolver> solverOf(const RegenerativeSystem& machine) {
  return makeFloquetSolver(Method::collocation, machine, verdictOptions());
}

/// Zero-order limits at ascending speeds [rad/s].
StabilityLimit zeroOrderOf(const RegenerativeSystem& machine, const std::vector<double>& speeds) {
  std::vector<double> frequencies;
  for (const SystemMode& mode : machine.modes)
    for (const double f : linesAround(mode.frequency, mode.damping_ratio, LINES)) frequencies.push_back(f);
  std::sort(frequencies.begin(), frequencies.end());
  frequencies.erase(std::unique(frequencies.begin(), frequencies.end()), frequencies.end());
  const RegenerativeProcess process{machine.teeth, machine.entry, machine.exit, machine.kt,
                                    machine.kr / machine.kt};
  return zeroOrderLimit(process, responseOf(machine.modes, std::move(frequencies)), speeds);
}

/// [1] Standard deviation of a share of a count, with half a machine on either side.
double deviationOf(double stable, std::size_t count) {
  const auto n = static_cast<double>(count);
  const double share = (stable * n + 0.5) / (n + 1.0);
  return std::sqrt(share * (1.0 - share) / n);
}

class LogMean {
 public:
  void add(double weight, double value) {
    const double log_value = std::log(value);
    weights_ += weight;
    sum_ += weight * log_value;
    squares_ += weight * log_value * log_value;
  }
  LogEstimate estimate() const {
    const double mean = sum_ / weights_;
    return {std::exp(mean), std::sqrt(std::max(0.0, squares_ / weights_ - mean * mean))};
  }

 private:
  double weights_ = 0.0, sum_ = 0.0, squares_ = 0.0;
};

}  // namespace

void CutRange::validate() const {
  require("lowest speed [rad/s]", speed_low, Range::positive());
  require(speed_high > speed_low, "highest speed [rad/s]", speed_high, "more than the lowest speed");
  require("largest depth [m]", max_depth, Range::positive());
}

void LearningOptions::validate() const {
  require("candidates", static_cast<double>(candidates), Range::closed(100, 1e6));
  require("kept machines", static_cast<double>(kept), Range::closed(50, 1e6));
  require("machines of a chart", static_cast<double>(shown), Range::closed(20, 1e5));
  require("probability of another component", other_component, Range::open(0.0, 1.0));
  require("machines that judge", static_cast<double>(judged), Range::closed(20, 1e5));
  require("least share of effective machines", least_effective, Range::closed(0.0, 1.0));
  require("moves", moves, Range::closed(0, 1000));
  require("probability of a wrong verdict", wrong, Range::open(0.0, 0.5));
  require("standard deviation of a chatter frequency [1]", frequency_error, Range::open(0.0, 0.5));
  require("scatter of a limit [1]", scatter, Range::open(0.0, 1.0));
  require("risk", risk, Range::open(0.0, 1.0));
  require("risk offset", risk_offset, Range::positive());
}

ChartLearning::ChartLearning(const MachinePrior& prior, const CutRange& range, const LearningOptions& options)
    : prior_(prior), range_(range), options_(options), random_(options.seed) {
  prior_.validate();
  range_.validate();
  options_.validate();
  if (options_.risk < options_.wrong)
    throw Error("risk: expected at least the probability of a wrong verdict");
  speeds_ = geometricGrid(range.speed_low, range.speed_high, SPEED_STEP);
  depths_ = geometricGrid(LEAST_DEPTH * range.max_depth, range.max_depth, DEPTH_STEP);
  for (const double speed : speeds_)
    most_.push_back(range.depth_limit ? std::min(range.max_depth, range.depth_limit(speed))
                                      : range.max_depth);
  std::normal_distribution<double> normal;
  machines_.resize(options_.candidates);
  for (Machine& machine : machines_)
    for (std::size_t k = 0; k < prior_.coordinates(); ++k) machine.at.push_back(normal(random_));
  effective_ = static_cast<double>(machines_.size());
  show();
}

double ChartLearning::logLikelihood(const std::vector<double>& at) const {
  const RegenerativeSystem machine = prior_.machine(at);
  const StabilityLimit limit = zeroOrderOf(machine, cut_speeds_);
  double sum = 0.0;
  for (const JudgedCut& cut : cuts_) {
    const auto k = static_cast<std::size_t>(
        std::lower_bound(cut_speeds_.begin(), cut_speeds_.end(), cut.speed) - cut_speeds_.begin());
    if (cut.kt) sum -= 0.5 * std::pow((machine.kt - cut.kt->value) / cut.kt->std_dev, 2);
    const double beyond = std::log(cut.depth / limit.depth[k]) / options_.scatter;
    const double agrees = normalCdf(cut.chatter ? beyond : -beyond);
    sum += std::log(options_.wrong + (1.0 - options_.wrong) * agrees);
    if (!cut.chatter || !cut.frequency || std::isinf(limit.depth[k])) continue;
    const double error = std::hypot(options_.frequency_error, cut.frequency->std_dev / cut.frequency->value);
    // Density of any frequency over that of the predicted one at its maximum.
    const double other = options_.other_component * std::sqrt(units::TWO_PI) * error / FREQUENCY_RANGE;
    sum += std::log(frequencyLikelihood(limit.chatter_frequency[k], cut.frequency->value, error, other));
  }
  return sum;
}

void ChartLearning::add(const JudgedCut& cut) {
  require("speed of a cut [rad/s]", cut.speed, Range::positive());
  require("depth of a cut [m]", cut.depth, Range::positive());
  if (cut.frequency) {
    require("chatter frequency [Hz]", cut.frequency->value, Range::positive());
    require("standard deviation of a chatter frequency [Hz]", cut.frequency->std_dev, Range::notNegative());
  }
  if (cut.kt) {
    require("tangential coefficient [N/m2]", cut.kt->value, Range::positive());
    require("standard deviation of a tangential coefficient [N/m2]", cut.kt->std_dev, Range::positive());
  }
  cuts_.push_back(cut);
  cut_speeds_.push_back(cut.speed);
  std::sort(cut_speeds_.begin(), cut_speeds_.end());
  cut_speeds_.erase(std::unique(cut_speeds_.begin(), cut_speeds_.end()), cut_speeds_.end());
  for (Machine& machine : machines_) {
    const double all = logLikelihood(machine.at);
    machine.log_weight += all - machine.log_likelihood;
    machine.log_likelihood = all;
  }
  effective_ = effectiveCount(weights());
  if (effective_ < options_.least_effective * static_cast<double>(machines_.size()) ||
      machines_.size() > options_.kept) {
    resample();
    move();
  }
  show();
}

/// [1] Of the largest one.
std::vector<double> ChartLearning::weights() const {
  double most = -INFINITE;
  for (const Machine& machine : machines_) most = std::max(most, machine.log_weight);
  std::vector<double> weights;
  for (const Machine& machine : machines_) weights.push_back(std::exp(machine.log_weight - most));
  return weights;
}

std::vector<std::size_t> ChartLearning::drawIndices(std::size_t count, std::mt19937_64& random) const {
  std::vector<double> sums = weights();
  std::partial_sum(sums.begin(), sums.end(), sums.begin());
  // Systematic: one random number for all.
  const double first = std::uniform_real_distribution<double>()(random);
  std::vector<std::size_t> indices;
  for (std::size_t k = 0; k < count; ++k) {
    const double at = sums.back() * (static_cast<double>(k) + first) / static_cast<double>(count);
    indices.push_back(
        std::min(static_cast<std::size_t>(std::upper_bound(sums.begin(), sums.end(), at) - sums.begin()),
                 sums.size() - 1));
  }
  return indices;
}

/// Afterwards all machines have the same weight.
void ChartLearning::resample() {
  std::vector<Machine> kept;
  for (const std::size_t k : drawIndices(options_.kept, random_)) {
    kept.push_back(machines_[k]);
    kept.back().log_weight = 0.0;
  }
  machines_ = std::move(kept);
}

void ChartLearning::move() {
  std::uniform_real_distribution<double> unit;
  std::normal_distribution<double> normal;
  const std::size_t count = machines_.size(), size = prior_.coordinates();
  std::uniform_int_distribution<std::size_t> any(0, count - 1);
  constexpr double SOME = 0.3;  // [1] of the coordinates
  for (int step = 0; step < options_.moves; ++step)
    for (Machine& machine : machines_) {
      std::vector<double> at = machine.at;
      double log_prior = 0.0;  // ratio, where a step does not preserve the prior
      if (unit(random_) < 0.5) {
        const double beta = std::pow(unit(random_), 2);
        for (double& value : at)
          if (unit(random_) < SOME) value = std::sqrt(1.0 - beta * beta) * value + beta * normal(random_);
      } else {
        const std::vector<double>&a = machines_[any(random_)].at, &b = machines_[any(random_)].at;
        const double length = 1.7 / std::sqrt(static_cast<double>(size)) * (0.2 + unit(random_));
        for (std::size_t k = 0; k < size; ++k) {
          at[k] += length * (a[k] - b[k]) + 0.01 * normal(random_);
          log_prior += 0.5 * (machine.at[k] * machine.at[k] - at[k] * at[k]);
        }
      }
      const double bound = machine.log_likelihood + std::log(unit(random_)) - log_prior;
      const double proposed = logLikelihood(at);
      if (proposed < bound) continue;
      machine.at = std::move(at);
      machine.log_likelihood = proposed;
    }
}

/// Machines that answer questions, and their probabilities over the grid.
void ChartLearning::show() {
  std::mt19937_64 random(options_.seed);
  shown_.clear();
  for (const std::size_t k : drawIndices(options_.shown, random))
    shown_.push_back(prior_.machine(machines_[k].at));
  std::shuffle(shown_.begin(), shown_.end(), random);  // an early verdict must not depend on the order
  probability_ = chart(speeds_, depths_).probability;
  for (auto& column : probability_)
    for (double& value : column) value = 1.0 - value;
}

ProbabilityChart ChartLearning::chart(const std::vector<double>& speeds,
                                      const std::vector<double>& depths) const {
  if (speeds.empty() || depths.empty())
    throw Error("probability chart: expected at least one speed and one depth");
  ProbabilityChart chart;
  chart.speeds = speeds;
  chart.depths = depths;
  chart.probability.assign(speeds.size(), std::vector<double>(depths.size(), 0.0));
  std::vector<std::vector<double>> limits;  // [machine][speed]
  for (const RegenerativeSystem& machine : shown_) limits.push_back(zeroOrderOf(machine, speeds).depth);
  const double part = 1.0 / static_cast<double>(shown_.size());
  std::vector<double> here(shown_.size());
  for (std::size_t s = 0; s < speeds.size(); ++s) {
    for (std::size_t m = 0; m < shown_.size(); ++m) {
      here[m] = limits[m][s];
      if (std::isinf(here[m])) continue;
      for (std::size_t d = 0; d < depths.size(); ++d)
        chart.probability[s][d] += part * normalCdf(std::log(depths[d] / here[m]) / options_.scatter);
    }
    std::nth_element(here.begin(), here.begin() + static_cast<std::ptrdiff_t>(here.size() / 2), here.end());
    chart.nominal.push_back(here[here.size() / 2]);
  }
  return chart;
}

double ChartLearning::knownStable(double speed, double depth) const {
  for (const JudgedCut& cut : cuts_) {
    if (std::abs(cut.speed / speed - 1.0) > SAME_SPEED) continue;
    if (!cut.chatter && depth <= cut.depth * (1.0 + 1e-9)) return 1.0 - options_.wrong;
    if (cut.chatter && depth >= cut.depth * (1.0 - 1e-9)) return options_.wrong;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

CutProposal ChartLearning::judge(double speed, double depth) const {
  return *judge(speed, depth, 1.0);
}

/// Empty as soon as the probability of chatter exceeds the risk [1].
std::optional<CutProposal> ChartLearning::judge(double speed, double depth, double risk) const {
  require("speed of a cut [rad/s]", speed, Range::positive());
  require("depth of a cut [m]", depth, Range::positive());
  CutProposal cut{speed, depth};
  std::mt19937_64 random(options_.seed);
  std::normal_distribution<double> normal;
  const std::size_t judges = std::min(options_.judged, shown_.size());
  std::size_t chatters = 0;
  for (std::size_t k = 0; k < judges; ++k) {
    const double scattered = depth * std::exp(options_.scatter * normal(random));
    chatters += solverOf(shown_[k])->multiplier(speed, scattered).radius() > 1.0;
    if (static_cast<double>(chatters) > risk * static_cast<double>(judges)) return std::nullopt;
  }
  cut.stable = 1.0 - static_cast<double>(chatters) / static_cast<double>(judges);
  cut.std_dev = deviationOf(cut.stable, judges);
  const double known = knownStable(speed, depth);
  if (!std::isnan(known)) {
    cut.stable = known;
    cut.std_dev = 0.0;
  }
  return cut;
}

CutProposal ChartLearning::next() const {
  const std::optional<CutProposal> best = chosen(false);
  const double least = best ? best->removal() : 0.0;
  CutProposal next;
  double most = -INFINITE;
  for (std::size_t s = 0; s < speeds_.size(); ++s)
    for (std::size_t d = 0; d < depths_.size(); ++d) {
      const CutProposal cut{speeds_[s], depths_[d], probability_[s][d], 0.0};
      if (cut.depth > most_[s] || !std::isnan(knownStable(cut.speed, cut.depth))) continue;
      const double gain = cut.stable * (cut.removal() - least) / (options_.risk_offset + 1.0 - cut.stable);
      if (gain <= most) continue;
      most = gain;
      next = cut;
    }
  next.std_dev = deviationOf(next.stable, shown_.size());
  return next;
}

std::optional<CutProposal> ChartLearning::recommended() const {
  return chosen(true);
}

/// @param exact judged by collocation too
std::optional<CutProposal> ChartLearning::chosen(bool exact) const {
  std::optional<CutProposal> best;
  for (const JudgedCut& cut : cuts_)
    if (!cut.chatter && (!best || cut.speed * cut.depth > best->removal()) && cut.depth <= range_.max_depth)
      best = CutProposal{cut.speed, cut.depth, 1.0 - options_.wrong, 0.0};
  const double loose = 1.0 - (exact ? LOOSE : 1.0) * options_.risk;
  std::vector<CutProposal> candidates;
  for (std::size_t s = 0; s < speeds_.size(); ++s)
    for (std::size_t d = 0; d < depths_.size(); ++d) {
      const CutProposal cut{speeds_[s], depths_[d], probability_[s][d],
                            deviationOf(probability_[s][d], shown_.size())};
      if (cut.depth <= most_[s] && cut.stable >= loose && (!best || cut.removal() > best->removal()))
        candidates.push_back(cut);
    }
  std::sort(candidates.begin(), candidates.end(),
            [](const CutProposal& a, const CutProposal& b) { return a.removal() > b.removal(); });
  int examined = 0;
  for (const CutProposal& candidate : candidates) {
    const double known = knownStable(candidate.speed, candidate.depth);
    if (known <= options_.wrong) continue;
    if (!exact) return candidate;
    // Beyond the examined ones only those that are safe by the zero-order solution, which costs nothing.
    if (candidate.stable < 1.0 - options_.risk && examined >= EXAMINED) continue;
    ++examined;
    if (const auto cut = judge(candidate.speed, candidate.depth, options_.risk)) return cut;
    if (examined > 3 * EXAMINED) break;
  }
  return best;
}

MachineEstimate ChartLearning::estimate() const {
  std::array<LogMean, 2> frequency, stiffness, damping;
  LogMean kt, limit;
  const auto count = static_cast<double>(shown_.size());
  for (const RegenerativeSystem& machine : shown_) {
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const SystemMode* flexible = nullptr;
      double most = 0.0;
      for (const SystemMode& mode : machine.modes) {
        const double compliance =
            mode.input[axis] * mode.output[axis] / std::pow(units::TWO_PI * mode.frequency, 2);
        if (compliance / mode.damping_ratio <= most) continue;
        most = compliance / mode.damping_ratio;
        flexible = &mode;
      }
      if (flexible == nullptr) continue;
      frequency[axis].add(1.0 / count, flexible->frequency);
      damping[axis].add(1.0 / count, flexible->damping_ratio);
      stiffness[axis].add(1.0 / count, 1.0 / (most * flexible->damping_ratio));
    }
    kt.add(1.0 / count, machine.kt);
    const std::vector<double> limits = zeroOrderOf(machine, speeds_).depth;
    limit.add(1.0 / count, std::min(1e3, *std::min_element(limits.begin(), limits.end())));
  }
  MachineEstimate result;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    result.frequency[axis] = frequency[axis].estimate();
    result.stiffness[axis] = stiffness[axis].estimate();
    result.damping[axis] = damping[axis].estimate();
  }
  result.kt = kt.estimate();
  result.limit = limit.estimate();
  return result;
}

}  // namespace smartmill::stability
