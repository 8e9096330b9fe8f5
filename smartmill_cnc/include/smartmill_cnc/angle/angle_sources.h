#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/angle_selector.h"
#include "smartmill_core/signal/encoder_reader.h"
#include "smartmill_core/signal/order_tracker.h"
#include "smartmill_core/signal/pulse_tachometer.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::cnc {

struct AngleSourcesParameters {
  EncoderParameters encoder;
  PulseTachometerParameters pulses;
  OrderTrackerParameters orders;
  std::string force_channel = "fx";
  double timeout = 0.15;  ///< [s] as the silence of an instrument

  void declare(ParameterTable& table);
};

/// Spindle angle of the best source that works: encoder by a counter channel, pulses, position of the
/// controller, order tracking of the forces. Time is that of the stamps.
class AngleSources {
 public:
  enum Source : std::size_t { ENCODER, PULSES, CONTROLLER, FORCES, SOURCES };
  using Angles = std::vector<SpindleAngle>;

  /// @throws Error on an invalid parameter.
  explicit AngleSources(const AngleSourcesParameters& parameters);

  /// Inputs. @return readings to publish, in time order @throws Error when a channel is missing
  Angles pushEncoder(const SampleBlock& block);
  Angles pushPulses(const SampleBlock& block);
  Angles pushController(const SpindleAngle& angle);
  Angles pushForces(const SampleBlock& block);
  Angles push(const CncState& state);
  void push(const CuttingCondition& condition);
  /// The controller has fallen silent: its last speed is none.
  void forgetControllerSpeed();

  const AngleSelector& selector() const { return selector_; }
  /// [rad] standard deviation of the last reading of a source, as it states it; NaN: none, or at rest
  double angleStd(Source source) const { return angle_std_[source]; }
  /// One line on what has happened since the last call, for the log; empty: nothing.
  std::string takeNews();

 private:
  void add(const Angles& more, Angles& to) const { to.insert(to.end(), more.begin(), more.end()); }
  void setControllerSpeed(double speed);  // [rad/s]; NaN: not known
  void setCut();

  AngleSourcesParameters parameters_;
  EncoderReader encoder_;
  PulseTachometer pulses_;
  OrderTracker orders_;
  AngleSelector selector_;
  std::array<double, SOURCES> angle_std_{};
  double speed_ = 0.0;  // [rad/s] by the controller
  std::size_t teeth_ = 0, locks_ = 0;
};

}  // namespace smartmill::cnc
