#include "smartmill_cnc/angle/angle_sources.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc {
namespace {

constexpr double PULSE_PERIODS = 2.5;  // of the pulses, after which one must have come: one may be missing

}  // namespace

void AngleSourcesParameters::declare(ParameterTable& table) {
  table.number(
      "timeout", timeout, "s", Range::closed(0.02, 5.0),
      "time without a reading after which the next source takes over; of pulses at least 2.5 of their "
      "periods");
  table.section("Encoder by a counter channel.");
  table.number("counts_per_revolution", encoder.counts_per_revolution, "1", Range::closed(1.0, 1e8),
               "counts of the encoder per revolution, with all edges counted");
  table.number("encoder_zero", encoder.zero, "rad", Range{},
               "angle of tooth 1 at count 0, clockwise from +y");
  table.flag("encoder_reversed", encoder.reversed, "true: the counter decreases with a clockwise spindle");
  table.number("counter_bits", encoder.bits, "1", Range::closed(0, 52),
               "bits of a counter that wraps; 0: never");
  table.section("Pulses.");
  pulses.declare(table);
  table.section("Order tracking of the forces.");
  table.text("force_channel", force_channel, "channel of the force in its blocks");
  table.number("order_search", orders.search, "1", Range::open(0.0, 0.2),
               "largest relative deviation of the speed from that of the controller");
  table.number("order_window", orders.window, "s", Range::closed(0.05, 5.0),
               "time that is evaluated at once, at least 16 tooth periods");
  table.number("order_share", orders.least_share, "1", Range::open(0.0, 1.0),
               "least share of the tooth-passing order in the squares of the force about its mean");
}

AngleSources::AngleSources(const AngleSourcesParameters& parameters)
    : parameters_(parameters),
      encoder_(parameters.encoder),
      pulses_(parameters.pulses),
      orders_(parameters.orders),
      selector_({{"encoder", parameters.timeout, true},
                 {"pulses", parameters.timeout, parameters.pulses.pulses_per_revolution == 1},
                 {"controller", parameters.timeout, true},
                 {"order tracking of the forces", parameters.timeout, false}}) {
  angle_std_.fill(NOT_A_NUMBER);
}

AngleSources::Angles AngleSources::pushEncoder(const SampleBlock& block) {
  Angles out;
  for (const SpindleAngle& reading : encoder_.push(block)) {
    angle_std_[ENCODER] = encoder_.angleStd();
    add(selector_.push(ENCODER, reading), out);
  }
  add(selector_.advance(block.timeOf(block.size() - 1)), out);
  return out;
}

AngleSources::Angles AngleSources::pushPulses(const SampleBlock& block) {
  Angles out;
  for (const PulseReading& reading : pulses_.push(block)) {
    angle_std_[PULSES] = reading.angle_std;
    const double pulses_per_second =
        reading.angle.speed * parameters_.pulses.pulses_per_revolution / units::TWO_PI;
    if (pulses_per_second > 0.0)
      selector_.setTimeout(PULSES, std::max(parameters_.timeout, PULSE_PERIODS / pulses_per_second));
    add(selector_.push(PULSES, reading.angle), out);
  }
  add(selector_.advance(block.timeOf(block.size() - 1)), out);
  return out;
}

AngleSources::Angles AngleSources::pushController(const SpindleAngle& angle) {
  return selector_.push(CONTROLLER, angle);
}

AngleSources::Angles AngleSources::pushForces(const SampleBlock& block) {
  Angles out;
  if (const auto reading = orders_.push(block, block.channel(parameters_.force_channel))) {
    if (orders_.locks() != std::exchange(locks_, orders_.locks())) selector_.forgetOffset(FORCES);
    angle_std_[FORCES] = reading->angle_std;
    out = selector_.push(FORCES, reading->angle);
  }
  add(selector_.advance(block.timeOf(block.size() - 1)), out);
  return out;
}

AngleSources::Angles AngleSources::push(const CncState& state) {
  setControllerSpeed(state.connected ? state.spindle_speed : NOT_A_NUMBER);
  return selector_.advance(state.stamp);
}

void AngleSources::forgetControllerSpeed() {
  setControllerSpeed(NOT_A_NUMBER);
}

void AngleSources::setControllerSpeed(double speed) {
  speed_ = speed;
  pulses_.setControllerSpeed(speed_);
  setCut();
}

void AngleSources::push(const CuttingCondition& condition) {
  teeth_ = condition.isInWork() ? static_cast<std::size_t>(condition.tool.teeth) : 0;
  setCut();
}

void AngleSources::setCut() {
  orders_.setCut(speed_, teeth_);
}

std::string AngleSources::takeNews() {
  std::vector<std::string> news;
  for (std::string line : {selector_.takeChange(), encoder_.takeFault(), pulses_.takeFault()})
    if (!line.empty()) news.push_back(std::move(line));
  return joined(news, "; ");
}

}  // namespace smartmill::cnc
