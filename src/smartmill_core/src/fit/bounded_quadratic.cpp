#include "smartmill_core/fit/bounded_quadratic.h"

#include <cmath>
#include <vector>

#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::fit {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// Minimum over the free elements with the others fixed.
VectorXd freeMinimum(const Eigen::MatrixXd& h, const VectorXd& b, const VectorXd& x,
                     const std::vector<Index>& free) {
  const Eigen::Map<const Eigen::Matrix<Index, Eigen::Dynamic, 1>> at(free.data(),
                                                                     static_cast<Index>(free.size()));
  VectorXd staying = x;
  staying(at).setZero();
  const Eigen::MatrixXd of_free = h(at, at);
  const VectorXd right = (b - h * staying)(at);
  return linear::solveSymmetric(of_free, right);
}

}  // namespace

VectorXd minimiseWithin(const Eigen::MatrixXd& h, const VectorXd& b, const VectorXd& low,
                        const VectorXd& high) {
  const Index n = b.size();
  VectorXd x = linear::solveSymmetric(h, b).cwiseMax(low).cwiseMin(high);
  std::vector<bool> held(static_cast<std::size_t>(n));
  for (Index i = 0; i < n; ++i) held[static_cast<std::size_t>(i)] = x[i] <= low[i] || x[i] >= high[i];
  // Each active set is visited at most once, since the value decreases from one to the next; the limit guards
  // against rounding.
  for (Index round = 0; round < 20 * (n + 1); ++round) {
    std::vector<Index> free;
    for (Index i = 0; i < n; ++i) {
      if (!held[static_cast<std::size_t>(i)]) free.push_back(i);
    }
    const VectorXd to = freeMinimum(h, b, x, free);
    double share = 1.0;  // feasible share of the step
    Index stops = -1;
    for (std::size_t k = 0; k < free.size(); ++k) {
      const Index i = free[k];
      const double by = to[static_cast<Index>(k)] - x[i];
      const double room = by > 0.0 ? high[i] - x[i] : low[i] - x[i];
      if (by == 0.0 || room / by >= share) continue;
      share = room / by;
      stops = i;
    }
    for (std::size_t k = 0; k < free.size(); ++k)
      x[free[k]] += share * (to[static_cast<Index>(k)] - x[free[k]]);
    if (stops >= 0) {
      x[stops] = x[stops] - low[stops] < high[stops] - x[stops] ? low[stops] : high[stops];
      held[static_cast<std::size_t>(stops)] = true;
      continue;
    }
    // The element with the largest gain from leaving its bound.
    const VectorXd slope = b - h * x;
    Index leaves = -1;
    double most = 0.0;
    for (Index i = 0; i < n; ++i) {
      if (!held[static_cast<std::size_t>(i)] || low[i] == high[i]) continue;
      const double inward = x[i] <= low[i] ? slope[i] : -slope[i], gain = inward / std::sqrt(h(i, i));
      if (gain <= most) continue;
      most = gain;
      leaves = i;
    }
    const double rounding = 1e-12 * std::sqrt(std::abs(b.dot(x)));
    if (leaves < 0 || most <= rounding) break;
    held[static_cast<std::size_t>(leaves)] = false;
  }
  return x;
}

}  // namespace smartmill::fit
