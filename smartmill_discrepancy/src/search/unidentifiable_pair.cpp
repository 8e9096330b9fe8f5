#include "smartmill_discrepancy/search/unidentifiable_pair.h"

#include <cmath>

#include "smartmill_core/math/normal.h"
#include "smartmill_discrepancy/search/validation.h"

namespace smartmill::discrepancy {
namespace {

double entropy(double p) {
  return p > 0.0 && p < 1.0 ? -p * std::log(p) - (1.0 - p) * std::log(1.0 - p) : 0.0;
}

}  // namespace

double nameProbability(const UnidentifiablePair& pair, const CauseOdds& prior) {
  const double tail = normalCdf(-ValidationResult::FITTED_MARGIN);
  const double odds =
      std::pow((1.0 - tail) / tail, pair.separation) * prior.of(pair.name) / prior.of(pair.alternative);
  return odds / (1.0 + odds);
}

const UnidentifiablePair* mostInformative(const std::vector<UnidentifiablePair>& pairs,
                                          const std::optional<CauseOdds>& prior) {
  const UnidentifiablePair* best = nullptr;
  double most = -1.0;
  for (const UnidentifiablePair& pair : pairs) {
    if (!pair.test) continue;
    if (!prior) return &pair;
    const double a = prior->of(pair.name), b = prior->of(pair.alternative);
    double all = a;
    for (const UnidentifiablePair& other : pairs)
      all += other.name == pair.name ? prior->of(other.alternative) : 0.0;
    const double information = (a + b) / all * entropy(a / (a + b));
    if (information <= most) continue;
    most = information;
    best = &pair;
  }
  return best;
}

}  // namespace smartmill::discrepancy
