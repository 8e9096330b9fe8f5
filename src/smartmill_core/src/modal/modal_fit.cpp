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
#include "smartmill_core/modal/modal_estimate.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;

// A gain below this share of the tallest line counts as zero.
constexpr double LEAST_GAIN = 1e-6;
// The equivalent mode above the band is at least a few percent above the last line.
constexpr double MOST_BENT = 0.94;
// The standard deviation of an undetermined value, as multiple of the value.
constexpr double UNDETERMINED = 10.0;
// Range of correlated misfit, in lines; upper bound of the leverage correction.
constexpr Eigen::Index NEIGHBOURS = 3;
constexpr double MOST_LEVERAGE = 0.8;

struct Solution {
  int modes = 0;
  std::vector<double> parameters;                         // of ModalResiduals
  double cost = std::numeric_limits<double>::infinity();  // sum of squared weighted residuals
};

// Best gains and direct share for given frequencies and damping ratios.
void solveLinear(const ModalLines& problem, Solution& solution) {
  const int free = problem.linear(solution.modes);
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
    if (problem.direct)
      set(column, problem.scale * problem.bent(problem.frequency[i], solution.parameters.back()));
    const Complex target = problem.value[i] - (problem.unit_static_gain ? 1.0 : 0.0);
    b(row) = w * target.real();
    b(row + 1) = w * target.imag();
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
  if (problem.direct) {
    parameters.back().low = 0.0;
    parameters.back().high = MOST_BENT;
    parameters.back().scale = 0.1;
  }
  fit::Options options;
  options.name = "modal fit";
  const fit::Result found = fit::minimise(ModalResiduals(problem, solution.modes), parameters, options);
  if (!found.usable()) return;
  solution.parameters.assign(found.value.data(), found.value.data() + found.value.size());
  solution.cost = found.squares;
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
  problem.direct = !options.unit_static_gain;
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
    // std_dev is that of the complex value; real and imaginary part have std_dev / sqrt(2). The lower bound
    // limits the weight of a single line.
    weight = problem.weighted ? std::sqrt(2.0) / std::max(weight, 1e-9 * largest) : 1.0 / largest;
  }
  return problem;
}

Solution without(const Solution& from, int mode) {
  Solution less = from;
  --less.modes;
  less.cost = std::numeric_limits<double>::infinity();
  less.parameters.erase(less.parameters.begin() + 3 * mode, less.parameters.begin() + 3 * mode + 3);
  return less;
}

// Fits all modes together, real and with the constraints of the options. Modes with zero gain are dropped,
// unless their number is given.
Solution fitTogether(const ModalLines& problem, const std::vector<EstimatedMode>& found, bool fixed) {
  Solution solution;
  solution.modes = static_cast<int>(found.size());
  for (const EstimatedMode& m : found)
    solution.parameters.insert(solution.parameters.end(),
                               {std::log(m.frequency), std::log(m.damping_ratio), 0.0});
  solution.parameters.resize(static_cast<std::size_t>(problem.parameters(solution.modes)), 0.0);
  solve(problem, solution);
  for (int k = solution.modes - 1; problem.positive && !fixed && k >= 0 && solution.modes > 1; --k) {
    if (solution.parameters[static_cast<std::size_t>(3 * k + 2)] > LEAST_GAIN) continue;
    solution = without(solution, k);
    solve(problem, solution);
  }
  if (!std::isfinite(solution.cost)) throw Error("modal fit: the solver did not converge");
  return solution;
}

// The misfit of a measured FRF is not uniform noise: it is concentrated at the resonances, where few lines
// have most leverage, and correlated from line to line. The covariance therefore uses each line's own misfit,
// corrected for leverage (MacKinnon and White's HC3), with its neighbours (Newey and West's weights). It can
// only increase the standard deviations.
Eigen::MatrixXd widened(const Eigen::MatrixXd& even, const Eigen::MatrixXd& inverse,
                        const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& residuals) {
  if (!inverse.allFinite()) return even;
  const Eigen::Index lines = residuals.size() / 2, columns = jacobian.cols();
  Eigen::MatrixXd score = Eigen::MatrixXd::Zero(lines, columns);
  const Eigen::MatrixXd pull = jacobian * inverse;
  for (Eigen::Index row = 0; row < residuals.size(); ++row) {
    const double leverage = std::min(MOST_LEVERAGE, pull.row(row).dot(jacobian.row(row)));
    score.row(row / 2) += residuals[row] / (1.0 - leverage) * jacobian.row(row);
  }
  const Eigen::MatrixXd influence = score * inverse;  // of each line on each parameter
  Eigen::VectorXd wide = Eigen::VectorXd::Ones(columns);
  for (Eigen::Index k = 0; k < columns; ++k) {
    const Eigen::VectorXd of = influence.col(k);
    double variance = of.squaredNorm();
    for (Eigen::Index lag = 1; lag <= NEIGHBOURS && lag < lines; ++lag) {
      const double weight = 1.0 - static_cast<double>(lag) / (NEIGHBOURS + 1.0);
      variance += 2.0 * weight * of.head(lines - lag).dot(of.tail(lines - lag));
    }
    if (even(k, k) > 0.0 && std::isfinite(variance))
      wide[k] = std::sqrt(std::max(1.0, variance / even(k, k)));
  }
  return wide.asDiagonal() * even * wide.asDiagonal();
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
  const Eigen::MatrixXd inverse = fit::covarianceOf(jacobian).matrix;
  const Eigen::MatrixXd inner = widened(inverse * inflation, inverse, jacobian, residuals);

  ModalFit fit;
  fit.reduced_chi2 = problem.weighted ? chi2 : std::numeric_limits<double>::quiet_NaN();
  std::vector<int> order(solution.modes);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return solution.parameters[3 * a] < solution.parameters[3 * b]; });
  // Jacobian of the physical parameters with respect to the solver's.
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
    const auto deviation = [&](int i, double value) {
      const double d = std::sqrt(fit.covariance(3 * k + i, 3 * k + i));
      return std::isfinite(d) ? d : UNDETERMINED * std::abs(value);
    };
    mode.frequency_std = deviation(0, mode.frequency);
    mode.damping_ratio_std = deviation(1, mode.damping_ratio);
    mode.gain_std = deviation(2, mode.gain);
    gains += mode.gain;
  }
  fit.model.direct = problem.unit_static_gain ? 1.0 - gains
                     : problem.direct         ? problem.scale * solution.parameters[3 * solution.modes]
                                              : 0.0;
  fit.model.direct_std = std::sqrt(fit.covariance(outer - 1, outer - 1));
  if (!std::isfinite(fit.model.direct_std)) fit.model.direct_std = UNDETERMINED * std::abs(fit.model.direct);
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

ModalFit fitModes(const FrequencyResponse& frf, const ModalFitOptions& options) {
  const ModalLines problem = prepare(frf, options);
  ModalEstimateOptions search;
  search.low = options.low;
  search.high = options.high;
  search.real_modes = true;
  ModalEstimate estimate = estimateModes({frf}, search);
  std::vector<EstimatedMode> chosen = std::move(estimate.modes);
  const bool fixed = options.modes > 0;
  const auto most = static_cast<std::size_t>(fixed ? options.modes : options.max_modes);
  if (fixed && chosen.size() < most)
    chosen.insert(chosen.end(), estimate.doubts.begin(), estimate.doubts.end());
  std::sort(chosen.begin(), chosen.end(),
            [](const EstimatedMode& a, const EstimatedMode& b) { return a.evidence > b.evidence; });
  if (chosen.empty()) throw Error("modal fit: no significant mode in the band");
  if (fixed && chosen.size() < most) {
    throw Error("modal fit: " + std::to_string(most) + " modes are required, the band has " +
                std::to_string(chosen.size()));
  }
  if (chosen.size() > most) chosen.resize(most);
  ModalFit fit = describe(problem, fitTogether(problem, chosen, fixed));
  for (const EstimatedMode& m : estimate.doubts) {
    if (!fixed)
      fit.doubts.push_back(
          {m.frequency, m.damping_ratio, m.gain[0], m.frequency_std, m.damping_ratio_std, m.gain_std[0]});
  }
  return fit;
}

}  // namespace smartmill
