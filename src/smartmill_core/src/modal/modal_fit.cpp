#include "smartmill_core/modal/modal_fit.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <ceres/ceres.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;

constexpr double MIN_DAMPING = 1e-4;
constexpr double MAX_DAMPING = 0.5;
constexpr double START_DAMPING = 0.02;
// A further mode must lower the BIC by more than this: strong evidence on the usual scale.
constexpr double BIC_STEP = 10.0;

// Lines of the fit, their weights, and which terms beside the modes are free.
struct Problem {
  std::vector<double> frequency;   // [Hz]
  std::vector<Complex> value;      // [unit]
  std::vector<double> weight;      // [1/unit] of the real and of the imaginary part
  double scale = 1.0;              // [unit] of gains, direct and mass line inside the solver
  bool weighted = false;
  bool unit_static_gain = false;
  bool direct = false;
  bool mass = false;
  bool positive = false;
  double low = 0.0, high = 0.0;    // [Hz]

  std::size_t lines() const { return frequency.size(); }
  int parameters(int modes) const { return 3 * modes + (direct ? 1 : 0) + (mass ? 1 : 0); }
  // Mass line 1 / -(f / low)^2: of the size of one at the lower end of the band.
  double massTerm(std::size_t i) const { return -std::pow(reference() / frequency[i], 2); }
  double reference() const { return std::max(low, frequency.front()); }
};

// h = w_n^2 / (w_n^2 - w^2 + 2 i zeta w_n w)
Complex unitMode(double f, double f0, double zeta) {
  const double r = f / f0;
  return 1.0 / Complex(1.0 - r * r, 2.0 * zeta * r);
}

// Parameters: log f0, log zeta, gain / scale of each mode, then direct / scale, then mass line / scale.
class ModalCost : public ceres::CostFunction {
 public:
  ModalCost(const Problem& problem, int modes) : problem_(problem), modes_(modes) {
    set_num_residuals(static_cast<int>(2 * problem.lines()));
    mutable_parameter_block_sizes()->push_back(problem.parameters(modes));
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const double* p = parameters[0];
    double* jacobian = jacobians ? jacobians[0] : nullptr;
    const int columns = problem_.parameters(modes_);
    for (std::size_t i = 0; i < problem_.lines(); ++i) {
      const double f = problem_.frequency[i];
      const double w = problem_.weight[i];
      const double s = problem_.scale;
      Complex model = problem_.unit_static_gain ? 1.0 : 0.0;
      const auto set = [&](int column, Complex derivative) {
        if (!jacobian) return;
        jacobian[2 * i * columns + column] = w * derivative.real();
        jacobian[(2 * i + 1) * columns + column] = w * derivative.imag();
      };
      for (int k = 0; k < modes_; ++k) {
        const double f0 = std::exp(p[3 * k]), zeta = std::exp(p[3 * k + 1]), gain = s * p[3 * k + 2];
        const Complex h = unitMode(f, f0, zeta);
        const double r = f / f0;
        const Complex shape = problem_.unit_static_gain ? h - 1.0 : h;
        model += gain * shape;
        set(3 * k, gain * h * h * r * Complex(-2.0 * r, 2.0 * zeta));
        set(3 * k + 1, -gain * h * h * Complex(0.0, 2.0 * zeta * r));
        set(3 * k + 2, s * shape);
      }
      int next = 3 * modes_;
      if (problem_.direct) {
        model += s * p[next];
        set(next++, s);
      }
      if (problem_.mass) {
        model += s * p[next] * problem_.massTerm(i);
        set(next, s * problem_.massTerm(i));
      }
      residuals[2 * i] = w * (model.real() - problem_.value[i].real());
      residuals[2 * i + 1] = w * (model.imag() - problem_.value[i].imag());
    }
    return true;
  }

 private:
  const Problem& problem_;
  int modes_;
};

struct Solution {
  int modes = 0;
  std::vector<double> parameters;
  double cost = std::numeric_limits<double>::infinity();  // sum of squared weighted residuals
};

// Gains, direct and mass line that fit best for given frequencies and damping ratios.
void solveLinear(const Problem& problem, Solution& solution) {
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
  const Eigen::VectorXd x = (a.transpose() * a).ldlt().solve(a.transpose() * b);
  if (!x.allFinite()) return;
  for (int k = 0; k < solution.modes; ++k) solution.parameters[3 * k + 2] = x(k);
  for (int k = solution.modes; k < free; ++k) solution.parameters[2 * solution.modes + k] = x(k);
}

void solve(const Problem& problem, Solution& solution) {
  solveLinear(problem, solution);
  ceres::Problem::Options problem_options;
  ceres::Problem ceres_problem(problem_options);
  double* p = solution.parameters.data();
  ceres_problem.AddResidualBlock(new ModalCost(problem, solution.modes), nullptr, p);
  for (int k = 0; k < solution.modes; ++k) {
    ceres_problem.SetParameterLowerBound(p, 3 * k, std::log(0.7 * problem.reference()));
    ceres_problem.SetParameterUpperBound(p, 3 * k, std::log(1.4 * problem.high));
    ceres_problem.SetParameterLowerBound(p, 3 * k + 1, std::log(MIN_DAMPING));
    ceres_problem.SetParameterUpperBound(p, 3 * k + 1, std::log(MAX_DAMPING));
    if (problem.positive) {
      p[3 * k + 2] = std::max(p[3 * k + 2], 1e-3);
      ceres_problem.SetParameterLowerBound(p, 3 * k + 2, 0.0);
    }
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-11;
  options.parameter_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  solution.cost = summary.IsSolutionUsable() ? 2.0 * summary.final_cost : std::numeric_limits<double>::infinity();
}

FrequencyResponse residual(const Problem& problem, const Solution& solution) {
  FrequencyResponse left;
  left.frequency = problem.frequency;
  std::vector<double> r(2 * problem.lines());
  const double* blocks[] = {solution.parameters.data()};
  ModalCost(problem, solution.modes).Evaluate(blocks, r.data(), nullptr);
  for (std::size_t i = 0; i < problem.lines(); ++i) left.value.emplace_back(r[2 * i], r[2 * i + 1]);
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

Solution withOneMore(const Problem& problem, const Solution& from) {
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
  if (best.modes == 0) throw Error("modal fit: the solver did not converge with " + std::to_string(from.modes + 1) + " modes");
  return best;
}

double bic(const Problem& problem, const Solution& solution) {
  const double n = 2.0 * problem.lines();
  return n * std::log(solution.cost / n) + problem.parameters(solution.modes) * std::log(n);
}

// Standard deviations from the scatter of a few hits are noisy and lean towards the lines that happen to agree; noise is smooth in
// frequency, so that the root mean square over neighbouring lines is the better weight.
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

Problem prepare(const FrequencyResponse& frf, const ModalFitOptions& options) {
  if (frf.value.size() != frf.size()) throw Error("modal fit: the FRF has unequal numbers of lines and values");
  if (!(options.high > options.low)) throw Error("modal fit: the band is empty");
  const FrequencyResponse band = frf.band(options.low, options.high);
  Problem problem;
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
    const double deviation = i < band.std_dev.size() ? band.std_dev[i] : std::numeric_limits<double>::quiet_NaN();
    problem.weight.push_back(deviation);
    if (deviation > 0.0) ++known;
    largest = std::max(largest, std::abs(band.value[i]));
  }
  const int least = problem.parameters(std::max(1, options.modes)) + 1;
  if (static_cast<int>(2 * problem.lines()) < 2 * least) {
    throw Error("modal fit: " + std::to_string(problem.lines()) + " lines between " + std::to_string(options.low) +
                " and " + std::to_string(options.high) + " Hz are too few");
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
    for (std::size_t j = i + 1; j < height.size() && height[j] <= height[i]; ++j) right = std::min(right, height[j]);
    peaks.push_back({i, height[i] - std::max(left, right)});
  }
  std::sort(peaks.begin(), peaks.end(), [](const Peak& a, const Peak& b) { return a.prominence > b.prominence; });
  std::vector<double> result;
  for (const Peak& peak : peaks) {
    if (peak.prominence < share * peaks.front().prominence) break;
    result.push_back(frequency[peak.line]);
  }
  return result;
}

ModalFit fitModes(const FrequencyResponse& frf, const ModalFitOptions& options) {
  const Problem problem = prepare(frf, options);
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

  const int columns = problem.parameters(solution.modes);
  const auto rows = static_cast<Eigen::Index>(2 * problem.lines());
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> jacobian(rows, columns);
  std::vector<double> residuals(rows);
  const double* blocks[] = {solution.parameters.data()};
  double* jacobians[] = {jacobian.data()};
  ModalCost(problem, solution.modes).Evaluate(blocks, residuals.data(), jacobians);
  const double chi2 = solution.cost / static_cast<double>(rows - columns);
  const double inflation = problem.weighted ? std::max(1.0, chi2) : chi2;
  Eigen::MatrixXd inner =
      (jacobian.transpose() * jacobian).ldlt().solve(Eigen::MatrixXd::Identity(columns, columns)) * inflation;

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
  fit.covariance = map * inner * map.transpose();
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
    error += (residuals[2 * i] * residuals[2 * i] + residuals[2 * i + 1] * residuals[2 * i + 1]) /
             (problem.weight[i] * problem.weight[i]);
    norm += std::norm(problem.value[i]);
  }
  fit.relative_error = std::sqrt(error / norm);
  return fit;
}

}  // namespace smartmill
