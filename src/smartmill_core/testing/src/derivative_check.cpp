#include "smartmill_core/testing/derivative_check.h"

#include <cmath>
#include <memory>

#include "fit/cost_function.h"
#include "smartmill_core/error.h"

namespace smartmill::fit {

DerivativeGap checkDerivatives(const Residuals& residuals, const Eigen::VectorXd& at) {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const std::vector<Parameter> parameters(static_cast<std::size_t>(at.size()));
  const ScaledResiduals scaled(residuals, parameters);
  const Eigen::Index count = residuals.count();
  Eigen::VectorXd residual(count);
  RowMajor numeric(count, at.size());
  Eigen::MatrixXd given = Eigen::MatrixXd::Zero(count, at.size());
  const double* blocks[] = {at.data()};
  double* jacobians[] = {numeric.data()};
  const std::unique_ptr<ceres::CostFunction> differences(costFunction(scaled, count, Derivatives::ridders));
  const bool differenced = differences->Evaluate(blocks, residual.data(), jacobians);
  if (scaled.failure()) std::rethrow_exception(scaled.failure());
  if (!differenced || !residuals.evaluate(at, &residual, &given))
    throw Error("derivative check: residuals are undefined at the point or near it");
  DerivativeGap worst;
  for (Eigen::Index c = 0; c < at.size(); ++c) {
    const double size = numeric.col(c).cwiseAbs().maxCoeff();
    for (Eigen::Index r = 0; r < count; ++r) {
      const double gap = std::abs(given(r, c) - numeric(r, c)) / (size > 0.0 ? size : 1.0);
      if (gap > worst.relative || !std::isfinite(gap)) worst = {gap, r, c, given(r, c), numeric(r, c)};
      if (!std::isfinite(gap)) return worst;
    }
  }
  return worst;
}

}  // namespace smartmill::fit
