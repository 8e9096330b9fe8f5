#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "smartmill_kalman/compensation/compensation_method.h"
#include "smartmill_kalman/filter/delay_filter.h"

namespace smartmill::kalman {

/// One causal DelayFilter per axis, with gains scheduled over the period in half samples.
class DelayCompensation : public CompensationMethod {
 public:
  DelayCompensation(const CompensationParameters& parameters, ForceOutputs outputs);

  void setSensor(std::size_t axis, const SensorAxis& sensor) override;
  const ModalModel& sensor(std::size_t axis) const override { return sensor_.at(axis).model; }
  void beginCondition(const CuttingCondition&) override { stop(); }
  bool prepare(const SpindleAngle& spindle, double sample_rate) override;
  void process(const ForceBlock& measured, ForceBlock compensated, CompensationHealth& health) override;
  double speed() const override { return speed_; }
  void stop() override { filters_.clear(); }
  void reset() override { stop(); }

 private:
  void design(int half_samples, double sample_rate);

  CompensationParameters parameters_;
  ForceOutputs outputs_;
  std::array<SensorAxis, 3> sensor_;
  std::map<std::pair<std::size_t, int>, DelayFilter> designs_;  // by axis and half samples of the period
  std::vector<DelayFilter> filters_;                            // of x, y, z; empty: to be designed
  int half_samples_ = 0;                                        // of the gains
  double speed_ = 0.0, sample_rate_ = 0.0;                      // [rad/s], [Hz]
};

}  // namespace smartmill::kalman
