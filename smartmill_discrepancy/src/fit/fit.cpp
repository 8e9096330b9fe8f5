#include "smartmill_discrepancy/fit/fit.h"

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
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Share of a coordinate's step: a tangent that is a little curved would tell effects apart from nominal
// values that do exactly the same.
constexpr double TANGENT = 0.02;

/// Cost of a campaign for Ceres: (measured - simulated) over noise, then the priors. The residuals of the
/// records, of which there are some 1e5, are handed on rotated into as many as there are coordinates, which
/// leaves cost, gradient and normal equations as they are.
class CampaignCost : public ceres::CostFunction {
 public:
  CampaignCost(const Fitter& fitter, const FitState& start, const NominalTangents* frozen,
               const FitOptions& options)
      : fitter_(fitter), start_(start), frozen_(frozen), prior_root_(std::sqrt(options.prior_weight)) {
    if (options.nominal_free) coordinates_ = fitter.freedom().coordinates();
    nominal_ = coordinates_.size();
    for (const Member& m : start.members)
      coordinates_.insert(coordinates_.end(), m.hypothesis->coordinates.begin(),
                          m.hypothesis->coordinates.end());
    set_num_residuals(static_cast<int>(2 * coordinates_.size() + 1));
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

  /// Residuals of the records and, where asked, the normal equations without priors.
  /// @return false at a point that the twin refuses or where it gives no numbers
  bool linearise(const double* p, VectorXd* residual, MatrixXd* information, VectorXd* gradient) const {
    const std::size_t count = coordinates_.size();
    const auto samples = static_cast<Index>(fitter_.runner().size());
    const Values now(p, p + count);
    const std::size_t first = frozen_ ? nominal_ : 0;
    std::vector<MachineModel> models;
    Values step(count, 0.0);
    const bool known = now == last_;
    if (!known) models.push_back(modelAt(now));
    for (std::size_t c = first; c < count && information; ++c) {
      const Coordinate& k = coordinates_[c];
      step[c] = TANGENT * (now[c] + k.step > k.high ? -k.step : k.step);
      Values moved = now;
      moved[c] += step[c];
      models.push_back(modelAt(moved));
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
    const auto asVector = [&](const Values& v) { return Eigen::Map<const VectorXd>(v.data(), samples); };
    *residual = asVector(last_simulated_) - asVector(fitter_.runner().measured());
    if (frozen_ && nominal_ > 0) {
      VectorXd shift(static_cast<Index>(nominal_));
      for (std::size_t c = 0; c < nominal_; ++c) shift[static_cast<Index>(c)] = now[c] - frozen_->at[c];
      residual->noalias() += frozen_->columns * shift;
    }
    if (!residual->allFinite()) return false;
    if (!information) return true;
    const auto all = static_cast<Index>(count), fixed = static_cast<Index>(first), moving = all - fixed;
    MatrixXd own(samples, moving);
    for (Index k = 0; k < moving; ++k) {
      own.col(k) = (asVector(simulated[static_cast<std::size_t>(k)]) - asVector(last_simulated_)) /
                   step[first + static_cast<std::size_t>(k)];
    }
    if (!own.allFinite()) return false;
    information->setZero(all, all);
    gradient->resize(all);
    gradient->tail(moving).noalias() = own.transpose() * *residual;
    information->bottomRightCorner(moving, moving).noalias() = own.transpose() * own;
    if (fixed > 0) {
      if (frozen_information_.size() == 0)
        frozen_information_.noalias() = frozen_->columns.transpose() * frozen_->columns;
      information->topLeftCorner(fixed, fixed) = frozen_information_;
      information->topRightCorner(fixed, moving).noalias() = frozen_->columns.transpose() * own;
      information->bottomLeftCorner(moving, fixed) = information->topRightCorner(fixed, moving).transpose();
      gradient->head(fixed).noalias() = frozen_->columns.transpose() * *residual;
    }
    return true;
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const double* p = parameters[0];
    const auto count = static_cast<Index>(coordinates_.size());
    const bool tangents = jacobians && jacobians[0];
    VectorXd residual, gradient;
    MatrixXd information;
    if (!linearise(p, &residual, tangents ? &information : nullptr, &gradient)) return false;
    Eigen::Map<VectorXd> r(residuals, 2 * count + 1);
    r.setZero();
    const double squares = residual.squaredNorm();
    r[count] = std::sqrt(squares);
    for (Index c = 0; c < count; ++c) {
      const Coordinate& k = coordinates_[static_cast<std::size_t>(c)];
      r[count + 1 + c] = prior_root_ * (p[c] - k.null) / k.prior_std;
    }
    if (!tangents) return true;
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    Eigen::Map<RowMajor> j(jacobians[0], 2 * count + 1, count);
    j.setZero();
    // information = R' R with R from P' L D L' P, the residual's share along the tangents R'^-1 gradient.
    const Eigen::LDLT<MatrixXd> factors(information);
    const VectorXd root = factors.vectorD().cwiseMax(0.0).cwiseSqrt();
    MatrixXd rotated = factors.transpositionsP() * MatrixXd::Identity(count, count);
    rotated = factors.matrixU() * rotated;
    j.topRows(count) = root.asDiagonal() * rotated;
    VectorXd along = factors.transpositionsP() * gradient;
    factors.matrixL().solveInPlace(along);
    for (Index c = 0; c < count; ++c) {
      if (root[c] > 1e-12 * root.maxCoeff() && root[c] > 0.0) r[c] = along[c] / root[c];
    }
    r[count] = std::sqrt(std::max(squares - r.head(count).squaredNorm(), 0.0));
    for (Index c = 0; c < count; ++c)
      j(count + 1 + c, c) = prior_root_ / coordinates_[static_cast<std::size_t>(c)].prior_std;
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
  double prior_root_;
  std::size_t nominal_;
  std::vector<Coordinate> coordinates_;
  mutable Values last_, last_simulated_;
  mutable MatrixXd frozen_information_;
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
    moved.nominal[c] += TANGENT * coordinates[c].step;
    models.push_back(model(moved));
  }
  const std::vector<Values> simulated = runner_.simulate(models);
  NominalTangents tangents{state.nominal, Eigen::MatrixXd(static_cast<Eigen::Index>(runner_.size()),
                                                          static_cast<Eigen::Index>(coordinates.size()))};
  for (std::size_t c = 0; c < coordinates.size(); ++c) {
    for (std::size_t i = 0; i < runner_.size(); ++i) {
      tangents.columns(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(c)) =
          (simulated[c + 1][i] - simulated[0][i]) / (TANGENT * coordinates[c].step);
    }
  }
  return tangents;
}

Fit Fitter::fit(const FitState& start, const NominalTangents* frozen, const FitOptions& options) const {
  auto* cost = new CampaignCost(*this, start, frozen, options);  // owned by the problem
  const std::vector<Coordinate> coordinates = cost->coordinates();
  Values p = cost->pack(start);
  for (std::size_t c = 0; c < coordinates.size(); ++c)
    p[c] = std::clamp(p[c], coordinates[c].low, coordinates[c].high);
  Fit fit;
  const auto count = static_cast<Index>(coordinates.size());
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
  // Damped steps first, which cross what is curved; then undamped ones: an effect beside the nominal value
  // that it resembles leaves a narrow valley, in which damping would creep.
  ceres::Solver::Summary summary;
  for (const double radius : {1e4, 1e10}) {
    solver.initial_trust_region_radius = radius;
    ceres::Solve(solver, &problem, &summary);
    // A step that gains less than the tolerance is not taken: near the noise only the excess over it counts.
    const double excess = std::max(summary.final_cost - 0.5 * static_cast<double>(samples), 10.0);
    solver.function_tolerance = options.tolerance * std::min(excess / summary.final_cost, 1.0);
  }
  fit.converged = summary.IsSolutionUsable();
  if (!fit.converged) {
    fit.state = start;
    fit.chi2 = fit.bic = std::numeric_limits<double>::infinity();
    return fit;
  }
  // Residual and information at the solution.
  fit.state = cost->unpack(p.data());
  VectorXd residual, gradient;
  MatrixXd information;
  if (!cost->linearise(p.data(), &residual, &information, &gradient)) {
    fit.converged = false;
    fit.chi2 = fit.bic = std::numeric_limits<double>::infinity();
    return fit;
  }
  fit.chi2 = residual.squaredNorm();
  residual = -residual;
  fit.residual.assign(residual.data(), residual.data() + residual.size());
  for (Index c = 0; c < count; ++c) {
    const Coordinate& k = coordinates[static_cast<std::size_t>(c)];
    const double precision = options.prior_weight / (k.prior_std * k.prior_std);
    fit.penalty += precision * std::pow(p[static_cast<std::size_t>(c)] - k.null, 2);
    information(c, c) += precision;
  }
  std::size_t own = 0;
  for (const Member& m : fit.state.members) own += m.values.size();
  fit.bic = fit.chi2 + fit.penalty + static_cast<double>(own) * std::log(static_cast<double>(samples));
  fit.covariance = information.ldlt().solve(MatrixXd::Identity(count, count));
  return fit;
}

}  // namespace smartmill::discrepancy
