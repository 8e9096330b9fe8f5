#include "smartmill_hammer/analysis/hits_needed.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::hammer {
namespace {

constexpr double MOST_HITS = 1e9;  // fits in an int

}  // namespace

HitsNeeded hitsNeeded(const FrequencyResponse& frf, double low, double high, double required_std) {
  double variance = 0.0, power = 0.0;
  for (std::size_t k = 0; k < frf.std_dev.size(); ++k) {
    if (frf.frequency[k] < low || frf.frequency[k] > high || !std::isfinite(frf.std_dev[k])) continue;
    variance += frf.std_dev[k] * frf.std_dev[k];
    power += std::norm(frf.value[k]);
  }
  if (!(power > 0.0))
    throw Error("hits needed: no line with a standard deviation between " + shortNumber(low) + " and " +
                shortNumber(high) + " Hz");
  HitsNeeded result;
  result.relative_std = std::sqrt(variance / power);
  result.hits = frf.averages;
  const double needed =
      std::ceil(frf.averages * std::pow(result.relative_std / required_std, 2) * (1.0 - 1e-12));
  result.needed = static_cast<int>(std::clamp(needed, 1.0, MOST_HITS));
  return result;
}

}  // namespace smartmill::hammer
