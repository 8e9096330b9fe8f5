#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_hammer/sequence/hammer_parameters.h"

namespace smartmill::hammer {

/// Mean of the displacement sensor's voltage.
struct MeanVoltage {
  double volt = 0.0;  ///< [V]
  double std = 0.0;   ///< [V] standard deviation of the mean
};

/// Averages consecutive finite samples; a lost or NaN sample starts the average again.
class VoltageAverage {
 public:
  explicit VoltageAverage(const HammerParameters& parameters) : parameters_(parameters) {}

  /// @param from [s] first sample averaged
  void start(double from);
  /// @param rate [Hz] @return the mean, once enough samples have arrived
  std::optional<MeanVoltage> add(double time, std::uint64_t index, double rate, double volt);
  /// Why too many averages have been started again since reset(); empty: they have not.
  const std::string& fault() const { return fault_; }
  void reset();

 private:
  const HammerParameters& parameters_;
  double from_ = 0.0;
  std::vector<double> volts_;
  std::uint64_t index_ = 0;
  int restarts_ = 0;
  std::string fault_;
};

}  // namespace smartmill::hammer
