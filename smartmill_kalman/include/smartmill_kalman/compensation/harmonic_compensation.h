#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "smartmill_kalman/compensation/compensation_method.h"
#include "smartmill_kalman/compensation/gain_schedule.h"
#include "smartmill_kalman/filter/harmonic_filter.h"
#include "smartmill_kalman/following/harmonic_mode_follower.h"
#include "smartmill_kalman/following/harmonic_speed_tracker.h"

namespace smartmill::kalman {

class InnovationStatistics;

/// One causal HarmonicFilter per axis, with scheduled gains. Optionally tracks the spindle speed
/// (HarmonicSpeedTracker) or the modes of the sensor (HarmonicModeFollower). Subclasses change how a sample
/// becomes a force and when a block is published.
class HarmonicCompensation : public CompensationMethod {
 public:
  HarmonicCompensation(const CompensationParameters& parameters, ForceOutputs outputs);

  void setSensor(std::size_t axis, const SensorAxis& sensor) override;
  const ModalModel& sensor(std::size_t axis) const override { return sensor_.at(axis).model; }
  void setMemory(const MemorySchedule& memory) override;
  void beginCondition(const CuttingCondition& condition) override;
  bool prepare(const SpindleAngle& spindle, double sample_rate) override;
  void process(const ForceBlock& measured, ForceBlock compensated, CompensationHealth& health) override;
  double speed() const override { return spindle_.speed; }
  void stop() override;
  void reset() override;

 protected:
  /// Force of one sample [N]. A sample that is not a number is replaced by the prediction.
  virtual double step(std::size_t axis, HarmonicFilter& filter, double measured);
  /// Whether the force of an axis depends on the filters of the others.
  virtual bool isCoupled() const { return false; }
  /// Cross-talk of one sample, after the step of all filters; called when isCoupled().
  virtual void couple(const std::vector<HarmonicFilter>&, std::array<double, 3>&) {}
  /// The filters have another design, speed or sensor.
  virtual void onFiltersChanged(const std::vector<HarmonicFilter>&, double /*sample_rate*/) {}
  virtual void publish(const ForceBlock& measured, ForceBlock&& compensated);

  const ForceOutputs& outputs() const { return outputs_; }

 private:
  void design();
  void retune();
  void filterAxes(ForceBlock& block, InnovationStatistics& innovations);
  void filterSamples(ForceBlock& block, InnovationStatistics& innovations);
  bool followModes(double now);
  void restoreModes();

  CompensationParameters parameters_;
  ForceOutputs outputs_;
  std::array<SensorAxis, 3> sensor_, configured_sensor_;  // in use, as set
  bool modes_shifted_ = false;                            // by the mode follower, in this cut
  GainSchedule schedule_;
  int grid_point_ = 0;
  std::vector<HarmonicFilter> filters_;  // of x, y, z; empty: to be designed
  std::optional<CuttingCondition> condition_;
  std::optional<HarmonicSpeedTracker> speed_tracker_;
  std::optional<HarmonicModeFollower> mode_follower_;
  SpindleAngle spindle_;
  double sample_rate_ = 0.0;  // [Hz]
};

}  // namespace smartmill::kalman
