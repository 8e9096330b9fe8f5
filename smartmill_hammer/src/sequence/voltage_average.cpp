#include "voltage_average.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/signal/same_time.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill::hammer {

void VoltageAverage::start(double from) {
  from_ = from;
  volts_.clear();
}

void VoltageAverage::reset() {
  restarts_ = 0;
  fault_.clear();
}

std::optional<MeanVoltage> VoltageAverage::add(double time, std::uint64_t index, double rate, double volt) {
  if (time < from_ - SAME_TIME) return std::nullopt;
  const bool lost = !volts_.empty() && index != index_ + 1;
  index_ = index;
  if (lost || !std::isfinite(volt)) {
    volts_.clear();
    if (++restarts_ > parameters_.average_restarts)
      fault_ = lost ? "daq/hammer loses samples"
                    : "daq/hammer: sample " + std::to_string(index) + " of gap is not a number";
    return std::nullopt;
  }
  volts_.push_back(volt);
  if (volts_.size() < static_cast<std::size_t>(std::max(2L, std::lround(parameters_.averaging_time * rate))))
    return std::nullopt;
  const std::vector<double> all = std::exchange(volts_, {});
  return MeanVoltage{mean(all), standardDeviation(all) / std::sqrt(static_cast<double>(all.size()))};
}

}  // namespace smartmill::hammer
