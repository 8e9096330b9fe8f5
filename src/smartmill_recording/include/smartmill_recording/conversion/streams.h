#pragma once

#include <cmath>
#include <cstdint>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/inspection_feature.h"
#include "smartmill_core/signal/machine_temperature.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_recording/conversion/fields.h"

/// Samples and states of sensors and controller.
namespace smartmill::conversion {

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
  // A pulse tachometer does not determine the angle at rest.
  const bool at_rest = m.speed == 0.0 && std::isnan(m.angle);
  if (!std::isfinite(m.speed) || !(std::isfinite(m.angle) || at_rest))
    throw Error("spindle angle: not a finite number");
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
void read(const M& m, MachineTemperature& out) {
  requireLength("axis_motor", m.axis_motor.size(), m.axes.size());
  requireLength("axis_encoder", m.axis_encoder.size(), m.axes.size());
  out = {secondsOf(m.header.stamp), m.axes, m.axis_motor, m.axis_encoder, m.spindle_motor};
}

template <class M>
void write(const MachineTemperature& temperature, M& m) {
  setStamp(temperature.stamp, m);
  m.axes = temperature.axes;
  m.axis_motor = temperature.axis_motor;
  m.axis_encoder = temperature.axis_encoder;
  m.spindle_motor = temperature.spindle_motor;
}

// A message that is entered by hand leaves what is not stated at zero.
template <class M>
void read(const M& m, InspectionFeature& f) {
  const auto stated = [](double value) { return value == 0.0 ? NOT_A_NUMBER : value; };
  f.stamp = secondsOf(m.header.stamp);
  f.condition = m.condition;
  f.kind = m.kind;
  f.direction = m.direction;
  f.nominal = m.nominal;
  f.measured = m.measured;
  f.std_dev = m.std_dev;
  f.cut_time = stated(secondsOf(m.cut_stamp));
  f.machine_temperature = stated(m.machine_temperature);
  f.part_temperature = stated(m.part_temperature);
  f.part_expansion = stated(m.part_expansion);
}

template <class M>
void write(const InspectionFeature& f, M& m) {
  setStamp(f.stamp, m);
  m.condition = f.condition;
  m.kind = f.kind;
  m.direction = f.direction;
  m.nominal = f.nominal;
  m.measured = f.measured;
  m.std_dev = f.std_dev;
  if (std::isfinite(f.cut_time)) m.cut_stamp = timeOf<decltype(m.cut_stamp)>(f.cut_time);
  m.machine_temperature = f.machine_temperature;
  m.part_temperature = f.part_temperature;
  m.part_expansion = f.part_expansion;
}

template <class M>
void read(const M& m, CuttingCondition& c) {
  if (m.kind > M::UNSTEADY) throw Error("kind: " + std::to_string(m.kind) + " is no condition");
  c.stamp = secondsOf(m.header.stamp);
  c.kind = static_cast<CuttingCondition::Kind>(m.kind);
  c.name = m.name;
  c.material = m.material;
  c.tool_name = m.tool;
  c.tool.teeth = static_cast<int>(m.teeth);
  c.tool.diameter = m.diameter;
  c.tool.helix = m.helix;
  c.tool.edge.corner_radius = m.corner_radius;
  c.tool.edge.edge_angle = m.edge_angle == 0.0 ? 0.5 * units::PI : m.edge_angle;
  c.tool.pitch = m.pitch;
  c.cut_time_before = m.cut_time_before;
  c.engagement = {m.entry_angle, m.exit_angle, m.axial_depth, m.feed_per_tooth};
  for (const auto& band : m.bands)
    c.engagement.bands.push_back({band.entry_angle, band.exit_angle, band.bottom, band.top});
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
  m.corner_radius = c.tool.edge.corner_radius;
  m.edge_angle = c.tool.edge.edge_angle;
  m.pitch = c.tool.pitch;
  m.cut_time_before = c.cut_time_before;
  m.spindle_speed = c.spindle_speed;
  m.feed_per_tooth = c.engagement.feed_per_tooth;
  m.axial_depth = c.engagement.axial_depth;
  m.entry_angle = c.engagement.entry;
  m.exit_angle = c.engagement.exit;
  m.bands.clear();
  for (const EngagementBand& band : c.engagement.bands) {
    m.bands.emplace_back();
    m.bands.back().entry_angle = band.entry;
    m.bands.back().exit_angle = band.exit;
    m.bands.back().bottom = band.bottom;
    m.bands.back().top = band.top;
  }
  setPoint(c.steady_from, m.steady_from);
  setPoint(c.steady_to, m.steady_to);
}

template <class M>
void read(const M& m, ForceBlock& block) {
  requireRate(m.sample_rate);
  requireLength("fy", m.fy.size(), m.fx.size());
  requireLength("fz", m.fz.size(), m.fx.size());
  if (m.status > M::IMPLAUSIBLE) throw Error("status: " + std::to_string(m.status) + " is unknown");
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

}  // namespace smartmill::conversion
