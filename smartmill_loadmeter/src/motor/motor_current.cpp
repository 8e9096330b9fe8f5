#include "smartmill_loadmeter/motor/motor_current.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <Eigen/Dense>
#include <boost/math/filters/daubechies.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/fit.h"

namespace smartmill::loadmeter {

namespace {

constexpr int COARSEST = 10;
constexpr double MARGIN = 6.0;  // a band must end this many times above the sine it is to keep

/// Approximation at half the sample rate: one step of the periodic wavelet transform (Daubechies, five
/// vanishing moments) without its detail. @param fine a power of two of samples
std::vector<double> coarser(const std::vector<double>& fine) {
  static const auto scaling = boost::math::filters::daubechies_scaling_filter<double, 5>();
  std::vector<double> coarse(fine.size() / 2, 0.0);
  for (std::size_t i = 0; i < coarse.size(); ++i) {
    for (std::size_t k = 0; k < scaling.size(); ++k)
      coarse[i] += scaling[k] * fine[(2 * i + k) & (fine.size() - 1)];
  }
  return coarse;
}

/// The inverse of coarser(), with no detail added.
std::vector<double> finer(const std::vector<double>& coarse) {
  static const auto scaling = boost::math::filters::daubechies_scaling_filter<double, 5>();
  std::vector<double> fine(2 * coarse.size(), 0.0);
  for (std::size_t i = 0; i < coarse.size(); ++i) {
    for (std::size_t k = 0; k < scaling.size(); ++k)
      fine[(2 * i + k) & (fine.size() - 1)] += scaling[k] * coarse[i];
  }
  return fine;
}

}  // namespace

std::vector<double> denoise(const std::vector<double>& signal, int level) {
  const std::size_t n = signal.size();
  if (level < 0 || level > 30 || n < (std::size_t{1} << level) || n < 2) {
    throw Error("wavelet de-noising: " + std::to_string(n) + " samples are too few for level " +
                std::to_string(level));
  }
  if (level == 0) return signal;
  // Mirrored on both sides, so that the periodic transform sees no jump.
  std::size_t size = 1;
  while (size < 2 * n) size *= 2;
  std::vector<double> data(size);
  const std::size_t before = (size - n) / 2, period = 2 * n;
  for (std::size_t i = 0; i < size; ++i) {
    const std::size_t at = (i + period * (size / period + 1) - before) % period;
    data[i] = signal[at < n ? at : period - 1 - at];
  }
  for (int step = 0; step < level; ++step) data = coarser(data);
  for (int step = 0; step < level; ++step) data = finer(data);
  return {data.begin() + static_cast<std::ptrdiff_t>(before),
          data.begin() + static_cast<std::ptrdiff_t>(before + n)};
}

int levelFor(double frequency, double sample_rate) {
  const int level = static_cast<int>(std::floor(std::log2(sample_rate / (2.0 * MARGIN * frequency))));
  return std::clamp(level, 0, COARSEST);
}

double phaseRange(const std::vector<double>& current, double sample_rate, double frequency, double slip) {
  return fitPhase(current, sample_rate, frequency, slip).range.value;
}

PhaseFit fitPhase(const std::vector<double>& current, double sample_rate, double frequency, double slip) {
  const double periods = static_cast<double>(current.size()) * frequency / sample_rate;
  if (!(periods >= 2.0)) throw Error("phase current: less than two periods in the record");
  const std::vector<double> smooth = denoise(current, levelFor(frequency, sample_rate));
  // Amplitude by least squares of level, cosine and sine; the slip leaves the frequency free a little.
  double best = -1.0, amplitude = 0.0, found_at = 0.0;
  const auto tryAt = [&](double offset) {  // [1] of 1 / record
    const double w = units::TWO_PI * frequency * (1.0 + offset / periods) / sample_rate;
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    double c = 1.0, q = 0.0;  // cosine and sine by turning
    const double cw = std::cos(w), sw = std::sin(w);
    for (const double value : smooth) {
      const Eigen::Vector3d row(1.0, c, q);
      normal += row * row.transpose();
      right += row * value;
      const double turned = c * cw - q * sw;
      q = q * cw + c * sw;
      c = turned;
    }
    const Eigen::Vector3d found = normal.ldlt().solve(right);
    const double explained = found.dot(right);
    if (explained <= best) return;
    best = explained;
    amplitude = std::hypot(found[1], found[2]);
    found_at = offset;
  };
  const int steps = 4 + static_cast<int>(std::ceil(4.0 * slip * periods));
  for (int step = -4; step <= steps; ++step) tryAt(0.25 * step);
  const double middle = found_at;
  for (int step = -4; step <= 4; ++step) tryAt(middle + 0.05 * step);
  // The sum of squares that level and sine leave, over independent samples.
  double squares = 0.0;
  for (const double value : current) squares += value * value;
  const double n = static_cast<double>(current.size()), left = std::max(0.0, squares - best) / n;
  return {{2.0 * amplitude, 2.0 * std::sqrt(2.0 * left / n)}, frequency * (1.0 + found_at / periods)};
}

double Line::stdAt(double x) const {
  return std::sqrt(scatter * scatter + slope.std_dev * slope.std_dev * x * x + 2.0 * covariance * x +
                   level.std_dev * level.std_dev);
}

Line fitLine(const std::vector<double>& x, const std::vector<double>& y) {
  const std::size_t n = x.size();
  if (n < 3 || y.size() != n) throw Error("calibration line: " + std::to_string(n) + " cuts, three are due");
  const double count = static_cast<double>(n), mx = mean(x), my = mean(y);
  double sxx = 0.0, sxy = 0.0, syy = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    sxx += (x[i] - mx) * (x[i] - mx);
    sxy += (x[i] - mx) * (y[i] - my);
    syy += (y[i] - my) * (y[i] - my);
  }
  if (!(sxx > 0.0)) throw Error("calibration line: all cuts at one current");
  Line line;
  line.count = static_cast<int>(n);
  line.slope.value = sxy / sxx;
  line.level.value = my - line.slope.value * mx;
  const double left = std::max(0.0, syy - line.slope.value * sxy);
  const double variance = left / (count - 2.0);
  line.scatter = std::sqrt(variance);
  line.slope.std_dev = std::sqrt(variance / sxx);
  line.level.std_dev = std::sqrt(variance * (1.0 / count + mx * mx / sxx));
  line.covariance = -variance * mx / sxx;
  line.r_squared = syy > 0.0 ? 1.0 - left / syy : 1.0;
  return line;
}

double TorquePowerLaw::evaluate(const Side& side, double speed_rpm, double rise) {
  if (!(rise > 0.0)) return 0.0;
  const double n = (speed_rpm - side.middle) / side.span;
  const auto polynomial = [n](const std::vector<double>& c) {
    double sum = 0.0;
    for (std::size_t i = c.size(); i-- > 0;) sum = sum * n + c[i];
    return sum;
  };
  return polynomial(side.a) * std::pow(rise, polynomial(side.b));
}

TorquePowerLaw::TorquePowerLaw(const std::vector<SpindleCut>& cuts, double base_speed_rpm)
    : base_(base_speed_rpm) {
  double left = 0.0, unknowns = 0.0;
  for (const bool above : {false, true}) {
    std::vector<SpindleCut> own;
    std::set<double> speeds;
    for (const SpindleCut& cut : cuts) {
      if ((cut.speed_rpm > base_) != above) continue;
      if (!(cut.rise > 0.0) || !(cut.torque > 0.0)) continue;  // nothing is cut
      own.push_back(cut);
      speeds.insert(cut.speed_rpm);
    }
    if (own.empty()) continue;
    if (own.size() < 3) {
      throw Error("spindle calibration: " + std::to_string(own.size()) + " cuts " +
                  (above ? "above" : "below") + " base speed, three are due");
    }
    Side side;
    side.middle = 0.5 * (*speeds.begin() + *speeds.rbegin());
    side.span = std::max(1.0, 0.5 * (*speeds.rbegin() - *speeds.begin()));
    const std::size_t degree = std::min({std::size_t{3}, speeds.size() - 1, own.size() / 2 - 1});
    // A straight line of the logarithms starts the fit.
    std::vector<double> x, y;
    for (const SpindleCut& cut : own) {
      x.push_back(std::log(cut.rise));
      y.push_back(std::log(cut.torque));
    }
    const Line line = fitLine(x, y);
    std::vector<FitParameter> start;
    const double a0 = std::exp(line.level.value);
    for (std::size_t i = 0; i <= degree; ++i) start.push_back({i ? 0.0 : a0, -20.0 * a0, 20.0 * a0, a0});
    for (std::size_t i = 0; i <= degree; ++i) start.push_back({i ? 0.0 : line.slope.value, -5.0, 5.0, 0.5});
    const auto sideOf = [&](const std::vector<double>& v) {
      Side s = side;
      const auto middle = v.begin() + static_cast<std::ptrdiff_t>(degree + 1);
      s.a.assign(v.begin(), middle);
      s.b.assign(middle, v.end());
      return s;
    };
    const auto residuals = [&](const std::vector<double>& v, double* out) {
      const Side s = sideOf(v);
      for (const SpindleCut& cut : own) *out++ = evaluate(s, cut.speed_rpm, cut.rise) - cut.torque;
    };
    const FitResult found = fit(residuals, own.size(), start, 1e-10);
    sides_[above ? 1 : 0] = sideOf(found.value);
    left += found.squares;
    unknowns += static_cast<double>(start.size());
  }
  if (!sides_[0] && !sides_[1]) throw Error("spindle calibration: no cut with a rise of current");
  double total = 0.0, middle = 0.0;
  for (const SpindleCut& cut : cuts) middle += cut.torque / static_cast<double>(cuts.size());
  for (const SpindleCut& cut : cuts) total += (cut.torque - middle) * (cut.torque - middle);
  scatter_ = std::sqrt(left / std::max(1.0, static_cast<double>(cuts.size()) - unknowns));
  r_squared_ = total > 0.0 ? 1.0 - left / total : 1.0;
}

double TorquePowerLaw::torque(double speed_rpm, double rise) const {
  const bool above = speed_rpm > base_;
  if (!side(above)) {
    throw Error("spindle calibration: no cut " + std::string(above ? "above" : "below") +
                " base speed: torque at " + std::to_string(speed_rpm) + " rpm is not known");
  }
  const Side& law = *side(above);
  // Polynomials say nothing beyond the speeds that they were made from.
  double low = law.middle - law.span, high = law.middle + law.span;
  (above ? low : high) = above ? std::min(low, base_) : std::max(high, base_);
  const double beyond = 0.1 * law.middle;
  if (speed_rpm < low - beyond || speed_rpm > high + beyond) {
    throw Error("spindle calibration: cuts from " + std::to_string(std::lround(low)) + " to " +
                std::to_string(std::lround(high)) + " rpm: torque at " +
                std::to_string(std::lround(speed_rpm)) + " rpm is not known");
  }
  return evaluate(law, speed_rpm, rise);
}

}  // namespace smartmill::loadmeter
