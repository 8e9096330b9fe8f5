#include "smartmill_kalman/compensation/record_compensation.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/filter/adaptive_memory.h"
#include "smartmill_kalman/filter/delay_filter.h"
#include "smartmill_kalman/filter/fixed_lag_smoother.h"
#include "smartmill_kalman/filter/inverse_filter.h"

namespace smartmill::kalman {
namespace {

/// Revolutions after an abrupt change from which the amplitudes at the change are estimated.
constexpr double LEAD = 4.0;
/// Samples per block of the fixed-lag smoother, as from a DAQ.
constexpr std::size_t BLOCK = 256;

struct RecordTask {
  const std::vector<double>& measured;  // [N]
  const ModalModel& sensor;
  double spindle_speed, sample_rate;  // [rad/s], [Hz]
  const HarmonicFilterParameters& parameters;
  double lag;  // [s]
};

/// State at the start of a segment, from the quick filter LEAD revolutions later.
std::vector<double> stateAtStart(HarmonicFilter quick, const std::vector<double>& at_rest,
                                 const std::vector<double>& segment, std::size_t lead, double sample_rate) {
  quick.reset();
  quick.setState(at_rest);
  for (std::size_t i = 0; i < lead; ++i) {
    quick.setLevel(0);
    quick.step(segment[i]);
  }
  std::vector<double> state = quick.pairs().state();
  const std::size_t m = state.size() - 1 - 2 * static_cast<std::size_t>(quick.pairs().harmonics());
  // The modes keep their states; the harmonics rotate back to the start.
  std::copy(at_rest.begin(), at_rest.begin() + static_cast<std::ptrdiff_t>(m), state.begin());
  for (int n = 1; n <= quick.pairs().harmonics(); ++n) {
    double& in_phase = state[m + 2 * n - 1];
    double& quadrature = state[m + 2 * n];
    const double angle = -n * quick.pairs().spindleSpeed() * static_cast<double>(lead) / sample_rate;
    const double c = std::cos(angle), s = std::sin(angle), f = in_phase, g = quadrature;
    in_phase = c * f + s * g;
    quadrature = c * g - s * f;
  }
  return state;
}

template <class Filter>
std::vector<double> filterRecord(const RecordTask& task) {
  Filter filter(task.sensor, task.spindle_speed, task.sample_rate, task.parameters);
  std::vector<double> force;
  force.reserve(task.measured.size());
  for (const double sample : task.measured) force.push_back(filter.step(sample));
  return force;
}

std::vector<double> smoothWithLag(const RecordTask& task) {
  HarmonicFilter filter(task.sensor, task.spindle_speed, task.sample_rate, task.parameters);
  const auto lag = static_cast<std::size_t>(std::lround(task.lag * task.sample_rate));
  FixedLagSmoother smoother;
  std::vector<double> force;
  force.reserve(task.measured.size());
  const auto takeBlock = [&] {
    const std::vector<double> block = smoother.takeSmoothed(BLOCK);
    force.insert(force.end(), block.begin(), block.end());
  };
  for (const double sample : task.measured) {
    smoother.step(filter, sample);
    if (smoother.pending() >= BLOCK + lag) takeBlock();
  }
  while (smoother.pending() > 0) takeBlock();
  return force;
}

std::vector<double> invertRecord(const RecordTask& task) {
  InverseParameters inverse;
  inverse.bandwidth = std::min(task.parameters.bandwidth, 0.4 * task.sample_rate);
  InverseFilter filter(task.sensor, task.sample_rate, inverse);
  std::vector<double> padded = task.measured;
  padded.resize(task.measured.size() + filter.latency(), 0.0);
  std::vector<double> force = filter.process(padded);
  force.erase(force.begin(), force.begin() + static_cast<std::ptrdiff_t>(filter.latency()));
  return force;
}

std::vector<double> smoothWhole(const RecordTask& task) {
  return smoothRecord(task.measured, task.sensor, task.spindle_speed, task.sample_rate, task.parameters);
}

/// A method is a function and a line here.
struct RecordMethod {
  Method method;
  const char* name;
  bool needs_whole_record;
  std::vector<double> (*compensate)(const RecordTask&);
};
constexpr RecordMethod METHODS[] = {
    {Method::kalman, "kalman", false, filterRecord<HarmonicFilter>},
    {Method::delay, "delay", false, filterRecord<DelayFilter>},
    {Method::smoother, "smoother", true, smoothWhole},
    {Method::fixed_lag, "fixed-lag", false, smoothWithLag},
    {Method::inverse, "inverse", true, invertRecord},
};

const RecordMethod& entryOf(Method method) {
  return *std::find_if(std::begin(METHODS), std::end(METHODS),
                       [method](const RecordMethod& m) { return m.method == method; });
}

}  // namespace

Method methodOf(const std::string& name) {
  std::string known;
  for (const RecordMethod& m : METHODS) {
    if (name == m.name) return m.method;
    known += (known.empty() ? "" : ", ") + std::string(m.name);
  }
  throw Error("method '" + name + "': unknown, expected one of " + known);
}

std::vector<std::string> methodNames() {
  std::vector<std::string> names;
  for (const RecordMethod& m : METHODS) names.emplace_back(m.name);
  return names;
}

bool needsWholeRecord(Method method) {
  return entryOf(method).needs_whole_record;
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
    if (causal.memory().restarts() == restarts) continue;
    restarts = causal.memory().restarts();
    const std::size_t start = i > AdaptiveMemory::DETECTION_DELAY ? i - AdaptiveMemory::DETECTION_DELAY : 0;
    // A detection soon after a change belongs to it.
    if (start > starts.back() + (starts.size() > 1 ? lead : AdaptiveMemory::DETECTION_DELAY))
      starts.push_back(start);
  }
  std::vector<double> force;
  force.reserve(measured.size());
  for (std::size_t k = 0; k < starts.size(); ++k) {
    const std::size_t end = k + 1 < starts.size() ? starts[k + 1] : measured.size();
    const std::vector<double> segment(measured.begin() + static_cast<std::ptrdiff_t>(starts[k]),
                                      measured.begin() + static_cast<std::ptrdiff_t>(end));
    if (segment.size() > lead)
      filter.setState(stateAtStart(filter, filter.pairs().state(), segment, lead, sample_rate));
    const std::vector<double> smoothed = filter.smooth(segment);
    force.insert(force.end(), smoothed.begin(), smoothed.end());
  }
  return force;
}

std::vector<double> compensateRecord(Method method, const std::vector<double>& measured,
                                     const ModalModel& sensor, double spindle_speed, double sample_rate,
                                     const HarmonicFilterParameters& parameters, double lag) {
  return entryOf(method).compensate({measured, sensor, spindle_speed, sample_rate, parameters, lag});
}

}  // namespace smartmill::kalman
