#include "smartmill_discrepancy/gap/block_columns.h"

#include <algorithm>

namespace smartmill::discrepancy {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

BlockColumns::BlockColumns(const TwinRunner& runner, const SimulatedBlocks& base,
                           const std::vector<SimulatedBlocks>& moved, const std::vector<double>& step)
    : cols_(static_cast<Index>(moved.size())) {
  Parts parts;
  for (std::size_t b = 0; b < runner.blocks().size(); ++b) {
    const Block& block = runner.blocks()[b];
    Part part{static_cast<Index>(block.offset), static_cast<Index>(block.size), {}, {}};
    for (std::size_t k = 0; k < moved.size(); ++k) {
      if (moved[k][b] != base[b] && *moved[k][b] != *base[b]) part.columns.push_back(static_cast<Index>(k));
    }
    part.values.resize(part.size, static_cast<Index>(part.columns.size()));
    const Eigen::Map<const VectorXd> from(base[b]->data(), part.size);
    for (Index c = 0; c < part.values.cols(); ++c) {
      const auto k = static_cast<std::size_t>(part.columns[static_cast<std::size_t>(c)]);
      part.values.col(c) = (Eigen::Map<const VectorXd>(moved[k][b]->data(), part.size) - from) / step[k];
    }
    parts.push_back(std::move(part));
  }
  parts_ = std::make_shared<const Parts>(std::move(parts));
}

BlockColumns::BlockColumns(const TwinRunner& runner, const std::vector<std::vector<double>>& columns)
    : cols_(static_cast<Index>(columns.size())) {
  Parts parts;
  for (const Block& block : runner.blocks()) {
    Part part{static_cast<Index>(block.offset), static_cast<Index>(block.size), {}, {}};
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const auto begin = columns[k].begin() + static_cast<std::ptrdiff_t>(block.offset);
      if (std::any_of(begin, begin + static_cast<std::ptrdiff_t>(block.size),
                      [](double v) { return v != 0.0; }))
        part.columns.push_back(static_cast<Index>(k));
    }
    part.values.resize(part.size, static_cast<Index>(part.columns.size()));
    for (Index c = 0; c < part.values.cols(); ++c) {
      const std::vector<double>& column =
          columns[static_cast<std::size_t>(part.columns[static_cast<std::size_t>(c)])];
      part.values.col(c) = Eigen::Map<const VectorXd>(column.data() + block.offset, part.size);
    }
    parts.push_back(std::move(part));
  }
  parts_ = std::make_shared<const Parts>(std::move(parts));
}

bool BlockColumns::allFinite() const {
  return std::all_of(parts_->begin(), parts_->end(), [](const Part& p) { return p.values.allFinite(); });
}

BlockColumns BlockColumns::right(Index count) const {
  BlockColumns few;
  few.cols_ = count;
  Parts parts;
  for (const Part& p : *parts_) {
    Part part{p.offset, p.size, {}, {}};
    for (const Index column : p.columns) {
      if (column >= cols_ - count) part.columns.push_back(column - (cols_ - count));
    }
    part.values = p.values.rightCols(static_cast<Index>(part.columns.size()));
    parts.push_back(std::move(part));
  }
  few.parts_ = std::make_shared<const Parts>(std::move(parts));
  return few;
}

MatrixXd BlockColumns::rows(const std::vector<Index>& samples) const {
  MatrixXd some = MatrixXd::Zero(static_cast<Index>(samples.size()), cols_);
  Index from = 0;
  for (const Part& p : *parts_) {
    Index to = from;
    while (to < some.rows() && samples[static_cast<std::size_t>(to)] < p.offset + p.size) ++to;
    for (std::size_t k = 0; k < p.columns.size(); ++k) {
      const double* const values = p.values.col(static_cast<Index>(k)).data();
      double* const column = some.col(p.columns[k]).data();
      for (Index i = from; i < to; ++i) column[i] = values[samples[static_cast<std::size_t>(i)] - p.offset];
    }
    from = to;
  }
  return some;
}

MatrixXd BlockColumns::gram() const {
  MatrixXd sum = MatrixXd::Zero(cols_, cols_);
  for (const Part& p : *parts_) {
    if (p.columns.empty()) continue;
    MatrixXd product = MatrixXd::Zero(p.values.cols(), p.values.cols());
    product.selfadjointView<Eigen::Lower>().rankUpdate(p.values.transpose());
    for (Index k = 0; k < product.cols(); ++k) {
      for (Index i = 0; i < product.rows(); ++i)
        sum(p.columns[static_cast<std::size_t>(i)], p.columns[static_cast<std::size_t>(k)]) +=
            product(std::max(i, k), std::min(i, k));
    }
  }
  return sum;
}

MatrixXd BlockColumns::cross(const BlockColumns& other) const {
  MatrixXd sum = MatrixXd::Zero(cols_, other.cols_);
  for (std::size_t b = 0; b < parts_->size(); ++b) {
    const Part &mine = (*parts_)[b], &its = (*other.parts_)[b];
    if (mine.columns.empty() || its.columns.empty()) continue;
    const MatrixXd product = mine.values.transpose() * its.values;
    for (Index k = 0; k < product.cols(); ++k) {
      for (Index i = 0; i < product.rows(); ++i)
        sum(mine.columns[static_cast<std::size_t>(i)], its.columns[static_cast<std::size_t>(k)]) +=
            product(i, k);
    }
  }
  return sum;
}

VectorXd BlockColumns::along(const Eigen::Ref<const VectorXd>& vector) const {
  VectorXd sum = VectorXd::Zero(cols_);
  for (std::size_t b = 0; b < parts_->size(); ++b) sum += along(b, vector);
  return sum;
}

VectorXd BlockColumns::along(std::size_t block, const Eigen::Ref<const VectorXd>& vector) const {
  VectorXd sum = VectorXd::Zero(cols_);
  const Part& p = (*parts_)[block];
  const auto segment = vector.segment(p.offset, p.size);
  for (std::size_t k = 0; k < p.columns.size(); ++k)
    sum[p.columns[k]] = p.values.col(static_cast<Index>(k)).dot(segment);
  return sum;
}

VectorXd BlockColumns::squares() const {
  VectorXd sum = VectorXd::Zero(cols_);
  for (const Part& p : *parts_) {
    for (std::size_t k = 0; k < p.columns.size(); ++k)
      sum[p.columns[k]] += p.values.col(static_cast<Index>(k)).squaredNorm();
  }
  return sum;
}

void BlockColumns::addTo(const VectorXd& amplitudes, VectorXd* vector) const {
  for (const Part& p : *parts_) {
    for (std::size_t k = 0; k < p.columns.size(); ++k)
      vector->segment(p.offset, p.size) += amplitudes[p.columns[k]] * p.values.col(static_cast<Index>(k));
  }
}

}  // namespace smartmill::discrepancy
