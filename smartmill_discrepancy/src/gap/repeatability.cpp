#include "smartmill_discrepancy/gap/repeatability.h"

#include <algorithm>
#include <cmath>

#include "gap/orders.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

constexpr int MOST_STEPS = 30;   // of conjugate gradients: the columns are nearly orthogonal
constexpr double CLOSE = 1e-10;  // of the first gradient's squares
constexpr double HIGHEST = 0.9;  // of half the sample rate, up to which orders count

double turnedOver(const std::vector<double>& angle) {
  double turned = 0.0;
  for (std::size_t i = 1; i < angle.size(); ++i)
    turned += std::remainder(angle[i] - angle[i - 1], units::TWO_PI);
  return std::abs(turned) / units::TWO_PI;
}

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

// Squares that the orders leave: conjugate gradients on the normal equations (Hestenes & Stiefel 1952, CGLS).
// @param lines receives level and orders
double squaresLeft(const Orders& orders, std::size_t count, std::vector<double> left,
                   std::vector<double>* lines) {
  std::vector<double> s = orders.along(left, count), p = s;
  double gamma = dot(s, s);
  const double first = gamma;
  lines->assign(s.size(), 0.0);
  for (int step = 0; step < MOST_STEPS && gamma > CLOSE * first; ++step) {
    const std::vector<double> q = orders.sumOf(p);
    const double alpha = gamma / dot(q, q);
    for (std::size_t i = 0; i < left.size(); ++i) left[i] -= alpha * q[i];
    for (std::size_t i = 0; i < p.size(); ++i) (*lines)[i] += alpha * p[i];
    s = orders.along(left, count);
    const double next = dot(s, s);
    for (std::size_t i = 0; i < p.size(); ++i) p[i] = s[i] + next / gamma * p[i];
    gamma = next;
  }
  return dot(left, left);
}

}  // namespace

std::optional<Repeatability> repeatability(const std::vector<double>& values,
                                           const std::vector<double>& angle) {
  const double turns = turnedOver(angle), samples = static_cast<double>(values.size());
  if (values.size() != angle.size() || turns < LEAST_TURNS) return {};
  const auto orders = static_cast<std::size_t>(std::max(1.0, std::floor(HIGHEST * 0.5 * samples / turns)));
  const double level = mean(values);
  std::vector<double> about = values;
  for (double& v : about) v -= level;
  Repeatability result;
  result.samples = values.size();
  result.variance = dot(about, about) / samples;
  const double free = samples - 2.0 * static_cast<double>(orders) - 1.0;
  result.floor = std::sqrt(squaresLeft(Orders(angle), orders, std::move(about), &result.lines) / free);
  result.lines[0] += level;
  return result;
}

}  // namespace smartmill::discrepancy
