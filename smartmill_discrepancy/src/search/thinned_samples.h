#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "smartmill_discrepancy/gap/sparse_columns.h"
#include "smartmill_discrepancy/gap/twin_runner.h"

namespace smartmill::discrepancy {

/// Weighted subset of the samples of a campaign, chosen at random to avoid aliasing.
class ThinnedSamples {
 public:
  explicit ThinnedSamples(const TwinRunner& runner);

  Eigen::VectorXd of(const Eigen::VectorXd& values) const { return weighted(values(rows_)); }
  Eigen::MatrixXd of(const SparseColumns& columns) const { return weighted(columns.rows(rows_)); }
  /// Weights columns given at these samples.
  Eigen::MatrixXd weighted(Eigen::MatrixXd values) const;
  const std::vector<Eigen::Index>& rows() const { return rows_; }

 private:
  std::vector<Eigen::Index> rows_;
  std::vector<double> weights_;
};

}  // namespace smartmill::discrepancy
