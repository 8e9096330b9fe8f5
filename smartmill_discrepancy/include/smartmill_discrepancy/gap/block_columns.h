#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "smartmill_discrepancy/gap/twin_runner.h"

namespace smartmill::discrepancy {

/// Columns over a campaign, laid out as a runner's vectors, of which most are zero in most blocks: a mode of
/// the sensor's x axis shows in fx only. Products go over the blocks in which both sides are.
class BlockColumns {
 public:
  BlockColumns() = default;
  /// Columns (moved - base) / step.
  BlockColumns(const TwinRunner& runner, const SimulatedBlocks& base,
               const std::vector<SimulatedBlocks>& moved, const std::vector<double>& step);
  /// Columns as they are.
  BlockColumns(const TwinRunner& runner, const std::vector<std::vector<double>>& columns);

  Eigen::Index cols() const { return cols_; }
  bool allFinite() const;
  /// The last columns.
  BlockColumns right(Eigen::Index count) const;

  /// Some of the samples, in rising order.
  Eigen::MatrixXd rows(const std::vector<Eigen::Index>& samples) const;

  /// this' * this, this' * other, this' * vector.
  Eigen::MatrixXd gram() const;
  Eigen::MatrixXd cross(const BlockColumns& other) const;
  Eigen::VectorXd along(const Eigen::Ref<const Eigen::VectorXd>& vector) const;
  /// What one block gives to this' * vector.
  Eigen::VectorXd along(std::size_t block, const Eigen::Ref<const Eigen::VectorXd>& vector) const;
  /// Squared length of each column.
  Eigen::VectorXd squares() const;
  /// vector += this * amplitudes
  void addTo(const Eigen::VectorXd& amplitudes, Eigen::VectorXd* vector) const;

 private:
  struct Part {
    Eigen::Index offset = 0, size = 0;
    std::vector<Eigen::Index> columns;  // that are not zero here
    Eigen::MatrixXd values;
  };
  using Parts = std::vector<Part>;  // of each block
  Eigen::Index cols_ = 0;
  std::shared_ptr<const Parts> parts_ = std::make_shared<const Parts>();  // copies share them
};

}  // namespace smartmill::discrepancy
