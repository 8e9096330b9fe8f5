#include "smartmill_discrepancy/gap/sparse_columns.h"

#include <algorithm>

namespace smartmill::discrepancy {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

SparseColumns::SparseColumns(const TwinRunner& runner, const SimulatedChannels& base,
                             const std::vector<SimulatedChannels>& moved, const std::vector<double>& step)
    : cols_(static_cast<Index>(moved.size())) {
  AllSpanColumns spans;
  for (std::size_t b = 0; b < runner.spans().size(); ++b) {
    const ChannelSpan& span = runner.spans()[b];
    SpanColumns span_columns{static_cast<Index>(span.offset), static_cast<Index>(span.size), {}, {}};
    for (std::size_t k = 0; k < moved.size(); ++k) {
      if (moved[k][b] != base[b] && *moved[k][b] != *base[b])
        span_columns.columns.push_back(static_cast<Index>(k));
    }
    span_columns.values.resize(span_columns.size, static_cast<Index>(span_columns.columns.size()));
    const Eigen::Map<const VectorXd> from(base[b]->data(), span_columns.size);
    for (Index c = 0; c < span_columns.values.cols(); ++c) {
      const auto k = static_cast<std::size_t>(span_columns.columns[static_cast<std::size_t>(c)]);
      span_columns.values.col(c) =
          (Eigen::Map<const VectorXd>(moved[k][b]->data(), span_columns.size) - from) / step[k];
    }
    spans.push_back(std::move(span_columns));
  }
  spans_ = std::make_shared<const AllSpanColumns>(std::move(spans));
}

bool SparseColumns::allFinite() const {
  return std::all_of(spans_->begin(), spans_->end(),
                     [](const SpanColumns& p) { return p.values.allFinite(); });
}

SparseColumns SparseColumns::lastColumns(Index count) const {
  SparseColumns selected;
  selected.cols_ = count;
  AllSpanColumns spans;
  for (const SpanColumns& p : *spans_) {
    SpanColumns span_columns{p.offset, p.size, {}, {}};
    for (const Index column : p.columns) {
      if (column >= cols_ - count) span_columns.columns.push_back(column - (cols_ - count));
    }
    span_columns.values = p.values.rightCols(static_cast<Index>(span_columns.columns.size()));
    spans.push_back(std::move(span_columns));
  }
  selected.spans_ = std::make_shared<const AllSpanColumns>(std::move(spans));
  return selected;
}

MatrixXd SparseColumns::rows(const std::vector<Index>& samples) const {
  MatrixXd selected_rows = MatrixXd::Zero(static_cast<Index>(samples.size()), cols_);
  Index from = 0;
  for (const SpanColumns& p : *spans_) {
    Index to = from;
    while (to < selected_rows.rows() && samples[static_cast<std::size_t>(to)] < p.offset + p.size) ++to;
    for (std::size_t k = 0; k < p.columns.size(); ++k) {
      const double* const values = p.values.col(static_cast<Index>(k)).data();
      double* const column = selected_rows.col(p.columns[k]).data();
      for (Index i = from; i < to; ++i) column[i] = values[samples[static_cast<std::size_t>(i)] - p.offset];
    }
    from = to;
  }
  return selected_rows;
}

MatrixXd SparseColumns::gram() const {
  MatrixXd sum = MatrixXd::Zero(cols_, cols_);
  for (const SpanColumns& p : *spans_) {
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

MatrixXd SparseColumns::cross(const SparseColumns& other) const {
  MatrixXd sum = MatrixXd::Zero(cols_, other.cols_);
  for (std::size_t b = 0; b < spans_->size(); ++b) {
    const SpanColumns &left = (*spans_)[b], &right = (*other.spans_)[b];
    if (left.columns.empty() || right.columns.empty()) continue;
    const MatrixXd product = left.values.transpose() * right.values;
    for (Index k = 0; k < product.cols(); ++k) {
      for (Index i = 0; i < product.rows(); ++i)
        sum(left.columns[static_cast<std::size_t>(i)], right.columns[static_cast<std::size_t>(k)]) +=
            product(i, k);
    }
  }
  return sum;
}

VectorXd SparseColumns::along(const Eigen::Ref<const VectorXd>& vector) const {
  VectorXd sum = VectorXd::Zero(cols_);
  for (std::size_t b = 0; b < spans_->size(); ++b) sum += along(b, vector);
  return sum;
}

VectorXd SparseColumns::along(std::size_t span, const Eigen::Ref<const VectorXd>& vector) const {
  VectorXd sum = VectorXd::Zero(cols_);
  const SpanColumns& p = (*spans_)[span];
  const auto segment = vector.segment(p.offset, p.size);
  for (std::size_t k = 0; k < p.columns.size(); ++k)
    sum[p.columns[k]] = p.values.col(static_cast<Index>(k)).dot(segment);
  return sum;
}

VectorXd SparseColumns::squares() const {
  VectorXd sum = VectorXd::Zero(cols_);
  for (const SpanColumns& p : *spans_) {
    for (std::size_t k = 0; k < p.columns.size(); ++k)
      sum[p.columns[k]] += p.values.col(static_cast<Index>(k)).squaredNorm();
  }
  return sum;
}

void SparseColumns::addTo(const VectorXd& amplitudes, VectorXd* vector) const {
  for (const SpanColumns& p : *spans_) {
    for (std::size_t k = 0; k < p.columns.size(); ++k)
      vector->segment(p.offset, p.size) += amplitudes[p.columns[k]] * p.values.col(static_cast<Index>(k));
  }
}

}  // namespace smartmill::discrepancy
