// Reads and writes the calibration of a spindle-integrated force sensor.

#include <algorithm>
#include <cmath>
#include <fstream>

#include "smartmill_core/error.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"

namespace smartmill::kalman {
namespace {

constexpr const char* FORMAT = "smartmill-spindle-sensor/1";

LengthDependence readLengthDependence(const StrictYaml& yaml) {
  LengthDependence line;
  line.slope = yaml.number("slope_per_mm") / units::MM;
  line.offset = yaml.number("offset");
  if (yaml.has("line_of")) line.reciprocal = yaml.oneOf("line_of", {"constant", "share"}) == "share";
  if (const auto s = yaml.optionalNumber("slope_per_mm_std", Range::notNegative()))
    line.slope_std = *s / units::MM;
  if (const auto s = yaml.optionalNumber("offset_std", Range::notNegative())) line.offset_std = *s;
  yaml.finish();
  return line;
}

std::string text(const std::string& key, const LengthDependence& line) {
  std::string out =
      key + ": {slope_per_mm: " + yamlNumber(line.slope * units::MM) + ", offset: " + yamlNumber(line.offset);
  if (std::isfinite(line.slope_std)) out += ", slope_per_mm_std: " + yamlNumber(line.slope_std * units::MM);
  if (std::isfinite(line.offset_std)) out += ", offset_std: " + yamlNumber(line.offset_std);
  return out + (line.reciprocal ? ", line_of: share}\n" : "}\n");
}

ModalModel readDynamics(const StrictYaml& yaml) {
  ModalModel model;
  model.direct = 1.0;
  for (const StrictYaml& entry : yaml.maps("modes")) {
    Mode mode;
    mode.frequency = entry.number("frequency_hz", Range::positive());
    mode.damping_ratio = entry.number("damping_ratio", {0.0, 1.0, true, true});
    mode.gain = entry.number("gain");
    entry.finish();
    model.direct -= mode.gain;
    model.modes.push_back(mode);
  }
  yaml.finish();
  return model;
}

std::string text(const std::string& key, const ModalModel& model) {
  if (model.modes.empty()) return "";
  std::string out = key + ":\n  modes:\n";
  for (const Mode& mode : model.modes) {
    out += "  - {frequency_hz: " + yamlNumber(mode.frequency) +
           ", damping_ratio: " + yamlNumber(mode.damping_ratio) + ", gain: " + yamlNumber(mode.gain) + "}\n";
  }
  return out;
}

}  // namespace

SpindleSensorCalibration readSpindleSensor(const std::string& file) {
  const StrictYaml yaml = StrictYaml::fromFile(file);
  yaml.oneOf("format", {FORMAT});
  SpindleSensorCalibration c;
  c.x = readLengthDependence(yaml.map("x"));
  c.y = readLengthDependence(yaml.map("y"));
  c.z = readLengthDependence(yaml.map("z"));
  const auto cross = [&](const char* key, std::optional<LengthDependence>& line, ModalModel& dynamics) {
    if (const auto map = yaml.optionalMap(key)) line = readLengthDependence(*map);
    const std::string dynamic = std::string("dynamic_") + key;
    if (const auto map = yaml.optionalMap(dynamic)) {
      if (!line) yaml.fail(dynamic, "expected a static cross-talk " + std::string(key));
      dynamics = readDynamics(*map);
    }
  };
  cross("yx", c.yx, c.dynamic_yx);
  cross("yz", c.yz, c.dynamic_yz);
  cross("xz", c.xz, c.dynamic_xz);
  if (yaml.has("length_mm")) {
    const auto lengths = yaml.numbers("length_mm", 2, Range::positive());
    c.lengths = {lengths[0] * units::MM, lengths[1] * units::MM};
  }
  const auto preload = yaml.numbers("preload_n", 6, Range::positive());
  std::copy(preload.begin(), preload.end(), c.preload.begin());
  c.least_compression = yaml.optionalNumber("least_compression_n", Range::notNegative()).value_or(0.0);
  c.range_limit = yaml.optionalNumber("range_limit_n", Range::positive()).value_or(c.range_limit);
  c.low_pass = yaml.optionalNumber("low_pass_hz", Range::notNegative()).value_or(0.0);
  c.drift_std = yaml.optionalNumber("drift_std_n_per_s", Range::positive()).value_or(c.drift_std);
  if (const auto map = yaml.optionalMap("unbalance")) {
    const auto re = map->numbers("cos_kg_m", 3), im = map->numbers("sin_kg_m", 3);
    const auto std_dev = map->numbers("std_kg_m", 3, Range::notNegative());
    for (std::size_t axis = 0; axis < 3; ++axis) {
      c.unbalance[axis] = {re[axis], -im[axis]};
      c.unbalance_std[axis] = std_dev[axis];
    }
    map->finish();
  }
  if (const auto section = yaml.optionalMap("memory_over_speed")) c.memory = readMemorySection(*section);
  yaml.finish();
  try {
    c.validate();
  } catch (const Error& e) {
    throw Error(file + ": " + e.what());
  }
  return c;
}

void writeSpindleSensor(const SpindleSensorCalibration& c, const std::string& file) {
  const auto list = [](const char* key, auto begin, auto end, auto value) {
    std::string out = std::string(key) + ": [";
    for (auto it = begin; it != end; ++it) out += (it == begin ? "" : ", ") + yamlNumber(value(*it));
    return out + "]";
  };
  const auto same = [](double v) { return v; };
  std::string out = std::string("format: ") + FORMAT + "\n# constants over the length of tool and holder\n";
  out += text("x", c.x) + text("y", c.y) + text("z", c.z);
  if (c.yx) out += text("yx", *c.yx) + text("dynamic_yx", c.dynamic_yx);
  if (c.yz) out += text("yz", *c.yz) + text("dynamic_yz", c.dynamic_yz);
  if (c.xz) out += text("xz", *c.xz) + text("dynamic_xz", c.dynamic_xz);
  if (std::isfinite(c.lengths[1])) {
    out += "# valid range, length of tool and holder\n" +
           list("length_mm", c.lengths.begin(), c.lengths.end(), [](double l) { return l / units::MM; }) +
           "\n";
  }
  out += "# of x1 x2 y1 y2 z1 z2\n" + list("preload_n", c.preload.begin(), c.preload.end(), same) + "\n";
  out += "least_compression_n: " + yamlNumber(c.least_compression) + "\n";
  if (std::isfinite(c.range_limit)) out += "range_limit_n: " + yamlNumber(c.range_limit) + "\n";
  out += "low_pass_hz: " + yamlNumber(c.low_pass) + "\n";
  out += "drift_std_n_per_s: " + yamlNumber(c.drift_std) + "\n";
  if (*std::max_element(c.unbalance_std.begin(), c.unbalance_std.end()) > 0.0) {
    const auto& u = c.unbalance;
    out +=
        "# F = (cos_kg_m cos(angle) + sin_kg_m sin(angle)) w^2, angle and speed w of the "
        "spindle\nunbalance:\n";
    out += "  " + list("cos_kg_m", u.begin(), u.end(), [](auto v) { return v.real(); }) + "\n";
    out += "  " + list("sin_kg_m", u.begin(), u.end(), [](auto v) { return -v.imag(); }) + "\n";
    out += "  " + list("std_kg_m", c.unbalance_std.begin(), c.unbalance_std.end(), same) + "\n";
  }
  out += memorySection(c.memory);
  std::ofstream stream(file);
  stream << out;
  stream.close();
  if (!stream) throw Error(file + ": cannot write");
}

}  // namespace smartmill::kalman
