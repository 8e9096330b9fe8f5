#include <algorithm>
#include <cmath>

#include "sequence/steps/steps.h"

namespace smartmill::hammer {
namespace {

/// Begins with the voltage of the flank that faces the sensor. If the flanks measured so far permit too short
/// an approach, two more angles to either side are measured, then the first once more.
class MeasureFlanks : public SequenceStep {
 public:
  using SequenceStep::SequenceStep;

  StepOutcome begin(double now) override {
    measurement_.report("calibrating the displacement sensor", surveyed_ ? 0.58 : 0.55);
    return measureVoltageAfter(now, measurement_.parameters.settle_time);
  }

  StepOutcome motionDone(double now) override {
    if (!offsets_.empty()) return measureVoltageAfter(now, measurement_.parameters.settle_time);
    return begin(now);
  }

  StepOutcome voltageMeasured(double now, const MeanVoltage& voltage) override {
    const std::size_t along = measurement_.paths.along();
    const double rotation = measurement_.rotationFromFlute(along);
    if (!offsets_.empty()) {
      measurement_.approach.addMeasurement(rotation + offsets_.back(), voltage.volt, moved(along));
      offsets_.pop_back();
      return orient(now);
    }
    measurement_.flank_volt = voltage.volt;
    measurement_.approach.addMeasurement(rotation, voltage.volt, moved(along));
    if (surveyed_ || !approachIsTooShort(voltage.volt)) return StepOutcome::done();
    surveyed_ = true;
    const double face = measurement_.parameters.sensor_face;
    const double flank_step = 0.5 * std::asin(std::min(0.9, 0.5 * face / measurement_.tool.radius()));
    offsets_ = {flank_step, -flank_step};
    measurement_.report("measuring the flanks that the sensor's face will meet", 0.56);
    return orient(now);
  }

 private:
  bool approachIsTooShort(double volt) const {
    const std::size_t along = measurement_.paths.along();
    const double required = measurement_.approach.nominalGap(volt) - measurement_.station.gap_at_zero_volt +
                            measurement_.parameters.check_jog;
    return measurement_.safeTravel(along, moved(along)) < required;
  }

  StepOutcome orient(double now) {
    control_.orient(now, measurement_.result.flute_hammer + (offsets_.empty() ? 0.0 : offsets_.back()));
    return StepOutcome::running();
  }

  bool surveyed_ = false;
  std::vector<double> offsets_;  // [rad] from the flute at the hammer, still to be measured, last first
};

}  // namespace

StepPtr measureFlanks(Measurement& measurement, StationControl& control) {
  return std::make_unique<MeasureFlanks>(measurement, control);
}

}  // namespace smartmill::hammer
