#include "smartmill_discrepancy/fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <ceres/ceres.h>
#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "smartmill_core/error.h"

namespace smartmill::discrepancy {
namespace {

using Values = std::vector<double>;

/// Residuals of a campaign: measured - simulated over noise, then the priors.
class CampaignCost : public ceres::CostFunction {
 public:
  CampaignCost(const Fitter& fitter, const FitState& start, const NominalTangents* frozen, bool nominal_free)
      : fitter_(fitter), start_(start), frozen_(frozen) {
    if (nominal_free) coordinates_ = fitter.freedom().coordinates();
    nominal_ = coordinates_.size();
    for (const Member& m : start.members)
      coordinates_.insert(coordinates_.end(), m.hypothesis->coordinates.begin(),
                          m.hypothesis->coordinates.end());
    samples_ = fitter.runner().size();
    set_num_residuals(static_cast<int>(samples_ + coordinates_.size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(coordinates_.size()));
  }

  const std::vector<Coordinate>& coordinates() const { return coordinates_; }

  Values pack(const FitState& state) const {
    Values p(state.nominal.begin(), state.nominal.begin() + static_cast<std::ptrdiff_t>(nominal_));
    for (const Member& m : state.members) p.insert(p.end(), m.values.begin(), m.values.end());
    return p;
  }

  FitState unpack(const double* p) const {
    FitState state = start_;
    std::copy(p, p + nominal_, state.nominal.begin());
    const double* next = p + nominal_;
    for (Member& m : state.members) {
      std::copy(next, next + m.values.size(), m.values.begin());
      next += m.values.size();
    }
    return state;
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const double* p = parameters[0];
    const std::size_t count = coordinates_.size();
    const Values now(p, p + count);
    const bool tangents = jacobians && jacobians[0];
    const std::size_t first = frozen_ ? nominal_ : 0;
    std::vector<MachineModel> models;
    std::vector<std::size_t> column;
    Values step(count, 0.0);
    const bool known = now == last_;
    if (!known) models.push_back(modelAt(now));
    if (tangents) {
      for (std::size_t c = first; c < count; ++c) {
        const Coordinate& k = coordinates_[c];
        step[c] = now[c] + k.step > k.high ? -k.step : k.step;
        Values moved = now;
        moved[c] += step[c];
        models.push_back(modelAt(moved));
        column.push_back(c);
      }
    }
    std::vector<Values> simulated;
    try {
      simulated = fitter_.runner().simulate(models);
    } catch (const Error&) {
      return false;  // a point that the twin refuses is no better point
    }
    if (!known) {
      last_simulated_ = std::move(simulated.front());
      last_ = now;
      simulated.erase(simulated.begin());
    }
    const Values& measured = fitter_.runner().measured();
    Eigen::Map<Eigen::VectorXd> r(residuals, static_cast<Eigen::Index>(samples_));
    for (std::size_t i = 0; i < samples_; ++i) residuals[i] = last_simulated_[i] - measured[i];
    if (frozen_ && nominal_ > 0) {
      Eigen::VectorXd shift(static_cast<Eigen::Index>(nominal_));
      for (std::size_t c = 0; c < nominal_; ++c)
        shift[static_cast<Eigen::Index>(c)] = now[c] - frozen_->at[c];
      r.noalias() += frozen_->columns * shift;
    }
    for (std::size_t i = 0; i < samples_; ++i) {
      if (!std::isfinite(residuals[i])) return false;
    }
    for (std::size_t c = 0; c < count; ++c)
      residuals[samples_ + c] = (now[c] - coordinates_[c].null) / coordinates_[c].prior_std;
    if (!tangents) return true;
    double* j = jacobians[0];
    if (frozen_) {
      for (std::size_t i = 0; i < samples_; ++i) {
        for (std::size_t c = 0; c < nominal_; ++c)
          j[i * count + c] = frozen_->columns(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(c));
      }
    }
    for (std::size_t k = 0; k < column.size(); ++k) {
      const double scale = 1.0 / step[column[k]];
      for (std::size_t i = 0; i < samples_; ++i) {
        const double d = (simulated[k][i] - last_simulated_[i]) * scale;
        if (!std::isfinite(d)) return false;
        j[i * count + column[k]] = d;
      }
    }
    for (std::size_t c = 0; c < count; ++c) {
      double* row = j + (samples_ + c) * count;
      std::fill(row, row + count, 0.0);
      row[c] = 1.0 / coordinates_[c].prior_std;
    }
    return true;
  }

 private:
  MachineModel modelAt(const Values& p) const {
    FitState state = unpack(p.data());
    if (frozen_) state.nominal = frozen_->at;
    return fitter_.model(state);
  }

  const Fitter& fitter_;
  FitState start_;
  const NominalTangents* frozen_;
  std::size_t nominal_, samples_;
  std::vector<Coordinate> coordinates_;
  mutable Values last_, last_simulated_;
};

}  // namespace

Fitter::Fitter(const TwinRunner& runner, const NominalFreedom& freedom) : runner_(runner), freedom_(freedom) {
}

MachineModel Fitter::model(const FitState& state) const {
  MachineModel model = freedom_.apply(runner_.data().nominal, state.nominal);
  for (const Member& m : state.members) model.effects.push_back(m.hypothesis->entry(m.values));
  return model;
}

NominalTangents Fitter::nominalTangents(const FitState& state) const {
  const std::vector<Coordinate>& coordinates = freedom_.coordinates();
  std::vector<MachineModel> models{model(state)};
  for (std::size_t c = 0; c < coordinates.size(); ++c) {
    FitState moved = state;
    moved.nominal[c] += coordinates[c].step;
    models.push_back(model(moved));
  }
  const std::vector<Values> simulated = runner_.simulate(models);
  NominalTangents tangents{state.nominal, Eigen::MatrixXd(static_cast<Eigen::Index>(runner_.size()),
                                                          static_cast<Eigen::Index>(coordinates.size()))};
  for (std::size_t c = 0; c < coordinates.size(); ++c) {
    for (std::size_t i = 0; i < runner_.size(); ++i) {
      tangents.columns(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(c)) =
          (simulated[c + 1][i] - simulated[0][i]) / coordinates[c].step;
    }
  }
  return tangents;
}

Fit Fitter::fit(const FitState& start, const NominalTangents* frozen, const FitOptions& options) const {
  auto* cost = new CampaignCost(*this, start, frozen, options.nominal_free);  // owned by the problem
  const std::vector<Coordinate> coordinates = cost->coordinates();
  Values p = cost->pack(start);
  for (std::size_t c = 0; c < coordinates.size(); ++c)
    p[c] = std::clamp(p[c], coordinates[c].low, coordinates[c].high);
  Fit fit;
  const auto count = static_cast<Eigen::Index>(coordinates.size());
  const std::size_t samples = runner_.size();
  if (coordinates.empty()) {
    fit.state = start;
    const Values simulated = runner_.simulate(model(start));
    for (std::size_t i = 0; i < samples; ++i) fit.residual.push_back(runner_.measured()[i] - simulated[i]);
    for (const double r : fit.residual) fit.chi2 += r * r;
    fit.bic = fit.chi2;
    fit.converged = true;
    delete cost;
    return fit;
  }
  ceres::Problem problem;
  problem.AddResidualBlock(cost, nullptr, p.data());
  for (std::size_t c = 0; c < coordinates.size(); ++c) {
    problem.SetParameterLowerBound(p.data(), static_cast<int>(c), coordinates[c].low);
    problem.SetParameterUpperBound(p.data(), static_cast<int>(c), coordinates[c].high);
  }
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  solver.max_num_iterations = options.iterations;
  solver.function_tolerance = options.tolerance;
  solver.parameter_tolerance = 1e-7;
  solver.logging_type = ceres::SILENT;
  solver.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  fit.converged = summary.IsSolutionUsable();
  if (!fit.converged) {
    fit.state = start;
    fit.chi2 = fit.bic = std::numeric_limits<double>::infinity();
    return fit;
  }
  // Residual and information at the solution.
  fit.state = cost->unpack(p.data());
  Values residuals(samples + coordinates.size());
  Values jacobian(residuals.size() * coordinates.size());
  double* rows = jacobian.data();
  const double* point = p.data();
  if (!cost->Evaluate(&point, residuals.data(), &rows)) {
    fit.converged = false;
    fit.chi2 = fit.bic = std::numeric_limits<double>::infinity();
    return fit;
  }
  fit.residual.resize(samples);
  for (std::size_t i = 0; i < samples; ++i) {
    fit.residual[i] = -residuals[i];
    fit.chi2 += residuals[i] * residuals[i];
  }
  for (std::size_t c = 0; c < coordinates.size(); ++c)
    fit.penalty += residuals[samples + c] * residuals[samples + c];
  std::size_t own = 0;
  for (const Member& m : fit.state.members) own += m.values.size();
  fit.bic = fit.chi2 + fit.penalty + static_cast<double>(own) * std::log(static_cast<double>(samples));
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const RowMajor> j(jacobian.data(), static_cast<Eigen::Index>(residuals.size()), count);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(count, count);
  information.selfadjointView<Eigen::Lower>().rankUpdate(j.transpose());
  information = information.selfadjointView<Eigen::Lower>();
  fit.covariance = information.ldlt().solve(Eigen::MatrixXd::Identity(count, count));
  return fit;
}

}  // namespace smartmill::discrepancy
