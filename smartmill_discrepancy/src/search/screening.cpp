#include "smartmill_discrepancy/search/screening.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/Cholesky>

#include "smartmill_discrepancy/search/mode_probes.h"

namespace smartmill::discrepancy {
namespace {

using Eigen::Index;

// Orthogonal projection off the nominal tangents (with their priors) and off the tangents of the members.
class Projection {
 public:
  Projection(const Fitter& fitter, const Fit& now, const NominalTangents& tangents) {
    const auto& freedom = fitter.freedom().coordinates();
    const auto samples = static_cast<Index>(fitter.runner().size());
    std::vector<MachineModel> models{fitter.model(now.state)};
    std::vector<double> steps;
    for (std::size_t m = 0; m < now.state.members.size(); ++m) {
      const auto& coordinates = now.state.members[m].hypothesis->coordinates;
      for (std::size_t c = 0; c < coordinates.size(); ++c) {
        FitState moved = now.state;
        double& value = moved.members[m].values[c];
        const double step =
            value + coordinates[c].step > coordinates[c].high ? -coordinates[c].step : coordinates[c].step;
        value += step;
        steps.push_back(step);
        models.push_back(fitter.model(moved));
      }
    }
    auto simulated = fitter.runner().simulate(models);
    base_ = std::move(simulated.front());
    basis_.resize(samples, static_cast<Index>(freedom.size() + steps.size()));
    basis_.leftCols(static_cast<Index>(freedom.size())) = tangents.columns;
    Eigen::VectorXd prior = Eigen::VectorXd::Zero(basis_.cols());
    for (std::size_t c = 0; c < freedom.size(); ++c)
      prior[static_cast<Index>(c)] = 1.0 / (freedom[c].prior_std * freedom[c].prior_std);
    Eigen::VectorXd pull = Eigen::VectorXd::Zero(basis_.cols());
    for (std::size_t c = 0; c < freedom.size(); ++c)
      pull[static_cast<Index>(c)] = -now.state.nominal[c] * prior[static_cast<Index>(c)];
    for (std::size_t k = 0; k < steps.size(); ++k) {
      const auto column = static_cast<Index>(freedom.size() + k);
      for (Index i = 0; i < samples; ++i) {
        const auto s = static_cast<std::size_t>(i);
        basis_(i, column) = (simulated[k + 1][s] - base_[s]) / steps[k];
      }
      prior[column] = 1e-12 + 1e-9 * basis_.col(column).squaredNorm();
    }
    residual_ = Eigen::Map<const Eigen::VectorXd>(now.residual.data(), samples);
    Eigen::MatrixXd information = basis_.transpose() * basis_;
    information.diagonal() += prior;
    Eigen::VectorXd right = basis_.transpose() * residual_ + pull;
    const auto hold = [&](std::size_t coordinate) {
      const auto c = static_cast<Index>(coordinate);
      basis_.col(c).setZero();
      information.row(c).setZero();
      information.col(c).setZero();
      information(c, c) = prior[c];
      right[c] = 0.0;
    };
    // One that stands at its bound moves no further, nor does one that the rest would push over it.
    std::vector<bool> held(freedom.size(), false);
    for (std::size_t c = 0; c < freedom.size(); ++c) {
      const double room =
          std::min(now.state.nominal[c] - freedom[c].low, freedom[c].high - now.state.nominal[c]);
      held[c] = room < 0.01 * freedom[c].prior_std;
      if (held[c]) hold(c);
    }
    for (bool over = true; over;) {
      information_.compute(information);
      solved_residual_ = information_.solve(right);
      double worst = 0.01;  // standard deviations
      std::size_t which = freedom.size();
      for (std::size_t c = 0; c < freedom.size(); ++c) {
        const double at = now.state.nominal[c] + solved_residual_[static_cast<Index>(c)];
        const double beyond = std::max(freedom[c].low - at, at - freedom[c].high) / freedom[c].prior_std;
        if (held[c] || beyond <= worst) continue;
        worst = beyond;
        which = c;
      }
      over = which < freedom.size();
      if (over) {
        held[which] = true;
        hold(which);
      }
    }
  }

  const std::vector<double>& base() const { return base_; }

  // Chi2 that these columns take away, with the amplitudes that do it.
  double gain(const Eigen::MatrixXd& columns, Eigen::VectorXd* amplitudes, Eigen::VectorXd* signature) const {
    const Eigen::MatrixXd cross = basis_.transpose() * columns;
    const Eigen::MatrixXd solved = information_.solve(cross);
    Eigen::MatrixXd own = columns.transpose() * columns - cross.transpose() * solved;
    const Eigen::VectorXd raw = columns.colwise().squaredNorm();
    for (Index k = 0; k < own.rows(); ++k) own(k, k) += 1e-9 * raw[k] + 1e-30;
    const Eigen::VectorXd score = columns.transpose() * residual_ - cross.transpose() * solved_residual_;
    *amplitudes = own.ldlt().solve(score);
    if (signature) {
      *signature = columns * *amplitudes - basis_ * (solved * *amplitudes);
      const double size = signature->norm();
      if (size > 0.0) *signature /= size;
    }
    return score.dot(*amplitudes);
  }

  // The same of each column by itself; 0 where it has no trace, no number, or a sign that cannot be.
  Eigen::VectorXd gains(const Eigen::MatrixXd& columns, bool positive) const {
    const Eigen::MatrixXd cross = basis_.transpose() * columns;
    const Eigen::MatrixXd solved = information_.solve(cross);
    const Eigen::VectorXd raw = columns.colwise().squaredNorm();
    const Eigen::VectorXd own = raw - (cross.cwiseProduct(solved)).colwise().sum().transpose();
    const Eigen::VectorXd score = columns.transpose() * residual_ - cross.transpose() * solved_residual_;
    Eigen::VectorXd result = Eigen::VectorXd::Zero(columns.cols());
    for (Index k = 0; k < columns.cols(); ++k) {
      if (!std::isfinite(own[k]) || !std::isfinite(score[k]) || raw[k] == 0.0) continue;
      if (!positive || score[k] > 0.0) result[k] = score[k] * score[k] / (own[k] + 1e-9 * raw[k] + 1e-30);
    }
    return result;
  }

 private:
  std::vector<double> base_;
  Eigen::MatrixXd basis_;
  Eigen::VectorXd residual_, solved_residual_;
  Eigen::LDLT<Eigen::MatrixXd> information_;
};

// The two best frequencies of a mode, one octave-third or more apart, from columns to first order.
std::vector<double> bestFrequencies(const Projection& projection, const std::vector<double>& frequencies,
                                    const std::function<std::vector<double>(double)>& column, bool positive,
                                    int threads) {
  constexpr std::size_t BATCH = 8;  // one pass over the tangents serves so many
  std::vector<double> gains(frequencies.size(), 0.0);
  runParallel((frequencies.size() + BATCH - 1) / BATCH, threads, [&](std::size_t batch) {
    const std::size_t first = batch * BATCH, count = std::min(BATCH, frequencies.size() - first);
    Eigen::MatrixXd columns;
    for (std::size_t k = 0; k < count; ++k) {
      const std::vector<double> values = column(frequencies[first + k]);
      const auto size = static_cast<Index>(values.size());
      columns.resize(size, k == 0 ? static_cast<Index>(count) : columns.cols());
      columns.col(static_cast<Index>(k)) = Eigen::Map<const Eigen::VectorXd>(values.data(), size);
    }
    const Eigen::VectorXd each = projection.gains(columns, positive);
    for (std::size_t k = 0; k < count; ++k) gains[first + k] = each[static_cast<Index>(k)];
  });
  std::vector<double> best;
  for (int n = 0; n < 2; ++n) {
    const auto top = std::max_element(gains.begin(), gains.end());
    if (*top <= 0.0) break;
    const double f = frequencies[static_cast<std::size_t>(top - gains.begin())];
    best.push_back(f);
    for (std::size_t k = 0; k < gains.size(); ++k) {
      if (std::abs(std::log(frequencies[k] / f)) < 0.23) gains[k] = 0.0;
    }
  }
  return best;
}

// Where to try a mode whose frequency nobody knows.
// tip: best frequencies of the tool's axes, once found.
std::vector<Hypothesis::Probe> modeProbes(const Hypothesis& h, const Projection& projection,
                                          const ModeProbes& probes, const TwinRunner& runner,
                                          std::map<char, std::vector<double>>& tip) {
  std::vector<Hypothesis::Probe> found;
  double rate = 0.0;
  for (const TestData& t : runner.data().tests) rate = std::max(rate, t.test.sample_rate);
  if (h.effect == "extra_mode") {
    constexpr double DAMPING = 0.04;
    const auto axis = static_cast<std::size_t>(h.variant.front() - 'x');
    for (const double f : bestFrequencies(
             projection, ModeProbes::grid(60.0, 0.42 * rate, 1.06),
             [&](double at) { return probes.sensorMode(axis, at, DAMPING); }, false, runner.threads())) {
      const double d = std::log(DAMPING);
      found.push_back({{std::log(f), d, 0.0}, {{std::log(f), d, 0.01}}, false});
    }
  }
  if (h.effect == "tool_flexibility") {
    constexpr double DAMPING = 0.05;
    Hypothesis::Probe probe;
    for (const char a : h.variant) {
      if (tip.count(a) == 0) {
        tip[a] = bestFrequencies(
            projection, ModeProbes::grid(200.0, 6000.0, 1.08),
            [&](double at) { return probes.tipMode(a == 'x' ? 0 : 1, at, DAMPING); }, true, runner.threads());
      }
      const double f = tip[a].empty() ? 1200.0 : tip[a].front();
      for (const double v : {std::log(f), std::log(DAMPING), 0.0}) probe.null.push_back(v);
    }
    for (std::size_t k = 2; k < probe.null.size(); k += 3) {
      probe.points.push_back(probe.null);
      probe.points.back()[k] = 1.0;
    }
    found.push_back(probe);
  }
  return found;
}

}  // namespace

std::vector<Promise> screen(const Fitter& fitter, const Fit& now, const NominalTangents& tangents,
                            const std::vector<Hypothesis>& tried) {
  const Projection projection(fitter, now, tangents);
  const auto samples = static_cast<Index>(fitter.runner().size());
  const ModeProbes mode_probes(fitter.runner(), fitter.model(now.state));
  std::map<char, std::vector<double>> tip;
  std::vector<Promise> promises;
  for (const Hypothesis& h : tried) {
    const auto has = [&](const std::string& variant) {
      return std::any_of(now.state.members.begin(), now.state.members.end(), [&](const Member& m) {
        return m.hypothesis->effect == h.effect && m.hypothesis->variant == variant;
      });
    };
    if (has(h.variant) || (!h.after.empty() && !has(h.after))) continue;
    Promise best;
    best.hypothesis = &h;
    for (const Hypothesis::Probe& probe :
         h.probes.empty() ? modeProbes(h, projection, mode_probes, fitter.runner(), tip) : h.probes) {
      std::vector<MachineModel> models;
      for (const std::vector<double>& point : probe.points) {
        FitState with = now.state;
        with.members.push_back({&h, point});
        models.push_back(fitter.model(with));
      }
      const auto simulated = fitter.runner().simulate(models);
      Eigen::MatrixXd columns(samples, static_cast<Index>(models.size()));
      for (Index k = 0; k < columns.cols(); ++k) {
        for (Index i = 0; i < samples; ++i) {
          const auto s = static_cast<std::size_t>(i);
          columns(i, k) = simulated[static_cast<std::size_t>(k)][s] - projection.base()[s];
        }
      }
      if (!columns.allFinite() || columns.squaredNorm() == 0.0) continue;
      Eigen::VectorXd amplitudes, signature;
      const double gain = projection.gain(columns, &amplitudes, &signature);
      if (gain <= best.gain) continue;
      std::vector<double> start = probe.from_points ? probe.points.front() : probe.null;
      for (Index k = 0; k < amplitudes.size() && !probe.from_points; ++k) {
        for (std::size_t c = 0; c < start.size(); ++c)
          start[c] += amplitudes[k] * (probe.points[static_cast<std::size_t>(k)][c] - probe.null[c]);
      }
      for (std::size_t c = 0; c < start.size(); ++c)
        start[c] = std::clamp(start[c], h.coordinates[c].low, h.coordinates[c].high);
      if (start == probe.null) continue;  // the data ask for what cannot be
      best.gain = gain;
      best.signature = std::move(signature);
      best.start = std::move(start);
      best.null = probe.from_points ? std::vector<double>{} : probe.null;
    }
    promises.push_back(std::move(best));
  }
  std::stable_sort(promises.begin(), promises.end(),
                   [](const Promise& a, const Promise& b) { return a.gain > b.gain; });
  return promises;
}

}  // namespace smartmill::discrepancy
