#include "smartmill_core/signal/statistics.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

void needValues(const std::vector<double>& values, std::size_t least, const char* what) {
  if (values.size() < least) {
    throw Error(std::string(what) + ": needs " + std::to_string(least) + " value" + (least > 1 ? "s" : "") +
                ", got " + std::to_string(values.size()));
  }
}

}  // namespace

double mean(const std::vector<double>& values) {
  needValues(values, 1, "mean");
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double rms(const std::vector<double>& values) {
  needValues(values, 1, "root mean square");
  return std::sqrt(std::inner_product(values.begin(), values.end(), values.begin(), 0.0) /
                   static_cast<double>(values.size()));
}

double standardDeviation(const std::vector<double>& values) {
  needValues(values, 2, "standard deviation");
  const double centre = mean(values);
  double sum = 0.0;
  for (const double value : values) {
    sum += (value - centre) * (value - centre);
  }
  return std::sqrt(sum / static_cast<double>(values.size() - 1));
}

double median(std::vector<double> values) {
  return percentile(std::move(values), 0.5);
}

double percentile(std::vector<double> values, double share) {
  needValues(values, 1, "percentile");
  if (!(share >= 0.0 && share <= 1.0)) {
    throw Error("percentile: share " + std::to_string(share) + " is outside 0..1");
  }
  const double position = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const auto low = values.begin() + static_cast<std::ptrdiff_t>(below);
  std::nth_element(values.begin(), low, values.end());
  const double rest = position - static_cast<double>(below);
  if (rest == 0.0) {
    return *low;
  }
  return *low + rest * (*std::min_element(low + 1, values.end()) - *low);
}

std::size_t firstNotFinite(const std::vector<double>& values) {
  const auto bad = std::find_if(values.begin(), values.end(), [](double v) { return !std::isfinite(v); });
  return static_cast<std::size_t>(bad - values.begin());
}

std::size_t longestRunAtExtreme(const std::vector<double>& values) {
  needValues(values, 1, "longest run");
  const auto extremes = std::minmax_element(values.begin(), values.end());
  const double low = *extremes.first, high = *extremes.second;
  std::size_t longest = 0, run = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool extreme = values[i] == low || values[i] == high;
    run = !extreme ? 0 : (i > 0 && values[i] == values[i - 1]) ? run + 1 : 1;
    longest = std::max(longest, run);
  }
  return longest;
}

double studentOverNormal(double freedom) {
  const double n = freedom, z = 1.96, z2 = z * z;
  return 1.0 + (z2 + 1.0) / (4.0 * n) + ((5.0 * z2 + 16.0) * z2 + 3.0) / (96.0 * n * n) +
         (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / (384.0 * n * n * n);
}

}  // namespace smartmill
