#include "smartmill_kalman/compensation/record_compensation.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/filter/delay_filter.h"
#include "smartmill_kalman/filter/inverse_filter.h"
#include "smartmill_kalman/filter/lag_smoother.h"

namespace smartmill::kalman {
namespace {

/// Revolutions after a change from which the amplitudes at that change are told.
constexpr double LEAD = 4.0;
/// Length of the filter's window plus the samples that a change needs to show through the sensor.
constexpr std::size_t BACK = 24;

/// Force states at the start of a stretch, told from what the quick filter knows LEAD revolutions later.
std::vector<double> stateAtStart(HarmonicFilter quick, const std::vector<double>& at_rest,
                                 const std::vector<double>& stretch, std::size_t lead, double sample_rate) {
  quick.reset();
  quick.setState(at_rest);
  for (std::size_t i = 0; i < lead; ++i) {
    quick.setLevel(0);
    quick.step(stretch[i]);
  }
  std::vector<double> state = quick.state();
  const std::size_t m = state.size() - 1 - 2 * static_cast<std::size_t>(quick.harmonics());
  // The modes are where they were; the amplitudes turn back.
  std::copy(at_rest.begin(), at_rest.begin() + static_cast<std::ptrdiff_t>(m), state.begin());
  for (int n = 1; n <= quick.harmonics(); ++n) {
    double& in_phase = state[m + 2 * n - 1];
    double& quadrature = state[m + 2 * n];
    const double turn = -n * quick.spindleSpeed() * static_cast<double>(lead) / sample_rate;
    const double c = std::cos(turn), s = std::sin(turn), f = in_phase, g = quadrature;
    in_phase = c * f + s * g;
    quadrature = c * g - s * f;
  }
  return state;
}

}  // namespace

Method methodOf(const std::string& name) {
  if (name == "kalman") return Method::kalman;
  if (name == "delay") return Method::delay;
  if (name == "smoother") return Method::smoother;
  if (name == "fixed-lag") return Method::fixed_lag;
  if (name == "inverse") return Method::inverse;
  throw Error("method '" + name + "': kalman, delay, smoother, fixed-lag or inverse is due");
}

std::vector<double> smoothRecord(const std::vector<double>& measured, const ModalModel& sensor,
                                 double spindle_speed, double sample_rate,
                                 const HarmonicFilterParameters& parameters) {
  HarmonicFilter filter(sensor, spindle_speed, sample_rate, parameters);
  HarmonicFilter causal = filter;
  const double revolution = units::TWO_PI / spindle_speed * sample_rate;
  const auto lead = static_cast<std::size_t>(std::lround(LEAD * revolution));
  std::vector<std::size_t> starts{0};
  std::size_t restarts = 0;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    causal.step(measured[i]);
    if (causal.restarts() == restarts) continue;
    restarts = causal.restarts();
    const std::size_t start = i > BACK ? i - BACK : 0;
    // What follows a change at once belongs to it.
    if (start > starts.back() + (starts.size() > 1 ? lead : BACK)) starts.push_back(start);
  }
  std::vector<double> force;
  force.reserve(measured.size());
  for (std::size_t k = 0; k < starts.size(); ++k) {
    const std::size_t end = k + 1 < starts.size() ? starts[k + 1] : measured.size();
    const std::vector<double> stretch(measured.begin() + static_cast<std::ptrdiff_t>(starts[k]),
                                      measured.begin() + static_cast<std::ptrdiff_t>(end));
    if (stretch.size() > lead)
      filter.setState(stateAtStart(filter, filter.state(), stretch, lead, sample_rate));
    const std::vector<double> smoothed = filter.smooth(stretch);
    force.insert(force.end(), smoothed.begin(), smoothed.end());
  }
  return force;
}

std::vector<double> compensateRecord(Method method, const std::vector<double>& measured,
                                     const ModalModel& sensor, double spindle_speed, double sample_rate,
                                     const HarmonicFilterParameters& parameters, double lag) {
  if (method == Method::smoother)
    return smoothRecord(measured, sensor, spindle_speed, sample_rate, parameters);
  std::vector<double> force;
  if (method == Method::inverse) {
    InverseParameters inverse;
    inverse.bandwidth = std::min(parameters.bandwidth, 0.4 * sample_rate);
    InverseFilter filter(sensor, sample_rate, inverse);
    std::vector<double> longer = measured;
    longer.resize(measured.size() + filter.latency(), 0.0);
    force = filter.process(longer);
    force.erase(force.begin(), force.begin() + static_cast<std::ptrdiff_t>(filter.latency()));
    return force;
  }
  force.reserve(measured.size());
  if (method == Method::delay) {
    DelayFilter filter(sensor, spindle_speed, sample_rate, parameters);
    for (const double sample : measured) force.push_back(filter.step(sample));
    return force;
  }
  HarmonicFilter filter(sensor, spindle_speed, sample_rate, parameters);
  if (method == Method::fixed_lag) {
    // In blocks, as the node: a block's samples know what comes up to the lag after the block's end.
    constexpr std::size_t BLOCK = 256;
    const auto late = static_cast<std::size_t>(std::lround(lag * sample_rate));
    LagSmoother smoother;
    const auto take = [&](std::size_t count) {
      const std::vector<double> told = smoother.take(count);
      force.insert(force.end(), told.begin(), told.end());
    };
    for (const double sample : measured) {
      smoother.step(filter, sample);
      if (smoother.waiting() >= BLOCK + late) take(BLOCK);
    }
    while (smoother.waiting() > 0) take(BLOCK);
    return force;
  }
  for (const double sample : measured) force.push_back(filter.step(sample));
  return force;
}

}  // namespace smartmill::kalman
