#include "smartmill_loadmeter/identification/load_test.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/signal/statistics.h"

namespace smartmill::loadmeter {

double resolutionOf(const std::vector<double>& readings, double resolution) {
  std::vector<double> sorted = readings;
  std::sort(sorted.begin(), sorted.end());
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    const double difference = sorted[i] - sorted[i - 1];
    if (difference > 1e-9 * std::abs(sorted[i])) smallest = std::min(smallest, difference);
  }
  return std::isfinite(smallest) ? std::max(smallest, resolution) : resolution;
}

void LoadTest::computeMean(const Spindle& spindle, double step) {
  const double interval = duration / static_cast<double>(voltages.size() - 1);
  voltage = meanVoltage(voltages, interval, timeConstant(spindle.load_meter_bandwidth), step);
}

double LoadTest::variance() const {
  return voltages.size() < 2 ? 0.0 : std::pow(standardDeviation(voltages), 2);
}

// T = V / (K omega): relative errors add up.
double LoadTest::torqueStdAsVoltage() const {
  return std::hypot(voltage.std_dev, voltage.mean * speed_std / speed);
}

}  // namespace smartmill::loadmeter
