#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>
#include <string>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_core/error.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/signal/streams.h"

/// Messages to core types and back, written once for the plain messages here and for the generated ones of
/// ROS, whose fields have the same names. read() expects a new object. What conversions.h says of errors
/// holds.
namespace smartmill::conversion {

inline void requireLength(const char* field, std::size_t length, std::size_t expected) {
  if (length != expected) {
    throw Error(std::string(field) + ": " + std::to_string(length) + " values, expected " +
                std::to_string(expected));
  }
}

inline void requireRate(double rate) {
  if (!(rate > 0.0) || !std::isfinite(rate)) {
    throw Error("sample_rate: " + std::to_string(rate) + " Hz, expected a rate above 0");
  }
}

template <class Time>
double secondsOf(const Time& stamp) {
  return static_cast<double>(stamp.sec) + 1e-9 * static_cast<double>(stamp.nsec);
}

/// Nearest nanosecond. @throws Error when not finite, negative or beyond 32 bits of seconds.
template <class Time>
Time timeOf(double stamp) {
  constexpr double BEYOND = 4294967295.0;    // [s]
  constexpr std::int64_t NANO = 1000000000;  // [ns/s]
  if (!std::isfinite(stamp) || stamp < 0.0 || stamp > BEYOND) {
    throw Error("stamp: " + std::to_string(stamp) + " s, expected a time from 0 to 2^32 s");
  }
  const double whole = std::floor(stamp);
  const auto rest = static_cast<std::int64_t>(std::llround((stamp - whole) * 1e9));
  Time time;
  time.sec = static_cast<std::uint32_t>(static_cast<std::int64_t>(whole) + rest / NANO);
  time.nsec = static_cast<std::uint32_t>(rest % NANO);
  return time;
}

template <class M>
void setStamp(double stamp, M& m) {
  m.header.stamp = timeOf<decltype(m.header.stamp)>(stamp);
}

template <class Point>
std::array<double, 3> fromPoint(const Point& p) {
  return {p.x, p.y, p.z};
}

template <class Point>
void setPoint(const std::array<double, 3>& p, Point& point) {
  point.x = p[0];
  point.y = p[1];
  point.z = p[2];
}

/// A series that the core leaves empty when unknown is all NaN in a message.
inline std::vector<double> orUnknown(const std::vector<double>& values, std::size_t size) {
  return values.empty() ? std::vector<double>(size, NOT_A_NUMBER) : values;
}

template <class M>
void read(const M& m, SampleBlock& block) {
  requireRate(m.sample_rate);
  requireLength("units", m.units.size(), m.channels.size());
  if (m.channels.empty() || m.samples.size() % m.channels.size() != 0) {
    throw Error("samples: " + std::to_string(m.samples.size()) + " values do not fill " +
                std::to_string(m.channels.size()) + " channels");
  }
  block.stamp = secondsOf(m.header.stamp);
  block.sample_rate = m.sample_rate;
  block.first_index = m.first_index;
  block.channels = m.channels;
  block.units = m.units;
  block.samples = m.samples;
}

template <class M>
void write(const SampleBlock& block, const std::string& frame_id, M& m) {
  setStamp(block.stamp, m);
  m.header.frame_id = frame_id;
  m.sample_rate = block.sample_rate;
  m.first_index = block.first_index;
  m.channels = block.channels;
  m.units = block.units;
  m.samples = block.samples;
}

template <class M>
void read(const M& m, SpindleAngle& out) {
  if (!std::isfinite(m.angle) || !std::isfinite(m.speed)) throw Error("spindle angle: not a finite number");
  out = {secondsOf(m.header.stamp), m.angle, m.speed};
}

template <class M>
void write(const SpindleAngle& angle, M& m) {
  setStamp(angle.stamp, m);
  m.angle = angle.angle;
  m.speed = angle.speed;
}

template <class M>
void read(const M& m, CncState& state) {
  requireLength("position", m.position.size(), m.axes.size());
  requireLength("distance_to_go", m.distance_to_go.size(), m.axes.size());
  state.stamp = secondsOf(m.header.stamp);
  state.connected = m.connected;
  state.armed = m.armed;
  state.mode = static_cast<CncMode>(m.mode);
  state.run = static_cast<CncRun>(m.run);
  state.motion = m.motion;
  state.emergency = m.emergency;
  state.alarm = m.alarm;
  state.alarm_text = m.alarm_text;
  state.program = m.program;
  state.sequence = m.sequence;
  state.axes = m.axes;
  state.position = m.position;
  state.distance_to_go = m.distance_to_go;
  state.spindle_speed = m.spindle_speed;
  state.feed = m.feed;
}

template <class M>
void write(const CncState& state, M& m) {
  setStamp(state.stamp, m);
  m.connected = state.connected;
  m.armed = state.armed;
  m.mode = static_cast<std::uint8_t>(state.mode);
  m.run = static_cast<std::uint8_t>(state.run);
  m.motion = state.motion;
  m.emergency = state.emergency;
  m.alarm = state.alarm;
  m.alarm_text = state.alarm_text;
  m.program = state.program;
  m.sequence = state.sequence;
  m.axes = state.axes;
  m.position = state.position;
  m.distance_to_go = state.distance_to_go;
  m.spindle_speed = state.spindle_speed;
  m.feed = state.feed;
}

template <class M>
void read(const M& m, LoadSample& out) {
  requireLength("axis_load", m.axis_load.size(), m.axes.size());
  out = {secondsOf(m.header.stamp), m.spindle_load, m.spindle_speed, m.axes, m.axis_load};
}

template <class M>
void write(const LoadSample& load, M& m) {
  setStamp(load.stamp, m);
  m.spindle_load = load.spindle_load;
  m.spindle_speed = load.spindle_speed;
  m.axes = load.axes;
  m.axis_load = load.axis_load;
}

template <class M>
void read(const M& m, CuttingCondition& c) {
  if (m.kind > M::CUT) throw Error("kind: " + std::to_string(m.kind) + " is no condition");
  c.stamp = secondsOf(m.header.stamp);
  c.kind = static_cast<CuttingCondition::Kind>(m.kind);
  c.name = m.name;
  c.material = m.material;
  c.tool_name = m.tool;
  c.tool.teeth = static_cast<int>(m.teeth);
  c.tool.diameter = m.diameter;
  c.tool.helix = m.helix;
  c.engagement = {m.entry_angle, m.exit_angle, m.axial_depth, m.feed_per_tooth};
  c.spindle_speed = m.spindle_speed;
  c.steady_from = fromPoint(m.steady_from);
  c.steady_to = fromPoint(m.steady_to);
}

template <class M>
void write(const CuttingCondition& c, M& m) {
  setStamp(c.stamp, m);
  m.kind = static_cast<std::uint8_t>(c.kind);
  m.name = c.name;
  m.material = c.material;
  m.tool = c.tool_name;
  m.teeth = static_cast<std::uint32_t>(c.tool.teeth);
  m.diameter = c.tool.diameter;
  m.helix = c.tool.helix;
  m.spindle_speed = c.spindle_speed;
  m.feed_per_tooth = c.engagement.feed_per_tooth;
  m.axial_depth = c.engagement.axial_depth;
  m.entry_angle = c.engagement.entry;
  m.exit_angle = c.engagement.exit;
  setPoint(c.steady_from, m.steady_from);
  setPoint(c.steady_to, m.steady_to);
}

template <class M>
void read(const M& m, ForceBlock& block) {
  requireRate(m.sample_rate);
  requireLength("fy", m.fy.size(), m.fx.size());
  requireLength("fz", m.fz.size(), m.fx.size());
  if (m.status > M::SETTLING) throw Error("status: " + std::to_string(m.status) + " is unknown");
  block.stamp = secondsOf(m.header.stamp);
  block.sample_rate = m.sample_rate;
  block.first_index = m.first_index;
  block.force = {m.fx, m.fy, m.fz};
  block.status = static_cast<ForceBlock::Status>(m.status);
}

template <class M>
void write(const ForceBlock& block, const std::string& frame_id, M& m) {
  setStamp(block.stamp, m);
  m.header.frame_id = frame_id;
  m.sample_rate = block.sample_rate;
  m.first_index = block.first_index;
  m.fx = block.force[0];
  m.fy = block.force[1];
  m.fz = block.force[2];
  m.status = static_cast<std::uint8_t>(block.status);
}

template <class M>
void read(const M& m, MeasuredFrf& measured) {
  const std::size_t n = m.frequency.size();
  requireLength("real", m.real.size(), n);
  requireLength("imag", m.imag.size(), n);
  requireLength("coherence", m.coherence.size(), n);
  requireLength("standard_deviation", m.standard_deviation.size(), n);
  measured.stamp = secondsOf(m.header.stamp);
  measured.tool = m.tool;
  measured.point = m.point;
  measured.direction = m.direction;
  measured.frf.unit = m.unit;
  measured.frf.averages = static_cast<int>(m.averages);
  measured.frf.frequency = m.frequency;
  measured.frf.coherence = m.coherence;
  measured.frf.std_dev = m.standard_deviation;
  for (std::size_t i = 0; i < n; ++i) measured.frf.value.emplace_back(m.real[i], m.imag[i]);
}

template <class M>
void write(const MeasuredFrf& measured, M& m) {
  setStamp(measured.stamp, m);
  m.tool = measured.tool;
  m.point = measured.point;
  m.direction = measured.direction;
  m.unit = measured.frf.unit;
  m.averages = static_cast<std::uint32_t>(measured.frf.averages);
  m.frequency = measured.frf.frequency;
  m.coherence = orUnknown(measured.frf.coherence, measured.frf.size());
  m.standard_deviation = orUnknown(measured.frf.std_dev, measured.frf.size());
  for (const std::complex<double>& value : measured.frf.value) {
    m.real.push_back(value.real());
    m.imag.push_back(value.imag());
  }
}

template <class M>
void read(const M& m, MeasuredModes& measured) {
  measured.stamp = secondsOf(m.header.stamp);
  measured.tool = m.tool;
  measured.point = m.point;
  measured.direction = m.direction;
  measured.unit = m.unit;
  measured.relative_error = m.relative_error;
  measured.model.direct = m.direct;
  measured.model.direct_std = m.direct_std;
  for (const auto& mode : m.modes) {
    measured.model.modes.push_back({mode.frequency, mode.damping_ratio, mode.gain, mode.frequency_std,
                                    mode.damping_ratio_std, mode.gain_std});
  }
}

template <class M>
void write(const MeasuredModes& measured, M& m) {
  setStamp(measured.stamp, m);
  m.tool = measured.tool;
  m.point = measured.point;
  m.direction = measured.direction;
  m.unit = measured.unit;
  m.relative_error = measured.relative_error;
  m.direct = measured.model.direct;
  m.direct_std = measured.model.direct_std;
  for (const Mode& mode : measured.model.modes) {
    auto& out = m.modes.emplace_back();
    out.frequency = mode.frequency;
    out.damping_ratio = mode.damping_ratio;
    out.gain = mode.gain;
    out.frequency_std = mode.frequency_std;
    out.damping_ratio_std = mode.damping_ratio_std;
    out.gain_std = mode.gain_std;
  }
}

template <class M>
void read(const M& m, CoefficientSet& set) {
  set.stamp = secondsOf(m.header.stamp);
  set.tool = m.tool;
  set.material = m.material;
  set.source = m.source;
  set.value = {m.ktc, m.krc, m.kac, m.kte, m.kre, m.kae};
  set.std_dev = {m.ktc_std, m.krc_std, m.kac_std, m.kte_std, m.kre_std, m.kae_std};
  set.friction_viscous = m.friction_viscous;
  set.friction_coulomb = m.friction_coulomb;
  set.tests = static_cast<int>(m.test_count);
}

template <class M>
void write(const CoefficientSet& set, M& m) {
  setStamp(set.stamp, m);
  m.tool = set.tool;
  m.material = set.material;
  m.source = set.source;
  m.ktc = set.value.ktc, m.krc = set.value.krc, m.kac = set.value.kac;
  m.kte = set.value.kte, m.kre = set.value.kre, m.kae = set.value.kae;
  m.ktc_std = set.std_dev.ktc, m.krc_std = set.std_dev.krc, m.kac_std = set.std_dev.kac;
  m.kte_std = set.std_dev.kte, m.kre_std = set.std_dev.kre, m.kae_std = set.std_dev.kae;
  m.friction_viscous = set.friction_viscous;
  m.friction_coulomb = set.friction_coulomb;
  m.test_count = static_cast<std::uint32_t>(set.tests);
}

template <class M>
void read(const M& m, StabilityPoint& out) {
  out = {m.spindle_speed, m.axial_depth, m.depth_limit,          m.chatter_frequency,
         m.torque,        m.power,       m.material_removal_rate};
}

template <class M>
void write(const StabilityPoint& point, M& m) {
  m.spindle_speed = point.spindle_speed;
  m.axial_depth = point.axial_depth;
  m.depth_limit = point.depth_limit;
  m.chatter_frequency = point.chatter_frequency;
  m.torque = point.torque;
  m.power = point.power;
  m.material_removal_rate = point.material_removal_rate;
}

template <class M>
void read(const M& m, StabilityChart& chart) {
  const std::size_t n = m.spindle_speed.size();
  requireLength("depth_limit", m.depth_limit.size(), n);
  requireLength("chatter_frequency", m.chatter_frequency.size(), n);
  requireLength("torque_depth_limit", m.torque_depth_limit.size(), n);
  requireLength("power_depth_limit", m.power_depth_limit.size(), n);
  chart.stamp = secondsOf(m.header.stamp);
  chart.tool = m.tool;
  chart.material = m.material;
  chart.method = m.method;
  chart.entry = m.entry_angle;
  chart.exit = m.exit_angle;
  chart.feed_per_tooth = m.feed_per_tooth;
  chart.limit = {m.spindle_speed, m.depth_limit, m.chatter_frequency};
  chart.torque_depth_limit = m.torque_depth_limit;
  chart.power_depth_limit = m.power_depth_limit;
  chart.absolute_depth_limit = m.absolute_depth_limit;
  for (const auto& point : m.recommended) read(point, chart.recommended.emplace_back());
  for (const auto& point : m.unstable) read(point, chart.unstable.emplace_back());
}

template <class M>
void write(const StabilityChart& chart, M& m) {
  setStamp(chart.stamp, m);
  m.tool = chart.tool;
  m.material = chart.material;
  m.method = chart.method;
  m.entry_angle = chart.entry;
  m.exit_angle = chart.exit;
  m.feed_per_tooth = chart.feed_per_tooth;
  m.spindle_speed = chart.limit.spindle_speed;
  m.depth_limit = chart.limit.depth;
  m.chatter_frequency = chart.limit.chatter_frequency;
  m.torque_depth_limit = chart.torque_depth_limit;
  m.power_depth_limit = chart.power_depth_limit;
  m.absolute_depth_limit = chart.absolute_depth_limit;
  for (const StabilityPoint& point : chart.recommended) write(point, m.recommended.emplace_back());
  for (const StabilityPoint& point : chart.unstable) write(point, m.unstable.emplace_back());
}

inline ForceCurve forceCurveOf(const std::vector<double>& chip, const std::vector<double>& value,
                               const std::vector<double>& std_dev, const char* field) {
  if (value.size() != chip.size() + 2 || std_dev.size() != chip.size())
    throw Error(std::string("force curve: ") + field + ": expected " + std::to_string(chip.size() + 2) +
                " coefficients and " + std::to_string(chip.size()) + " deviations");
  // NaN falls, too.
  const auto rises = [](double before, double after) { return after >= before; };
  for (std::size_t k = 1; k < value.size(); ++k) {
    if (!rises(value[k - 1], value[k]))
      throw Error(std::string("force curve: ") + field + ": the coefficients must not fall");
  }
  return {chip, value, std_dev};
}

template <class M>
void read(const M& m, IdentifiedForceCurves& found) {
  constexpr std::uint32_t MOST_TEETH = 1000;
  found.stamp = secondsOf(m.header.stamp);
  found.tool = m.tool;
  found.material = m.material;
  found.teeth = static_cast<int>(std::min<std::uint32_t>(m.teeth, MOST_TEETH));
  found.cuts = m.cuts;
  if (m.chip.size() < 3 || m.chip.front() != 0.0 || !(m.chip.back() > 0.0))
    throw Error("force curve: chip: expected three breaks or more, from 0");
  found.curves.tangential = forceCurveOf(m.chip, m.tangential, m.tangential_std, "tangential");
  found.curves.radial = forceCurveOf(m.chip, m.radial, m.radial_std, "radial");
  found.curves.rms = m.rms;
  found.curves.scatter = m.scatter;
}

template <class M>
void write(const IdentifiedForceCurves& found, M& m) {
  setStamp(found.stamp, m);
  m.tool = found.tool;
  m.material = found.material;
  m.teeth = static_cast<std::uint32_t>(found.teeth);
  m.cuts = found.cuts;
  m.chip = found.curves.tangential.knots;
  m.tangential = found.curves.tangential.value;
  m.radial = found.curves.radial.value;
  m.tangential_std = found.curves.tangential.std_dev;
  m.radial_std = found.curves.radial.std_dev;
  m.rms = found.curves.rms;
  m.scatter = found.curves.scatter;
}

/// @param received [s] taken for a missing stamp
template <class M>
void read(const M& m, double received, MeasureFrfGoal& goal) {
  // Beyond any range that a measurement accepts, and safe as an int.
  const auto count = [](std::uint32_t n) { return static_cast<int>(std::min<std::uint32_t>(n, 1000000)); };
  const auto& stamp = m.header.stamp;
  goal.stamp = stamp.sec == 0 && stamp.nsec == 0 ? received : secondsOf(stamp);
  goal.tool = m.tool;
  goal.point = m.point;
  goal.direction = m.direction;
  goal.hits = count(m.hits);
  goal.modes = count(m.modes);
  goal.stickout = m.stickout;
  goal.teeth = count(m.teeth);
}

template <class Data, class M>
Data from(const M& m) {
  Data data;
  read(m, data);
  return data;
}

template <class M, class... Arguments>
M to(const Arguments&... arguments) {
  M m;
  write(arguments..., m);
  return m;
}

}  // namespace smartmill::conversion
