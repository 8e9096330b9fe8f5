#include "smartmill_loadmeter/identification/production.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "inspection/weighted_fit.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/identification/torque_sensitivity.h"

namespace smartmill::loadmeter {

namespace {

using Information = std::array<double, 3>;  // xx, xy, yy of (Ktc, Kte)

double determinant(const Information& i) {
  return i[0] * i[2] - i[1] * i[1];
}

void add(Information& i, const TorqueSensitivity& s, double variance) {
  i[0] += s.tc * s.tc / variance;
  i[1] += s.tc * s.te / variance;
  i[2] += s.te * s.te / variance;
}

}  // namespace

RecursiveCoefficients::RecursiveCoefficients(const Start& start, double memory)
    : value_{start.ktc, start.kte}, memory_(memory) {
  if (!(memory > 0.0) || !(start.ktc_std > 0.0) || !(start.kte_std > 0.0)) {
    throw Error("recursive coefficients: expected memory and initial standard deviations > 0");
  }
  start_ = {1.0 / (start.ktc_std * start.ktc_std), 0.0, 1.0 / (start.kte_std * start.kte_std)};
  information_ = start_;
}

void RecursiveCoefficients::update(const TorqueMeasurement& reading) {
  if (!(reading.torque_std > 0.0) || !std::isfinite(reading.torque)) {
    throw Error("recursive coefficients: expected a finite torque with a standard deviation > 0");
  }
  // Forgotten information is replaced by the initial one about the present value.
  const double keep = std::exp(-reading.cutting_time / memory_);
  for (std::size_t i = 0; i < 3; ++i) information_[i] = keep * information_[i] + (1.0 - keep) * start_[i];
  for (double& p : pull_) p *= keep;
  const TorqueSensitivity s = torqueSensitivity(reading.tool, reading.engagement);
  const double variance = reading.torque_std * reading.torque_std;
  const double d0 = determinant(information_);
  const double expected =
      (s.tc * s.tc * information_[2] - 2.0 * s.tc * s.te * information_[1] + s.te * s.te * information_[0]) /
      d0;
  const double error = reading.torque - s.tc * value_[0] - s.te * value_[1];
  innovation_ = error / std::sqrt(variance + expected + reading.common_std * reading.common_std);
  squares_ = keep * squares_ + innovation_ * innovation_;
  weight_ = keep * weight_ + 1.0;
  add(information_, s, variance);
  pull_[0] += s.tc * reading.common_std / variance;
  pull_[1] += s.te * reading.common_std / variance;
  const double d = determinant(information_);
  value_[0] += (information_[2] * s.tc - information_[1] * s.te) / d * error / variance;
  value_[1] += (information_[0] * s.te - information_[1] * s.tc) / d * error / variance;
  ++readings_;
}

/// Shift of the estimate by one standard deviation of the common error.
std::array<double, 2> RecursiveCoefficients::common() const {
  const double d = determinant(information_);
  return {(information_[2] * pull_[0] - information_[1] * pull_[1]) / d,
          (information_[0] * pull_[1] - information_[1] * pull_[0]) / d};
}

double RecursiveCoefficients::misfit() const {
  return widening(squares_, weight_ - static_cast<double>(value_.size()));
}

/// Standard deviations without the common error.
std::array<double, 2> RecursiveCoefficients::independent() const {
  const double d = determinant(information_), factor = misfit();
  return {std::min(factor * std::sqrt(information_[2] / d), 1.0 / std::sqrt(start_[0])),
          std::min(factor * std::sqrt(information_[0] / d), 1.0 / std::sqrt(start_[2]))};
}

double RecursiveCoefficients::ktcStd() const {
  return std::hypot(independent()[0], common()[0]);
}
double RecursiveCoefficients::kteStd() const {
  return std::hypot(independent()[1], common()[1]);
}
double RecursiveCoefficients::covariance() const {
  const double correlation = -information_[1] / std::sqrt(information_[0] * information_[2]);
  const std::array<double, 2> own = independent(), shared = common();
  return correlation * own[0] * own[1] + shared[0] * shared[1];
}

namespace {

struct Candidate {
  PlannedCut cut;
  TorqueSensitivity s;
  double variance = 0.0;  // [N2 m2] of its torque
};

// Candidates within the limits.
std::vector<Candidate> allowedCuts(const ToolGeometry& tool, const Spindle& spindle,
                                   const CuttingCoefficients& expected, const CandidateCuts& candidates,
                                   const CutLimits& limits, double voltage_std) {
  std::vector<Candidate> allowed;
  for (const double speed : candidates.speeds) {
    for (const double feed : candidates.feeds) {
      for (const double depth : candidates.axial_depths) {
        Candidate c;
        c.cut.speed = speed;
        c.cut.engagement = {candidates.entry, candidates.exit, depth, feed};
        c.s = torqueSensitivity(tool, c.cut.engagement);
        c.cut.torque = c.s.tc * expected.ktc + c.s.te * expected.kte;
        c.cut.power = c.cut.torque * speed;
        if (c.cut.torque > limits.torque || c.cut.power > limits.power) continue;
        if (limits.stable_depth && depth > limits.stable_depth(speed, c.cut.engagement)) continue;
        // Eq. 3.12: the torque per volt falls with the speed. Friction is measured in air at the same speed,
        // which doubles the variance.
        const double std_dev = voltage_std / (spindle.load_meter_gain * speed);
        c.variance = 2.0 * std_dev * std_dev;
        allowed.push_back(c);
      }
    }
  }
  return allowed;
}

// Selects cuts one by one, with exchanges as long as they help.
class Planner {
 public:
  Planner(const std::vector<Candidate>& allowed, double target_ktc_std, double target_kte_std)
      : allowed_(allowed), target_ktc_(target_ktc_std), target_kte_(target_kte_std) {}

  // @return whether max_cuts reach the targets.
  bool choose(std::size_t max_cuts) {
    double cost = INFINITY;
    while (chosen_.size() < max_cuts) {
      chosen_.push_back(bestAddition());
      cost = exchange();
      if (chosen_.size() >= 3 && cost <= 1.0) break;
    }
    std::sort(chosen_.begin(), chosen_.end());
    return cost <= 1.0;
  }

  const std::vector<std::size_t>& chosen() const { return chosen_; }
  // Ktc, Kte.
  std::array<double, 2> stds() const { return stdsOf(informationOf(chosen_)); }

 private:
  using List = std::vector<std::size_t>;

  Information informationOf(const List& list) const {
    Information i{0.0, 0.0, 0.0};
    for (const std::size_t k : list) add(i, allowed_[k].s, allowed_[k].variance);
    return i;
  }

  static std::array<double, 2> stdsOf(const Information& i) {
    const double d = determinant(i);
    if (!(d > 1e-12 * i[0] * i[2])) return {INFINITY, INFINITY};
    return {std::sqrt(i[2] / d), std::sqrt(i[0] / d)};
  }

  // Larger of the two standard deviations over their targets; fewer than three feeds are penalised.
  double cost(const List& list) const {
    std::set<double> own;
    for (const std::size_t k : list) own.insert(allowed_[k].cut.engagement.feed_per_tooth);
    const Information i = informationOf(list);
    const std::array<double, 2> s = stdsOf(i);
    const double missing = own.size() < std::min<std::size_t>(3, list.size()) ? 1e6 : 1.0;
    // Breaks ties before both are finite.
    if (!std::isfinite(s[0])) return 1e12 * missing / (1e-300 + i[0] * target_ktc_ * target_ktc_);
    return missing * std::max(s[0] / target_ktc_, s[1] / target_kte_);
  }

  std::size_t bestAddition() const {
    std::size_t pick = 0;
    double best = INFINITY;
    for (std::size_t k = 0; k < allowed_.size(); ++k) {
      List other = chosen_;
      other.push_back(k);
      const double c = cost(other);
      if (c < best) best = c, pick = k;
    }
    return pick;
  }

  // @return the final cost.
  double exchange() {
    double best = cost(chosen_);
    for (bool better = true; better;) {
      better = false;
      for (std::size_t at = 0; at < chosen_.size(); ++at) {
        for (std::size_t k = 0; k < allowed_.size(); ++k) {
          List other = chosen_;
          other[at] = k;
          const double c = cost(other);
          if (c >= best * (1.0 - 1e-12)) continue;
          best = c;
          chosen_ = other;
          better = true;
        }
      }
    }
    return best;
  }

  const std::vector<Candidate>& allowed_;
  double target_ktc_, target_kte_;
  List chosen_;
};

}  // namespace

TestPlan planTests(const ToolGeometry& tool, const Spindle& spindle, const CuttingCoefficients& expected,
                   const CandidateCuts& candidates, const CutLimits& limits, double voltage_std,
                   double target_ktc_std, double target_kte_std, std::size_t max_cuts) {
  const std::vector<Candidate> allowed =
      allowedCuts(tool, spindle, expected, candidates, limits, voltage_std);
  std::set<double> feeds;
  for (const Candidate& c : allowed) feeds.insert(c.cut.engagement.feed_per_tooth);
  if (feeds.size() < 3) {
    throw Error("test plan: " + std::to_string(feeds.size()) +
                " feeds within the limits of torque, power and stability, expected three or more");
  }
  Planner planner(allowed, target_ktc_std, target_kte_std);
  const bool cost = planner.choose(max_cuts);
  const std::array<double, 2> s = planner.stds();
  if (!cost) {
    throw Error(
        formatted("test plan: %zu cuts within the limits reach Ktc +- %.3g N/mm2 and Kte +- %.3g N/mm only",
                  max_cuts, s[0] / units::N_PER_MM2, s[1] / units::N_PER_MM));
  }
  TestPlan plan;
  for (const std::size_t k : planner.chosen()) plan.cuts.push_back(allowed[k].cut);
  plan.ktc_std = s[0];
  plan.kte_std = s[1];
  return plan;
}

}  // namespace smartmill::loadmeter
