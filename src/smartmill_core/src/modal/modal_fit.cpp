#include "smartmill_core/modal/modal_fit.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numeric>

#include "modal_residuals.h"
#include "smartmill_core/error.h"
#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;

constexpr double MIN_DAMPING = 1e-4;
constexpr double MAX_DAMPING = 0.5;
constexpr double START_DAMPING = 0.02;
// A further mode must lower the BIC by more than this: strong evidence on the usual scale.
constexpr double BIC_STEP = 10.0;

struct Solution {
  int modes = 0;
  std::vector<double> parameters;                         // of ModalResiduals
  double cost = std::numeric_limits<double>::infinity();  // sum of squared weighted residuals
};

// Gains, direct and mass line that fit best for given frequencies and damping ratios.
void solveLinear(const ModalLines& problem, Solution& solution) {
  const int free = problem.parameters(solution.modes) - 2 * solution.modes;
  if (free == 0) return;
  const auto rows = static_cast<Eigen::Index>(2 * problem.lines());
  Eigen::MatrixXd a(rows, free);
  Eigen::VectorXd b(rows);
  for (std::size_t i = 0; i < problem.lines(); ++i) {
    const auto row = static_cast<Eigen::Index>(2 * i);
    const double w = problem.weight[i];
    const auto set = [&](int column, Complex value) {
      a(row, column) = w * value.real();
      a(row + 1, column) = w * value.imag();
    };
    int column = 0;
    for (int k = 0; k < solution.modes; ++k) {
      const Complex h = unitMode(problem.frequency[i], std::exp(solution.parameters[3 * k]),
                                 std::exp(solution.parameters[3 * k + 1]));
      set(column++, problem.scale * (problem.unit_static_gain ? h - 1.0 : h));
    }
    if (problem.direct) set(column++, problem.scale);
    if (problem.mass) set(column, problem.scale * problem.massTerm(i));
    const Complex due = problem.value[i] - (problem.unit_static_gain ? 1.0 : 0.0);
    b(row) = w * due.real();
    b(row + 1) = w * due.imag();
  }
  const Eigen::VectorXd x = linear::solveSymmetric(a.transpose() * a, Eigen::VectorXd(a.transpose() * b));
  if (!x.allFinite()) return;
  for (int k = 0; k < solution.modes; ++k) solution.parameters[3 * k + 2] = x(k);
  for (int k = solution.modes; k < free; ++k) solution.parameters[2 * solution.modes + k] = x(k);
}

Eigen::VectorXd asVector(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

void solve(const ModalLines& problem, Solution& solution) {
  solveLinear(problem, solution);
  std::vector<fit::Parameter> parameters(solution.parameters.size());
  for (std::size_t i = 0; i < parameters.size(); ++i) parameters[i].start = solution.parameters[i];
  for (std::size_t k = 0; k < 3 * static_cast<std::size_t>(solution.modes); k += 3) {
    parameters[k].low = std::log(0.7 * problem.reference());
    parameters[k].high = std::log(1.4 * problem.high);
    parameters[k + 1].low = std::log(MIN_DAMPING);
    parameters[k + 1].high = std::log(MAX_DAMPING);
    if (problem.positive) {
      parameters[k + 2].start = std::max(parameters[k + 2].start, 1e-3);
      parameters[k + 2].low = 0.0;
    }
  }
  fit::Options options;
  options.name = "modal fit";
  const fit::Result found = fit::minimise(ModalResiduals(problem, solution.modes), parameters, options);
  if (!found.usable()) return;
  solution.parameters.assign(found.value.data(), found.value.data() + found.value.size());
  solution.cost = found.squares;
}

FrequencyResponse residual(const ModalLines& problem, const Solution& solution) {
  FrequencyResponse left;
  left.frequency = problem.frequency;
  const ModalResiduals residuals(problem, solution.modes);
  Eigen::VectorXd r(residuals.count());
  residuals.evaluate(asVector(solution.parameters), &r, nullptr);
  for (Eigen::Index i = 0; i < r.size(); i += 2) left.value.emplace_back(r[i], r[i + 1]);
  return left;
}

// Smoothed over three lines, so that a single noisy line does not look like a mode.
FrequencyResponse smoothed(const FrequencyResponse& frf) {
  FrequencyResponse result = frf;
  for (std::size_t i = 1; i + 1 < frf.size(); ++i) {
    result.value[i] = (frf.value[i - 1] + frf.value[i] + frf.value[i + 1]) / 3.0;
  }
  return result;
}

Solution withOneMore(const ModalLines& problem, const Solution& from) {
  constexpr std::size_t TRIALS = 3;
  std::vector<double> peaks = findPeaks(smoothed(residual(problem, from)), problem.low, problem.high, 0.05);
  if (peaks.empty()) throw Error("modal fit: no peak in the band");
  if (peaks.size() > TRIALS) peaks.resize(TRIALS);
  Solution best;
  for (const double peak : peaks) {
    for (const double damping : {START_DAMPING, 0.2 * START_DAMPING}) {
      Solution trial;
      trial.modes = from.modes + 1;
      const auto modes_end = from.parameters.begin() + 3 * from.modes;
      trial.parameters.assign(from.parameters.begin(), modes_end);
      trial.parameters.insert(trial.parameters.end(), {std::log(peak), std::log(damping), 0.0});
      trial.parameters.insert(trial.parameters.end(), modes_end, from.parameters.end());
      solve(problem, trial);
      if (trial.cost < best.cost) best = trial;
    }
  }
  if (best.modes == 0)
    throw Error("modal fit: the solver did not converge with " + std::to_string(from.modes + 1) + " modes");
  return best;
}

double bic(const ModalLines& problem, const Solution& solution) {
  const double n = 2.0 * problem.lines();
  return n * std::log(solution.cost / n) + problem.parameters(solution.modes) * std::log(n);
}

// Standard deviations from the scatter of a few hits are noisy and lean towards the lines that happen to
// agree; noise is smooth in frequency, so that the root mean square over neighbouring lines is the better
// weight.
std::vector<double> smoothedDeviation(const std::vector<double>& deviation) {
  constexpr std::size_t SIDE = 5;
  std::vector<double> result(deviation.size());
  for (std::size_t i = 0; i < deviation.size(); ++i) {
    const std::size_t first = i > SIDE ? i - SIDE : 0, last = std::min(i + SIDE, deviation.size() - 1);
    double sum = 0.0;
    for (std::size_t j = first; j <= last; ++j) sum += deviation[j] * deviation[j];
    result[i] = std::sqrt(sum / static_cast<double>(last - first + 1));
  }
  return result;
}

ModalLines prepare(const FrequencyResponse& frf, const ModalFitOptions& options) {
  if (frf.value.size() != frf.size())
    throw Error("modal fit: the FRF has unequal numbers of lines and values");
  if (!(options.high > options.low)) throw Error("modal fit: the band is empty");
  const FrequencyResponse band = frf.band(options.low, options.high);
  ModalLines problem;
  problem.low = options.low;
  problem.high = options.high;
  problem.unit_static_gain = options.unit_static_gain;
  problem.direct = options.fit_direct && !options.unit_static_gain;
  problem.mass = options.fit_mass_line;
  problem.positive = options.positive_gains;
  double largest = 0.0;
  std::size_t known = 0;
  for (std::size_t i = 0; i < band.size(); ++i) {
    if (band.frequency[i] <= 0.0) continue;
    if (!std::isfinite(std::abs(band.value[i]))) {
      throw Error("modal fit: the FRF is not finite at " + std::to_string(band.frequency[i]) + " Hz");
    }
    problem.frequency.push_back(band.frequency[i]);
    problem.value.push_back(band.value[i]);
    const double deviation =
        i < band.std_dev.size() ? band.std_dev[i] : std::numeric_limits<double>::quiet_NaN();
    problem.weight.push_back(deviation);
    if (deviation > 0.0) ++known;
    largest = std::max(largest, std::abs(band.value[i]));
  }
  const int least = problem.parameters(std::max(1, options.modes)) + 1;
  if (static_cast<int>(2 * problem.lines()) < 2 * least) {
    throw Error("modal fit: " + std::to_string(problem.lines()) + " lines between " +
                std::to_string(options.low) + " and " + std::to_string(options.high) + " Hz are too few");
  }
  if (!(largest > 0.0)) throw Error("modal fit: the FRF is zero in the band");
  problem.scale = largest;
  problem.weighted = known == problem.lines();
  if (problem.weighted) problem.weight = smoothedDeviation(problem.weight);
  for (double& weight : problem.weight) {
    // std_dev is of the complex value; each part has it over sqrt(2). A vanishing one may not rule alone.
    weight = problem.weighted ? std::sqrt(2.0) / std::max(weight, 1e-9 * largest) : 1.0 / largest;
  }
  return problem;
}

// The physical model of a solution with its covariance.
ModalFit describe(const ModalLines& problem, const Solution& solution) {
  const int columns = problem.parameters(solution.modes);
  const ModalResiduals cost(problem, solution.modes);
  Eigen::VectorXd residuals(cost.count());
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(cost.count(), columns);
  cost.evaluate(asVector(solution.parameters), &residuals, &jacobian);
  const double chi2 = solution.cost / static_cast<double>(cost.count() - columns);
  const double inflation = problem.weighted ? std::max(1.0, chi2) : chi2;
  const Eigen::MatrixXd inner = fit::covarianceOf(jacobian).matrix * inflation;

  ModalFit fit;
  fit.reduced_chi2 = problem.weighted ? chi2 : std::numeric_limits<double>::quiet_NaN();
  std::vector<int> order(solution.modes);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return solution.parameters[3 * a] < solution.parameters[3 * b]; });
  // Rows of the map from the solver's parameters to the physical ones.
  const int outer = 3 * solution.modes + 1;
  Eigen::MatrixXd map = Eigen::MatrixXd::Zero(outer, columns);
  for (int k = 0; k < solution.modes; ++k) {
    const int from = 3 * order[k];
    Mode mode;
    mode.frequency = std::exp(solution.parameters[from]);
    mode.damping_ratio = std::exp(solution.parameters[from + 1]);
    mode.gain = problem.scale * solution.parameters[from + 2];
    map(3 * k, from) = mode.frequency;
    map(3 * k + 1, from + 1) = mode.damping_ratio;
    map(3 * k + 2, from + 2) = problem.scale;
    if (problem.unit_static_gain) map(outer - 1, from + 2) = -problem.scale;
    fit.model.modes.push_back(mode);
  }
  if (problem.direct) map(outer - 1, 3 * solution.modes) = problem.scale;
  fit.covariance = fit::propagated(map, inner);
  double gains = 0.0;
  for (int k = 0; k < solution.modes; ++k) {
    Mode& mode = fit.model.modes[k];
    mode.frequency_std = std::sqrt(fit.covariance(3 * k, 3 * k));
    mode.damping_ratio_std = std::sqrt(fit.covariance(3 * k + 1, 3 * k + 1));
    mode.gain_std = std::sqrt(fit.covariance(3 * k + 2, 3 * k + 2));
    gains += mode.gain;
  }
  fit.model.direct = problem.unit_static_gain ? 1.0 - gains
                     : problem.direct         ? problem.scale * solution.parameters[3 * solution.modes]
                                              : 0.0;
  fit.model.direct_std = std::sqrt(fit.covariance(outer - 1, outer - 1));
  double error = 0.0, norm = 0.0;
  for (std::size_t i = 0; i < problem.lines(); ++i) {
    error +=
        residuals.segment<2>(static_cast<Eigen::Index>(2 * i)).squaredNorm() / std::pow(problem.weight[i], 2);
    norm += std::norm(problem.value[i]);
  }
  fit.relative_error = std::sqrt(error / norm);
  return fit;
}

}  // namespace

std::vector<double> findPeaks(const FrequencyResponse& frf, double low, double high, double share) {
  std::vector<double> height;
  std::vector<double> frequency;
  for (std::size_t i = 0; i < frf.size(); ++i) {
    if (frf.frequency[i] < low || frf.frequency[i] > high) continue;
    frequency.push_back(frf.frequency[i]);
    height.push_back(std::abs(frf.value[i]));
  }
  struct Peak {
    std::size_t line;
    double prominence;
  };
  std::vector<Peak> peaks;
  for (std::size_t i = 1; i + 1 < height.size(); ++i) {
    if (!(height[i] > height[i - 1] && height[i] >= height[i + 1])) continue;
    double left = height[i], right = height[i];
    for (std::size_t j = i; j-- > 0 && height[j] <= height[i];) left = std::min(left, height[j]);
    for (std::size_t j = i + 1; j < height.size() && height[j] <= height[i]; ++j)
      right = std::min(right, height[j]);
    peaks.push_back({i, height[i] - std::max(left, right)});
  }
  std::sort(peaks.begin(), peaks.end(),
            [](const Peak& a, const Peak& b) { return a.prominence > b.prominence; });
  std::vector<double> result;
  for (const Peak& peak : peaks) {
    if (peak.prominence < share * peaks.front().prominence) break;
    result.push_back(frequency[peak.line]);
  }
  return result;
}

ModalFit fitModes(const FrequencyResponse& frf, const ModalFitOptions& options) {
  const ModalLines problem = prepare(frf, options);
  Solution solution;
  solution.parameters.assign(problem.parameters(0), 0.0);
  const bool fixed = options.modes > 0;
  const int most = fixed ? options.modes : options.max_modes;
  while (solution.modes < most) {
    Solution more;
    try {
      more = withOneMore(problem, solution);
    } catch (const Error&) {
      if (fixed || solution.modes == 0) throw;
      break;
    }
    const bool better = solution.modes == 0 || bic(problem, more) < bic(problem, solution) - BIC_STEP;
    if (!fixed && !better) break;
    solution = std::move(more);
  }

  return describe(problem, solution);
}

}  // namespace smartmill
