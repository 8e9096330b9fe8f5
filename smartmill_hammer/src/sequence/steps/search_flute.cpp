#include <algorithm>
#include <cmath>

#include "sequence/steps/steps.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::hammer {
namespace {

/// Turns the spindle and measures the voltage until a flute is found.
class SearchFlute : public SequenceStep {
 public:
  using SequenceStep::SequenceStep;

  bool watchesRange() const override { return true; }

  StepOutcome motionDone(double now) override {
    return measureVoltageAfter(now, measurement_.parameters.settle_time);
  }

  StepOutcome voltageMeasured(double now, const MeanVoltage& voltage) override {
    search_->addMeasurement(control_.reachedAngle(), voltage.volt, voltage.std);
    if (search_->state() == FluteSearch::State::searching) return orient(now);
    if (search_->state() == FluteSearch::State::no_flute)
      return StepOutcome::failed(FrfCode::no_flute, search_->reason());
    if (search_->volt() > measurement_.parameters.range_share * measurement_.station.range_volt)
      return StepOutcome::failed(
          FrfCode::no_flute,
          formatted("the flute is too near to the sensor: %.2f V is the end of its range", search_->volt()));
    storeFlute();
    return StepOutcome::done();
  }

 protected:
  virtual void storeFlute() = 0;

  StepOutcome start(double now, double angle, double first_step_scale) {
    FluteSearchOptions options = searchOptions();
    if (!options.golden_only) options.first_step *= first_step_scale;
    search_.emplace(angle, options);
    return orient(now);
  }

  std::optional<FluteSearch> search_;

 private:
  StepOutcome orient(double now) {
    control_.orient(now, search_->nextAngle());
    return StepOutcome::running();
  }

  FluteSearchOptions searchOptions() const {
    const HammerParameters& p = measurement_.parameters;
    const double pitch = measurement_.leastPitch();
    FluteSearchOptions options = FluteSearchOptions::forPitch(pitch);
    const double scale = options.first_step / FluteSearchOptions().first_step;
    options.first_step = scale * p.bracket_first_step;
    options.max_step = std::max(options.first_step, std::min(p.bracket_max_step, 0.25 * pitch));
    options.tolerance = scale * p.flute_tolerance;
    options.range_volt = measurement_.station.range_volt;
    options.noise_sigmas = p.noise_sigmas;
    options.least_rise = p.least_rise;
    options.golden_only = p.golden_only != 0;
    return options;
  }
};

class SearchFluteAtTip : public SearchFlute {
 public:
  using SearchFlute::SearchFlute;

  StepOutcome begin(double now) override {
    measurement_.report("searching a flute at the tip", 0.1);
    return start(now, measurement_.parameters.start_angle, 1.0);
  }

 private:
  void storeFlute() override {
    MeasureFrfResult& result = measurement_.result;
    result.flute_low = result.flute_high = result.flute_hammer = search_->angle();
    result.flute_confidence = search_->confidence();
    measurement_.approach.startFromFlute(search_->measurements(), search_->angle(), search_->volt());
  }
};

class SearchFluteHalfway : public SearchFlute {
 public:
  using SearchFlute::SearchFlute;

  bool isNeeded() const override { return measurement_.hasOffset(); }
  StepOutcome begin(double now) override {
    measurement_.report("searching the flute halfway up to the hammer", 0.3);
    // A right-hand helix lags with height: the spindle must turn on by the lag.
    expected_angle_ =
        measurement_.result.flute_low + measurement_.tool.lag() * 0.5 * measurement_.station.offset;
    return start(now, expected_angle_, measurement_.parameters.second_search_step);
  }

 private:
  void storeFlute() override {
    MeasureFrfResult& result = measurement_.result;
    // The search may have found a neighbour: the flute of the tip is within half a pitch of where the helix
    // puts it.
    result.flute_high = search_->angle();
    result.flute_confidence *= search_->confidence();
    const double full_pitch = units::TWO_PI / measurement_.teeth();
    result.flute_high -= full_pitch * std::round((result.flute_high - expected_angle_) / full_pitch);
    result.flute_hammer = 2.0 * result.flute_high - result.flute_low;  // eq. 4.1
    measurement_.report(formatted("flute at %.2f deg at the tip, %.2f deg halfway up, %.2f deg at the hammer",
                                  units::degFromRad(result.flute_low), units::degFromRad(result.flute_high),
                                  units::degFromRad(result.flute_hammer)) +
                            formatted(", probability %.1f %%, %d spindle moves",
                                      100.0 * result.flute_confidence, control_.spindleMoves()),
                        0.48);
  }

  double expected_angle_ = 0.0;  // [rad]
};

/// Moves the tool along z by half the hammer's offset.
class ShiftHeight : public SequenceStep {
 public:
  ShiftHeight(Measurement& measurement, StationControl& control, bool down)
      : SequenceStep(measurement, control), down_(down) {}

  bool isNeeded() const override { return measurement_.hasOffset(); }
  bool watchesRange() const override { return down_; }
  StepOutcome begin(double now) override {
    if (down_) measurement_.report("lowering the tool to find the flute halfway up to the hammer", 0.28);
    const double half = roundTo(0.5 * measurement_.station.offset, measurement_.parameters.resolution);
    control_.jog(now, 2, down_ ? -half : half, measurement_.parameters.approach_feed);
    return StepOutcome::running();
  }
  StepOutcome motionDone(double) override { return StepOutcome::done(); }

 private:
  bool down_;
};

class TurnFluteToHammer : public SequenceStep {
 public:
  using SequenceStep::SequenceStep;

  StepOutcome begin(double now) override {
    measurement_.report("turning the flute to the hammer", 0.5);
    control_.orient(now, measurement_.result.flute_hammer);
    return StepOutcome::running();
  }
  StepOutcome motionDone(double) override { return StepOutcome::done(); }
};

}  // namespace

StepPtr searchFluteAtTip(Measurement& measurement, StationControl& control) {
  return std::make_unique<SearchFluteAtTip>(measurement, control);
}
StepPtr lowerHalfway(Measurement& measurement, StationControl& control) {
  return std::make_unique<ShiftHeight>(measurement, control, true);
}
StepPtr searchFluteHalfway(Measurement& measurement, StationControl& control) {
  return std::make_unique<SearchFluteHalfway>(measurement, control);
}
StepPtr raiseToTip(Measurement& measurement, StationControl& control) {
  return std::make_unique<ShiftHeight>(measurement, control, false);
}
StepPtr turnFluteToHammer(Measurement& measurement, StationControl& control) {
  return std::make_unique<TurnFluteToHammer>(measurement, control);
}

}  // namespace smartmill::hammer
