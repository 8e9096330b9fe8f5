#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "smartmill_discrepancy/gap/twin_runner.h"

namespace smartmill::discrepancy {

/// Columns over a campaign in the layout of a runner's vectors. Most columns are zero in most spans: a mode
/// of the sensor's x axis acts on fx only. Products use the spans in which both factors are nonzero.
class SparseColumns {
 public:
  SparseColumns() = default;
  /// Columns (moved - base) / step.
  SparseColumns(const TwinRunner& runner, const SimulatedChannels& base,
                const std::vector<SimulatedChannels>& moved, const std::vector<double>& step);

  Eigen::Index cols() const { return cols_; }
  bool allFinite() const;
  /// The last columns.
  SparseColumns lastColumns(Eigen::Index count) const;

  /// The rows of some samples, in ascending order.
  Eigen::MatrixXd rows(const std::vector<Eigen::Index>& samples) const;

  /// this' * this, this' * other, this' * vector.
  Eigen::MatrixXd gram() const;
  Eigen::MatrixXd cross(const SparseColumns& other) const;
  Eigen::VectorXd along(const Eigen::Ref<const Eigen::VectorXd>& vector) const;
  /// Contribution of one span to this' * vector.
  Eigen::VectorXd along(std::size_t span, const Eigen::Ref<const Eigen::VectorXd>& vector) const;
  /// Squared length of each column.
  Eigen::VectorXd squares() const;
  /// vector += this * amplitudes
  void addTo(const Eigen::VectorXd& amplitudes, Eigen::VectorXd* vector) const;

 private:
  struct SpanColumns {
    Eigen::Index offset = 0, size = 0;
    std::vector<Eigen::Index> columns;  // nonzero in this span
    Eigen::MatrixXd values;
  };
  using AllSpanColumns = std::vector<SpanColumns>;  // one per span
  Eigen::Index cols_ = 0;
  std::shared_ptr<const AllSpanColumns> spans_ =
      std::make_shared<const AllSpanColumns>();  // shared by copies
};

}  // namespace smartmill::discrepancy
