#include "smartmill_discrepancy/gap/repeatability.h"

#include <algorithm>
#include <cmath>

#include "gap/orders.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/data/alignment.h"

namespace smartmill::discrepancy {
namespace {

struct RepeatabilityOptions {
  double min_revolutions = 5.0;  ///< fewer leave too few degrees of freedom for the floor
  /// [1] of the Nyquist frequency: highest order that is removed
  double highest = 0.9;
};

const RepeatabilityOptions LIMITS;

constexpr int MAX_STEPS = 30;        // of conjugate gradients: the columns are nearly orthogonal
constexpr double TOLERANCE = 1e-10;  // of the squares of the first gradient

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

// Squares of the residual of the orders: conjugate gradients on the normal equations (Hestenes & Stiefel
// 1952, CGLS).
// @param lines receives mean and orders
double residualSquares(const OrderBasis& orders, std::size_t count, std::vector<double> residual,
                       std::vector<double>* lines) {
  std::vector<double> s = orders.along(residual, count), p = s;
  double gamma = dot(s, s);
  const double first = gamma;
  lines->assign(s.size(), 0.0);
  for (int step = 0; step < MAX_STEPS && gamma > TOLERANCE * first; ++step) {
    const std::vector<double> q = orders.sumOf(p);
    const double alpha = gamma / dot(q, q);
    for (std::size_t i = 0; i < residual.size(); ++i) residual[i] -= alpha * q[i];
    for (std::size_t i = 0; i < p.size(); ++i) (*lines)[i] += alpha * p[i];
    s = orders.along(residual, count);
    const double next = dot(s, s);
    for (std::size_t i = 0; i < p.size(); ++i) p[i] = s[i] + next / gamma * p[i];
    gamma = next;
  }
  return dot(residual, residual);
}

}  // namespace

std::optional<Repeatability> repeatability(const std::vector<double>& values,
                                           const std::vector<double>& angle) {
  const double revolutions = std::abs(rotationOf(angle)) / units::TWO_PI,
               samples = static_cast<double>(values.size());
  if (values.size() != angle.size() || revolutions < LIMITS.min_revolutions) return {};
  const auto orders =
      static_cast<std::size_t>(std::max(1.0, std::floor(LIMITS.highest * 0.5 * samples / revolutions)));
  const double level = mean(values);
  std::vector<double> about = values;
  for (double& v : about) v -= level;
  Repeatability result;
  result.samples = values.size();
  result.variance = dot(about, about) / samples;
  const double free = samples - 2.0 * static_cast<double>(orders) - 1.0;
  result.floor =
      std::sqrt(residualSquares(OrderBasis(angle), orders, std::move(about), &result.lines) / free);
  result.lines[0] += level;
  return result;
}

std::optional<Repeatability> steadyRepeatability(const TestData& test, const std::vector<double>& values) {
  if (!test.record.has("spindle_angle")) return {};
  const auto from = static_cast<std::ptrdiff_t>(test.steadyBegin());
  const std::vector<double>& angle = test.record.column("spindle_angle");
  return repeatability({values.begin() + from, values.end()}, {angle.begin() + from, angle.end()});
}

}  // namespace smartmill::discrepancy
