#pragma once

#include <algorithm>
#include <complex>
#include <cstdint>
#include <string>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_core/error.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_recording/conversion/fields.h"

/// FRFs, modes, coefficients, force curves and stability charts; the goal of a measurement.
namespace smartmill::conversion {

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

}  // namespace smartmill::conversion
