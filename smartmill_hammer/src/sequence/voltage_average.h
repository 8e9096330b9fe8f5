#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace smartmill::hammer {

/// Mean of the displacement sensor's voltage.
struct MeanVoltage {
  double volt = 0.0;  ///< [V]
  double std = 0.0;   ///< [V] standard deviation of the mean
};

/// Averages consecutive finite samples; a lost or NaN sample starts the average again.
class VoltageAverage {
 public:
  /// @param averaging_time [s]
  explicit VoltageAverage(double averaging_time) : averaging_time_(averaging_time) {}

  /// @param from [s] first sample averaged
  void start(double from);
  /// @param rate [Hz] @return the mean, once enough samples have arrived
  std::optional<MeanVoltage> add(double time, std::uint64_t index, double rate, double volt);
  /// Why too many averages have been started again since reset(); empty: they have not.
  const std::string& fault() const { return fault_; }
  void reset();

 private:
  double averaging_time_;
  double from_ = 0.0;
  std::vector<double> volts_;
  std::uint64_t index_ = 0;
  int restarts_ = 0;
  std::string fault_;
};

}  // namespace smartmill::hammer
