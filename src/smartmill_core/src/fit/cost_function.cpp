#include "cost_function.h"

#include <algorithm>

#include <ceres/dynamic_numeric_diff_cost_function.h>

namespace smartmill::fit {
namespace {

using Eigen::Index;

/// Caches the last point with derivatives, since those of the solution are evaluated again after the fit.
class Analytic : public ceres::CostFunction {
 public:
  Analytic(const ScaledResiduals& scaled, Index count) : scaled_(scaled) {
    set_num_residuals(static_cast<int>(count));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(scaled.free().size()));
  }
  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    if (!jacobians || !jacobians[0]) return scaled_.evaluate(x[0], residual, nullptr);
    const std::size_t count = static_cast<std::size_t>(num_residuals()), columns = scaled_.free().size();
    if (x_.empty() || !std::equal(x_.begin(), x_.end(), x[0])) {
      x_.clear();
      residual_.resize(count);
      jacobian_.resize(count * columns);
      if (!scaled_.evaluate(x[0], residual_.data(), jacobian_.data())) return false;
      x_.assign(x[0], x[0] + columns);
    }
    std::copy(residual_.begin(), residual_.end(), residual);
    std::copy(jacobian_.begin(), jacobian_.end(), jacobians[0]);
    return true;
  }

 private:
  const ScaledResiduals& scaled_;
  mutable std::vector<double> x_, residual_, jacobian_;
};

struct Value {
  const ScaledResiduals& scaled;
  bool operator()(double const* const* x, double* residual) const {
    return scaled.evaluate(x[0], residual, nullptr);
  }
};

template <ceres::NumericDiffMethodType METHOD>
ceres::CostFunction* differences(const ScaledResiduals& scaled, Index count) {
  ceres::NumericDiffOptions options;
  options.ridders_relative_initial_step_size = 1e-4;  // a resonance is narrower than Ceres' 1e-2
  auto* function = new ceres::DynamicNumericDiffCostFunction<Value, METHOD>(new Value{scaled},
                                                                            ceres::TAKE_OWNERSHIP, options);
  function->AddParameterBlock(static_cast<int>(scaled.free().size()));
  function->SetNumResiduals(static_cast<int>(count));
  return function;
}

}  // namespace

ScaledResiduals::ScaledResiduals(const Residuals& residuals, const std::vector<Parameter>& parameters)
    : residuals_(residuals), parameters_(parameters) {
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].high > parameters[i].low) free_.push_back(static_cast<Index>(i));
  }
}

Eigen::VectorXd ScaledResiduals::valueOf(const double* x) const {
  Eigen::VectorXd value(static_cast<Index>(parameters_.size()));
  for (Index i = 0; i < value.size(); ++i) value[i] = parameters_[static_cast<std::size_t>(i)].start;
  for (std::size_t k = 0; k < free_.size(); ++k)
    value[free_[k]] = x[k] * parameters_[static_cast<std::size_t>(free_[k])].scale;
  return value;
}

bool ScaledResiduals::evaluate(const double* x, double* residual, double* jacobian) const {
  if (failure_) return false;
  const Index count = residuals_.count(), all = static_cast<Index>(parameters_.size());
  Eigen::VectorXd r(count);
  Eigen::MatrixXd j;
  if (jacobian) j.setZero(count, all);
  try {
    if (!residuals_.evaluate(valueOf(x), &r, jacobian ? &j : nullptr)) return false;
  } catch (...) {  // exceptions must not pass through Ceres
    failure_ = std::current_exception();
    return false;
  }
  if (!r.allFinite()) return false;
  Eigen::Map<Eigen::VectorXd>(residual, count) = r;
  if (!jacobian) return true;
  const auto columns = static_cast<Index>(free_.size());
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::Map<RowMajor> out(jacobian, count, columns);
  for (Index k = 0; k < columns; ++k) {
    const Index i = free_[static_cast<std::size_t>(k)];
    out.col(k) = j.col(i) * parameters_[static_cast<std::size_t>(i)].scale;
  }
  return out.allFinite();
}

ceres::CostFunction* costFunction(const ScaledResiduals& scaled, Index count, Derivatives derivatives) {
  switch (derivatives) {
    case Derivatives::central:
      return differences<ceres::CENTRAL>(scaled, count);
    case Derivatives::ridders:
      return differences<ceres::RIDDERS>(scaled, count);
    case Derivatives::given:
      break;
  }
  return new Analytic(scaled, count);
}

}  // namespace smartmill::fit
