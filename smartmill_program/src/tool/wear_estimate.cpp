#include "smartmill_program/tool/wear_estimate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/signal/steady_path.h"

namespace smartmill::program {
namespace {

using Complex = std::complex<double>;

constexpr std::size_t LEAST_REVOLUTIONS = 3;
constexpr Complex IMAGINARY{0.0, 1.0};
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

std::array<double, 6> listOf(const CuttingCoefficients& k) {
  return {{k.ktc, k.krc, k.kac, k.kte, k.kre, k.kae}};
}

/// Direction of the feed in the machine; +x where it is not stated.
Complex feedOf(const CuttingCondition& condition) {
  return std::polar(1.0, headingOf(condition));
}

}  // namespace

WearEstimate::WearEstimate(const WearParameters& parameters) : parameters_(parameters) {
  parameters_.validate();
}

void WearEstimate::begin(const CuttingCondition& condition, const std::optional<SharpCoefficients>& sharp) {
  condition_.reset();
  count_ = 0;
  sum_ = squares_ = 0.0;
  force_sum_ = 0.0;
  if (condition.kind != CuttingCondition::Kind::cut || feedTurns(condition) || !sharp) return;
  tool_ = condition.tool_name;

  const auto matrix = meanForceMatrix(condition.tool, condition.engagement);
  const std::array<double, 6> value = listOf(sharp->value), std_dev = listOf(sharp->std_dev);
  std::array<Complex, 6> column, part;
  for (std::size_t k : {0, 1, 3, 4}) {
    column[k] = Complex(matrix[0][k], matrix[1][k]);
    part[k] = column[k] * value[k];
  }
  const bool total = std::isfinite(value[1] + value[4]);
  if (!(total ? expectTotal(part) : expectTangential(part, column[0], column[3]))) return;
  const auto project = [&](const Complex& force) { return (force * std::conj(direction_)).real(); };
  chip_ = project(part[0] + (total ? part[1] : 0.0));
  edge_ = project(part[3] + (total ? part[4] : 0.0));
  double variance = 0.0;
  for (std::size_t k : {0, 1, 3, 4}) {
    const double own = std::isfinite(std_dev[k]) ? std_dev[k] / value[k] : parameters_.coefficient_error;
    const double error = project(part[k]) * own;
    if (std::isfinite(error)) variance += error * error;
  }
  expected_std_ = std::sqrt(variance) / (chip_ + edge_);
  direction_ *= feedOf(condition);
  condition_ = condition;
}

/// Compares with the force by all coefficients. @return whether there is one
bool WearEstimate::expectTotal(const std::array<Complex, 6>& part) {
  const Complex expected = part[0] + part[1] + part[3] + part[4];
  if (!(std::abs(expected) > 0.0)) return false;  // NaN: not all coefficients are known
  direction_ = expected / std::abs(expected);
  radial_angle_std_ = NONE;
  return true;
}

/// Compares with the force by the tangential coefficients, across the radial force. @param chip, edge the
/// tangential force per coefficient; those of the radial force are i times as large @return whether there is
/// one
bool WearEstimate::expectTangential(const std::array<Complex, 6>& part, Complex chip, Complex edge) {
  const Complex expected = part[0] + part[3];
  if (!(std::abs(expected) > 0.0 && std::abs(chip) > 0.0 && std::abs(edge) > 0.0)) return false;
  tangential_ = expected / std::abs(expected);
  const Complex middle = chip / std::abs(chip) + edge / std::abs(edge);
  direction_ = middle / std::abs(middle);
  radial_ = IMAGINARY * direction_;
  radial_angle_std_ = std::abs(std::arg(edge / chip)) / std::sqrt(12.0);  // uniform between chip and edge
  return true;
}

void WearEstimate::add(double time, std::complex<double> force) {
  if (!condition_) return;
  const double ratio = (force * std::conj(direction_)).real() / (chip_ + edge_);
  ++count_;
  sum_ += ratio;
  squares_ += ratio * ratio;
  force_sum_ += force;
  last_ = time;
}

/// Least squares with relative errors: value and standard deviation.
std::pair<double, double> WearEstimate::edgeWear(const std::deque<Cut>& cuts) const {
  double cc = 0.0, ce = 0.0, ee = 0.0, cf = 0.0, ef = 0.0;
  for (const Cut& cut : cuts) {
    const double weight = std::pow(parameters_.cut_error * cut.force, -2);
    cc += weight * cut.chip * cut.chip;
    ce += weight * cut.chip * cut.edge;
    ee += weight * cut.edge * cut.edge;
    cf += weight * cut.chip * cut.force;
    ef += weight * cut.edge * cut.force;
  }
  const double determinant = cc * ee - ce * ce;
  if (!(determinant > 1e-9 * cc * ee)) return {NONE, NONE};
  const double std_dev = std::sqrt(cc / determinant);
  if (!(std_dev <= parameters_.edge_error)) return {NONE, NONE};
  return {(cc * ef - ce * cf) / determinant - 1.0, std_dev};
}

std::optional<CutWear> WearEstimate::present() const {
  if (!condition_ || count_ < LEAST_REVOLUTIONS) return {};
  const auto count = static_cast<double>(count_);
  CutWear wear;
  wear.stamp = last_;
  wear.condition = *condition_;
  wear.revolutions = count_;
  const double mean = sum_ / count;
  const double scatter = std::sqrt(std::max(0.0, squares_ / count - mean * mean) / (count - 1.0));
  wear.wear = mean - 1.0;
  wear.wear_std = mean * std::hypot(scatter / mean, std::hypot(parameters_.force_error, expected_std_));
  if (std::isfinite(radial_angle_std_)) {
    // Force = tangential part + radial part; the error of the radial part across its direction.
    const double expected = chip_ + edge_;
    const Complex across = -IMAGINARY * radial_;
    const Complex tangential = mean * expected / (tangential_ * std::conj(across)).real() * tangential_;
    const Complex force = force_sum_ / count * std::conj(feedOf(*condition_));
    const double radial = ((force - tangential) * std::conj(radial_)).real();
    const double error = radial * std::hypot(radial_angle_std_, parameters_.force_error);
    wear.wear_std = std::hypot(wear.wear_std, error / expected);
  }
  const auto earlier = cuts_.find(tool_);
  std::deque<Cut> cuts = earlier == cuts_.end() ? std::deque<Cut>() : earlier->second;
  if (mean > 0.0) cuts.push_back({mean * (chip_ + edge_), chip_, edge_});
  std::tie(wear.edge_wear, wear.edge_wear_std) = edgeWear(cuts);
  return wear;
}

void WearEstimate::forget() {
  cuts_.erase(tool_);
  condition_.reset();
  count_ = 0;
}

std::optional<CutWear> WearEstimate::end() {
  const std::optional<CutWear> wear = present();
  if (wear && wear->wear > -1.0) {
    std::deque<Cut>& cuts = cuts_[tool_];
    cuts.push_back({(1.0 + wear->wear) * (chip_ + edge_), chip_, edge_});
    while (cuts.size() > static_cast<std::size_t>(parameters_.cuts)) cuts.pop_front();
  }
  condition_.reset();
  count_ = 0;
  return wear;
}

}  // namespace smartmill::program
