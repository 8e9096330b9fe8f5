#include "smartmill_discrepancy/screening.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

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
        const double step = value + coordinates[c].step > coordinates[c].high ? -coordinates[c].step : coordinates[c].step;
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
    information_.compute(information);
    solved_residual_ = information_.solve(basis_.transpose() * residual_ + pull);
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

 private:
  std::vector<double> base_;
  Eigen::MatrixXd basis_;
  Eigen::VectorXd residual_, solved_residual_;
  Eigen::LDLT<Eigen::MatrixXd> information_;
};

}  // namespace

std::vector<Promise> screen(const Fitter& fitter, const Fit& now, const NominalTangents& tangents,
                            const std::vector<Hypothesis>& tried) {
  const Projection projection(fitter, now, tangents);
  const auto samples = static_cast<Index>(fitter.runner().size());
  std::vector<Promise> promises;
  for (const Hypothesis& h : tried) {
    const bool taken = std::any_of(now.state.members.begin(), now.state.members.end(), [&](const Member& m) {
      return m.hypothesis->effect == h.effect && m.hypothesis->variant == h.variant;
    });
    if (taken || h.probes.empty()) continue;
    Promise best;
    best.hypothesis = &h;
    for (const Hypothesis::Probe& probe : h.probes) {
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
      best.gain = gain;
      best.signature = std::move(signature);
      best.start = probe.from_points ? probe.points.front() : probe.null;
      if (probe.from_points) continue;
      for (Index k = 0; k < amplitudes.size(); ++k) {
        for (std::size_t c = 0; c < best.start.size(); ++c)
          best.start[c] += amplitudes[k] * (probe.points[static_cast<std::size_t>(k)][c] - probe.null[c]);
      }
      for (std::size_t c = 0; c < best.start.size(); ++c)
        best.start[c] = std::clamp(best.start[c], h.coordinates[c].low, h.coordinates[c].high);
    }
    promises.push_back(std::move(best));
  }
  std::stable_sort(promises.begin(), promises.end(), [](const Promise& a, const Promise& b) { return a.gain > b.gain; });
  return promises;
}

}  // namespace smartmill::discrepancy
