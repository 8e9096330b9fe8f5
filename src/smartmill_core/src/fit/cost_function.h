#pragma once

#include <exception>
#include <vector>

#include <ceres/cost_function.h>
#include <Eigen/Core>

#include "smartmill_core/fit/least_squares.h"

namespace smartmill::fit {

/// Residuals for Ceres, over the free unknowns in units of their scale.
class ScaledResiduals {
 public:
  ScaledResiduals(const Residuals& residuals, const std::vector<Parameter>& parameters);

  const std::vector<Eigen::Index>& free() const { return free_; }
  Eigen::VectorXd valueOf(const double* x) const;
  /// @param jacobian row by row over the free unknowns, or nullptr. @return false also when a number is not
  /// finite or evaluate() has thrown; then failure() has the exception
  bool evaluate(const double* x, double* residual, double* jacobian) const;
  const std::exception_ptr& failure() const { return failure_; }

 private:
  const Residuals& residuals_;
  const std::vector<Parameter>& parameters_;
  std::vector<Eigen::Index> free_;
  mutable std::exception_ptr failure_;
};

enum class Derivatives { given, central, ridders };

/// Ceres takes ownership.
ceres::CostFunction* costFunction(const ScaledResiduals& scaled, Eigen::Index count, Derivatives derivatives);

}  // namespace smartmill::fit
