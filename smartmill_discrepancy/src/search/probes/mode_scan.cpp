#include "search/probes/mode_scan.h"

#include <algorithm>
#include <cmath>

namespace smartmill::discrepancy {

std::vector<double> bestFrequencies(const Projection& projection, int threads, const ModeColumns& columns,
                                    const ModeScanOptions& options) {
  constexpr std::size_t BATCH = 8;  // frequencies per pass over the derivatives
  std::vector<double> frequencies;
  for (double f = options.low; f < options.high; f *= options.ratio) frequencies.push_back(f);
  std::vector<double> gains(frequencies.size(), 0.0);
  runParallel((frequencies.size() + BATCH - 1) / BATCH, threads, [&](std::size_t batch) {
    const std::size_t first = batch * BATCH, count = std::min(BATCH, frequencies.size() - first);
    const auto from = frequencies.begin() + static_cast<std::ptrdiff_t>(first);
    const Eigen::VectorXd each = projection.roughGains(
        projection.thinned().weighted(columns({from, from + static_cast<std::ptrdiff_t>(count)})),
        options.positive);
    for (std::size_t k = 0; k < count; ++k) gains[first + k] = each[static_cast<Eigen::Index>(k)];
  });
  std::vector<double> best;
  while (best.size() < options.found) {
    const auto top = std::max_element(gains.begin(), gains.end());
    if (top == gains.end() || *top <= 0.0) break;
    const double f = frequencies[static_cast<std::size_t>(top - gains.begin())];
    best.push_back(f);
    for (std::size_t k = 0; k < gains.size(); ++k) {
      if (std::abs(std::log(frequencies[k] / f)) < options.separation) gains[k] = 0.0;
    }
  }
  return best;
}

}  // namespace smartmill::discrepancy
