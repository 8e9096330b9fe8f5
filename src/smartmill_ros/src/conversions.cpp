#include "smartmill_ros/conversions.h"

#include <cmath>
#include <string>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

void requireLength(const char* field, std::size_t length, std::size_t due) {
  if (length != due) {
    throw Error(std::string(field) + ": " + std::to_string(length) + " values where " + std::to_string(due) +
                " are due");
  }
}

void requireRate(double rate) {
  if (!(rate > 0.0) || !std::isfinite(rate)) {
    throw Error("sample_rate: " + std::to_string(rate) + " Hz, above 0 is due");
  }
}

std::array<double, 3> fromPoint(const geometry_msgs::Point& p) {
  return {p.x, p.y, p.z};
}

geometry_msgs::Point toPoint(const std::array<double, 3>& p) {
  geometry_msgs::Point point;
  point.x = p[0];
  point.y = p[1];
  point.z = p[2];
  return point;
}

// A series that the core leaves empty when unknown is all NaN in a message.
std::vector<double> orUnknown(const std::vector<double>& values, std::size_t size) {
  return values.empty() ? std::vector<double>(size, NOT_A_NUMBER) : values;
}

}  // namespace

double toSec(const ros::Time& stamp) {
  return stamp.toSec();
}

ros::Time fromSec(double stamp) {
  if (!std::isfinite(stamp) || stamp < 0.0 || stamp > 4294967295.0) {
    throw Error("stamp: " + std::to_string(stamp) + " s is no time");
  }
  ros::Time time;
  time.fromSec(stamp);
  return time;
}

SampleBlock fromMsg(const smartmill_msgs::SampleBlock& m) {
  requireRate(m.sample_rate);
  requireLength("units", m.units.size(), m.channels.size());
  if (m.channels.empty() || m.samples.size() % m.channels.size() != 0) {
    throw Error("samples: " + std::to_string(m.samples.size()) + " values do not fill " +
                std::to_string(m.channels.size()) + " channels");
  }
  SampleBlock block;
  block.stamp = toSec(m.header.stamp);
  block.sample_rate = m.sample_rate;
  block.first_index = m.first_index;
  block.channels = m.channels;
  block.units = m.units;
  block.samples = m.samples;
  return block;
}

smartmill_msgs::SampleBlock toMsg(const SampleBlock& block, const std::string& frame_id) {
  smartmill_msgs::SampleBlock m;
  m.header.stamp = fromSec(block.stamp);
  m.header.frame_id = frame_id;
  m.sample_rate = block.sample_rate;
  m.first_index = block.first_index;
  m.channels = block.channels;
  m.units = block.units;
  m.samples = block.samples;
  return m;
}

SpindleAngle fromMsg(const smartmill_msgs::SpindleAngle& m) {
  if (!std::isfinite(m.angle) || !std::isfinite(m.speed)) throw Error("spindle angle: not a finite number");
  return {toSec(m.header.stamp), m.angle, m.speed};
}

smartmill_msgs::SpindleAngle toMsg(const SpindleAngle& angle) {
  smartmill_msgs::SpindleAngle m;
  m.header.stamp = fromSec(angle.stamp);
  m.angle = angle.angle;
  m.speed = angle.speed;
  return m;
}

CncState fromMsg(const smartmill_msgs::CncState& m) {
  requireLength("position", m.position.size(), m.axes.size());
  requireLength("distance_to_go", m.distance_to_go.size(), m.axes.size());
  CncState state;
  state.stamp = toSec(m.header.stamp);
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
  return state;
}

smartmill_msgs::CncState toMsg(const CncState& state) {
  smartmill_msgs::CncState m;
  m.header.stamp = fromSec(state.stamp);
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
  return m;
}

LoadSample fromMsg(const smartmill_msgs::LoadSample& m) {
  requireLength("axis_load", m.axis_load.size(), m.axes.size());
  return {toSec(m.header.stamp), m.spindle_load, m.spindle_speed, m.axes, m.axis_load};
}

smartmill_msgs::LoadSample toMsg(const LoadSample& load) {
  smartmill_msgs::LoadSample m;
  m.header.stamp = fromSec(load.stamp);
  m.spindle_load = load.spindle_load;
  m.spindle_speed = load.spindle_speed;
  m.axes = load.axes;
  m.axis_load = load.axis_load;
  return m;
}

CuttingCondition fromMsg(const smartmill_msgs::CuttingCondition& m) {
  if (m.kind > smartmill_msgs::CuttingCondition::CUT)
    throw Error("kind: " + std::to_string(m.kind) + " is no condition");
  CuttingCondition c;
  c.stamp = toSec(m.header.stamp);
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
  return c;
}

smartmill_msgs::CuttingCondition toMsg(const CuttingCondition& c) {
  smartmill_msgs::CuttingCondition m;
  m.header.stamp = fromSec(c.stamp);
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
  m.steady_from = toPoint(c.steady_from);
  m.steady_to = toPoint(c.steady_to);
  return m;
}

ForceBlock fromMsg(const smartmill_msgs::ForceBlock& m) {
  requireRate(m.sample_rate);
  requireLength("fy", m.fy.size(), m.fx.size());
  requireLength("fz", m.fz.size(), m.fx.size());
  if (m.status > smartmill_msgs::ForceBlock::SETTLING)
    throw Error("status: " + std::to_string(m.status) + " is unknown");
  ForceBlock block;
  block.stamp = toSec(m.header.stamp);
  block.sample_rate = m.sample_rate;
  block.first_index = m.first_index;
  block.force = {m.fx, m.fy, m.fz};
  block.status = static_cast<ForceBlock::Status>(m.status);
  return block;
}

smartmill_msgs::ForceBlock toMsg(const ForceBlock& block, const std::string& frame_id) {
  smartmill_msgs::ForceBlock m;
  m.header.stamp = fromSec(block.stamp);
  m.header.frame_id = frame_id;
  m.sample_rate = block.sample_rate;
  m.first_index = block.first_index;
  m.fx = block.force[0];
  m.fy = block.force[1];
  m.fz = block.force[2];
  m.status = static_cast<std::uint8_t>(block.status);
  return m;
}

MeasuredFrf fromMsg(const smartmill_msgs::Frf& m) {
  const std::size_t n = m.frequency.size();
  requireLength("real", m.real.size(), n);
  requireLength("imag", m.imag.size(), n);
  requireLength("coherence", m.coherence.size(), n);
  requireLength("standard_deviation", m.standard_deviation.size(), n);
  MeasuredFrf measured;
  measured.stamp = toSec(m.header.stamp);
  measured.tool = m.tool;
  measured.point = m.point;
  measured.direction = m.direction;
  measured.frf.unit = m.unit;
  measured.frf.averages = static_cast<int>(m.averages);
  measured.frf.frequency = m.frequency;
  measured.frf.coherence = m.coherence;
  measured.frf.std_dev = m.standard_deviation;
  for (std::size_t i = 0; i < n; ++i) measured.frf.value.emplace_back(m.real[i], m.imag[i]);
  return measured;
}

smartmill_msgs::Frf toMsg(const MeasuredFrf& measured) {
  smartmill_msgs::Frf m;
  m.header.stamp = fromSec(measured.stamp);
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
  return m;
}

MeasuredModes fromMsg(const smartmill_msgs::ModalModel& m) {
  MeasuredModes measured;
  measured.stamp = toSec(m.header.stamp);
  measured.tool = m.tool;
  measured.point = m.point;
  measured.direction = m.direction;
  measured.unit = m.unit;
  measured.relative_error = m.relative_error;
  measured.model.direct = m.direct;
  measured.model.direct_std = m.direct_std;
  for (const smartmill_msgs::Mode& mode : m.modes) {
    measured.model.modes.push_back({mode.frequency, mode.damping_ratio, mode.gain, mode.frequency_std,
                                    mode.damping_ratio_std, mode.gain_std});
  }
  return measured;
}

smartmill_msgs::ModalModel toMsg(const MeasuredModes& measured) {
  smartmill_msgs::ModalModel m;
  m.header.stamp = fromSec(measured.stamp);
  m.tool = measured.tool;
  m.point = measured.point;
  m.direction = measured.direction;
  m.unit = measured.unit;
  m.relative_error = measured.relative_error;
  m.direct = measured.model.direct;
  m.direct_std = measured.model.direct_std;
  for (const Mode& mode : measured.model.modes) {
    smartmill_msgs::Mode out;
    out.frequency = mode.frequency;
    out.damping_ratio = mode.damping_ratio;
    out.gain = mode.gain;
    out.frequency_std = mode.frequency_std;
    out.damping_ratio_std = mode.damping_ratio_std;
    out.gain_std = mode.gain_std;
    m.modes.push_back(out);
  }
  return m;
}

CoefficientSet fromMsg(const smartmill_msgs::CuttingCoefficients& m) {
  CoefficientSet set;
  set.stamp = toSec(m.header.stamp);
  set.tool = m.tool;
  set.material = m.material;
  set.source = m.source;
  set.value = {m.ktc, m.krc, m.kac, m.kte, m.kre, m.kae};
  set.std_dev = {m.ktc_std, m.krc_std, m.kac_std, m.kte_std, m.kre_std, m.kae_std};
  set.friction_viscous = m.friction_viscous;
  set.friction_coulomb = m.friction_coulomb;
  set.tests = static_cast<int>(m.test_count);
  return set;
}

smartmill_msgs::CuttingCoefficients toMsg(const CoefficientSet& set) {
  smartmill_msgs::CuttingCoefficients m;
  m.header.stamp = fromSec(set.stamp);
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
  return m;
}

StabilityPoint fromMsg(const smartmill_msgs::StabilityPoint& m) {
  return {m.spindle_speed, m.axial_depth, m.depth_limit,          m.chatter_frequency,
          m.torque,        m.power,       m.material_removal_rate};
}

smartmill_msgs::StabilityPoint toMsg(const StabilityPoint& point) {
  smartmill_msgs::StabilityPoint m;
  m.spindle_speed = point.spindle_speed;
  m.axial_depth = point.axial_depth;
  m.depth_limit = point.depth_limit;
  m.chatter_frequency = point.chatter_frequency;
  m.torque = point.torque;
  m.power = point.power;
  m.material_removal_rate = point.material_removal_rate;
  return m;
}

StabilityChart fromMsg(const smartmill_msgs::StabilityChart& m) {
  const std::size_t n = m.spindle_speed.size();
  requireLength("depth_limit", m.depth_limit.size(), n);
  requireLength("chatter_frequency", m.chatter_frequency.size(), n);
  requireLength("torque_depth_limit", m.torque_depth_limit.size(), n);
  requireLength("power_depth_limit", m.power_depth_limit.size(), n);
  StabilityChart chart;
  chart.stamp = toSec(m.header.stamp);
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
  for (const smartmill_msgs::StabilityPoint& point : m.recommended)
    chart.recommended.push_back(fromMsg(point));
  for (const smartmill_msgs::StabilityPoint& point : m.unstable) chart.unstable.push_back(fromMsg(point));
  return chart;
}

smartmill_msgs::StabilityChart toMsg(const StabilityChart& chart) {
  smartmill_msgs::StabilityChart m;
  m.header.stamp = fromSec(chart.stamp);
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
  for (const StabilityPoint& point : chart.recommended) m.recommended.push_back(toMsg(point));
  for (const StabilityPoint& point : chart.unstable) m.unstable.push_back(toMsg(point));
  return m;
}

}  // namespace smartmill
