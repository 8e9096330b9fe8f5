#include "smartmill_discrepancy/search/unparted.h"

#include <cmath>

#include "smartmill_discrepancy/search/standing.h"

namespace smartmill::discrepancy {
namespace {

double entropy(double p) {
  return p > 0.0 && p < 1.0 ? -p * std::log(p) - (1.0 - p) * std::log(1.0 - p) : 0.0;
}

}  // namespace

double sureOf(const Unparted& pair, const CauseOdds& prior) {
  const double rare = 0.5 * std::erfc(Standing::FITTED_BEYOND / std::sqrt(2.0));
  const double odds = std::pow((1.0 - rare) / rare, pair.parted) * prior.of(pair.name) / prior.of(pair.rival);
  return odds / (1.0 + odds);
}

const Unparted* mostTelling(const std::vector<Unparted>& pairs, const std::optional<CauseOdds>& prior) {
  const Unparted* best = nullptr;
  double most = -1.0;
  for (const Unparted& pair : pairs) {
    if (!pair.test) continue;
    if (!prior) return &pair;
    const double a = prior->of(pair.name), b = prior->of(pair.rival);
    double all = a;
    for (const Unparted& other : pairs) all += other.name == pair.name ? prior->of(other.rival) : 0.0;
    const double told = (a + b) / all * entropy(a / (a + b));
    if (told <= most) continue;
    most = told;
    best = &pair;
  }
  return best;
}

}  // namespace smartmill::discrepancy
