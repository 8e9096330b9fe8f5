#include <cmath>
#include <sstream>

#include "machine_model_format.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

std::string list(const std::vector<double>& values, double unit) {
  std::string text = "[";
  for (const double v : values) text += (text.size() > 1 ? ", " : "") + yamlNumber(v / unit);
  return text + "]";
}

std::string point(const Axes3& p, double unit) {
  return list({p[0], p[1], p[2]}, unit);
}

void writeKey(std::ostream& out, const std::string& indent, const std::string& key, double value) {
  out << indent << key << ": " << yamlNumber(value) << "\n";
}

void writeOptional(std::ostream& out, const char* key, const std::optional<double>& value, double unit) {
  if (value) writeKey(out, "  ", key, *value / unit);
}

void writeModes(std::ostream& out, const std::string& indent, const std::string& key,
                const std::vector<Mode>& modes, ModeKind kind) {
  out << indent << key << ":" << (modes.empty() ? " []" : "") << "\n";
  for (const Mode& mode : modes) {
    std::string text;
    const auto add = [&text](const std::string& name, double value, double std_dev) {
      text += (text.empty() ? "" : ", ") + name + ": " + yamlNumber(value);
      if (std::isfinite(std_dev)) text += ", " + name + "_std: " + yamlNumber(std_dev);
    };
    add("frequency_hz", mode.frequency, mode.frequency_std);
    add("damping_ratio", mode.damping_ratio, mode.damping_ratio_std);
    if (kind == ModeKind::stiffness) {
      const double stiffness = 1.0 / mode.gain / units::N_PER_UM;
      add("stiffness_n_per_um", stiffness, stiffness * mode.gain_std / mode.gain);
    } else {
      add("gain", mode.gain, mode.gain_std);
    }
    out << indent << "- {" << text << "}\n";
  }
}

void writeEffect(std::ostream& out, const EffectEntry& effect) {
  const EffectKind* kind = findEffect(effect.name);
  if (!kind) throw Error("model: effects: '" + effect.name + "' is not an effect of the catalogue");
  out << "- name: " << (kind->empirical() ? EMPIRICAL : yamlWord(effect.name)) << "\n";
  if (kind->empirical())
    out << "  stage: " << yamlWord(kind->form_stage) << "\n  form: " << yamlWord(kind->form) << "\n";
  for (const EffectParameter& p : kind->parameters) {
    switch (p.value) {
      case EffectValue::number: {
        const auto value = effect.numbers.find(p.key);
        if (value != effect.numbers.end()) writeKey(out, "  ", p.key, value->second);
        const auto std_dev = effect.std_devs.find(p.key);
        if (std_dev != effect.std_devs.end()) writeKey(out, "  ", p.key + "_std", std_dev->second);
        break;
      }
      case EffectValue::word: {
        const auto value = effect.words.find(p.key);
        if (value != effect.words.end()) out << "  " << p.key << ": " << yamlWord(value->second) << "\n";
        break;
      }
      case EffectValue::list:
      case EffectValue::series:
      case EffectValue::table: {
        const auto values = effect.lists.find(p.key);
        if (values == effect.lists.end()) break;
        out << "  " << p.key << ": " << list(values->second, 1.0) << "\n";
        std::vector<double> stds;
        for (std::size_t k = 0; k < values->second.size(); ++k) {
          const auto std_dev = effect.std_devs.find(itemOf(p.key, k));
          if (std_dev != effect.std_devs.end()) stds.push_back(std_dev->second);
        }
        if (stds.size() == values->second.size()) out << "  " << p.key << "_std: " << list(stds, 1.0) << "\n";
        break;
      }
      case EffectValue::modes:
        writeModes(out, "  ", p.key, (p.key == "x" ? effect.flexibility.x : effect.flexibility.y).modes,
                   ModeKind::stiffness);
        break;
    }
  }
}

void writeTool(std::ostream& out, const MachineModel& model) {
  const ToolGeometry& tool = *model.tool;
  out << "tool:\n  teeth: " << tool.teeth << "\n";
  writeKey(out, "  ", "diameter_mm", tool.diameter / units::MM);
  const EdgeShape& edge = tool.edge;
  if (edge.helix.empty()) {
    writeKey(out, "  ", "helix_deg", units::degFromRad(tool.helix));
  } else {
    out << "  helix_deg: " << list(edge.helix, units::radFromDeg(1.0)) << "\n";
  }
  if (edge.corner_radius > 0.0) writeKey(out, "  ", "corner_radius_mm", edge.corner_radius / units::MM);
  if (edge.edge_angle < 0.5 * units::PI)
    writeKey(out, "  ", "edge_angle_deg", units::degFromRad(edge.edge_angle));
  if (edge.serrated()) {
    out << "  serration: {amplitude_mm: " << yamlNumber(edge.serration_amplitude / units::MM)
        << ", wavelength_mm: " << yamlNumber(edge.serration_wavelength / units::MM) << "}\n";
  }
  if (!tool.pitch.empty()) out << "  pitch_deg: " << list(tool.pitch, units::radFromDeg(1.0)) << "\n";
  writeOptional(out, "stickout_mm", model.stickout, units::MM);
  writeOptional(out, "edge_height_mm", model.edge_height, units::MM);
  writeOptional(out, "holder_diameter_mm", model.holder_diameter, units::MM);
}

void writeToolTip(std::ostream& out, const MachineModel& model) {
  if (model.tool_tip.x.modes.empty() && model.tool_tip.y.modes.empty()) return;
  out << "tool_tip:\n";
  writeModes(out, "  ", "x", model.tool_tip.x.modes, ModeKind::stiffness);
  writeModes(out, "  ", "y", model.tool_tip.y.modes, ModeKind::stiffness);
}

void writeChannels(std::ostream& out, const SensorChannels& sensor) {
  out << "  channels:\n    unit: " << yamlWord(sensor.unit) << "\n    components: " << sensor.components
      << "\n";
  if (sensor.noise_rms) writeKey(out, "    ", "noise_rms", *sensor.noise_rms);
  out << "    list:\n";
  for (const SensorChannel& c : sensor.channels) {
    out << "    - {name: " << yamlWord(c.name);
    if (!c.response.empty()) {
      out << ", response: " << list(c.response, 1.0);
    } else {
      out << ", direction: " << point(c.direction, 1.0) << ", position_mm: " << point(c.position, units::MM)
          << ", n_per_unit: " << yamlNumber(c.force_per_unit);
    }
    out << "}\n";
  }
}

void writeFrames(std::ostream& out, const FramePoses& poses) {
  if (poses.empty()) return;
  out << "frames:\n";
  for (const auto& [name, pose] : poses) {
    out << "  " << name << ": {parent: " << pose.parent
        << ", position_mm: " << point(pose.position, units::MM)
        << ", rotation_xyzw: " << list({pose.rotation.begin(), pose.rotation.end()}, 1.0) << "}\n";
  }
}

void writeForceSensor(std::ostream& out, const ForceSensor& sensor) {
  out << "force_sensor:\n";
  for (std::size_t a = 0; a < 3; ++a)
    writeModes(out, "  ", AXIS_NAMES[a], sensor.axis[a].modes, ModeKind::gain);
  if (sensor.noise_rms) out << "  noise_rms_n: " << point(*sensor.noise_rms, 1.0) << "\n";
  if (sensor.measures_workpiece) out << "  measures: force_on_workpiece\n";
  if (sensor.channels) writeChannels(out, *sensor.channels);
  if (sensor.mean_samples) out << "  samples: mean\n";
}

void writeSpindle(std::ostream& out, const Spindle& s) {
  out << "spindle:\n";
  writeKey(out, "  ", "viscous_nm_s_per_rad", s.viscous);
  writeKey(out, "  ", "coulomb_nm", s.coulomb);
  writeKey(out, "  ", "load_meter_v_per_w", s.load_meter_gain);
  writeKey(out, "  ", "load_meter_bandwidth_hz", s.load_meter_bandwidth);
  writeKey(out, "  ", "load_meter_resolution_v", s.load_meter_resolution);
  if (s.friction_zero_below > 0.0) {
    writeKey(out, "  ", "friction_zero_below_rpm", units::rpmFromRadPerSec(s.friction_zero_below));
  }
  writeOptional(out, "load_meter_full_scale_v", s.load_meter_full_scale, 1.0);
  writeOptional(out, "max_speed_rpm", s.max_speed, units::radPerSecFromRpm(1.0));
  writeOptional(out, "rated_torque_nm", s.rated_torque, 1.0);
  writeOptional(out, "rated_power_w", s.rated_power, 1.0);
  writeOptional(out, "acceleration_rpm_per_s", s.acceleration, units::radPerSecFromRpm(1.0));
}

void writeAxes(std::ostream& out, const MachineAxes& axes) {
  out << "axes:\n";
  for (std::size_t a = 0; a < 3; ++a) {
    out << "  " << AXIS_NAMES[a] << "_travel_mm: " << list({axes.travel[a][0], axes.travel[a][1]}, units::MM)
        << "\n";
  }
  writeKey(out, "  ", "rapid_mm_per_min", axes.rapid * 60.0 / units::MM);
  writeKey(out, "  ", "acceleration_mm_per_s2", axes.acceleration / units::MM);
  out << "  home_mm: " << point(axes.home, units::MM) << "\n";
}

void writeHammer(std::ostream& out, const HammerStation& h) {
  out << "hammer:\n";
  writeKey(out, "  ", "offset_mm", h.offset / units::MM);
  if (h.opposite) {
    out << "  opposite:\n";
    writeKey(out, "    ", "distance_mm", h.opposite->distance / units::MM);
    writeKey(out, "    ", "stroke_mm", h.opposite->stroke / units::MM);
  }
  writeKey(out, "  ", "peak_force_n", h.peak_force);
  writeKey(out, "  ", "contact_time_us", h.contact_time / 1e-6);
  writeKey(out, "  ", "force_noise_rms_n", h.force_noise_rms);
  writeKey(out, "  ", "gap_at_zero_volt_um", h.gap_at_zero_volt / units::UM);
  writeKey(out, "  ", "gain_v", h.gain_volt);
  writeKey(out, "  ", "range_v", h.range_volt);
  writeKey(out, "  ", "voltage_noise_rms_v", h.voltage_noise_rms);
  writeKey(out, "  ", "flute_depth_mm", h.flute_depth / units::MM);
  out << "  position_mm:" << (h.position.empty() ? " {}" : "") << "\n";
  for (const auto& [direction, p] : h.position)
    out << "    " << direction << ": " << point(p, units::MM) << "\n";
}

void writeWorkpiece(std::ostream& out, const MachineModel& model) {
  if (!model.workpiece && model.workpiece_modes.empty()) return;
  out << "workpiece:\n";
  if (const auto& stock = model.workpiece) {
    out << "  material: " << yamlWord(stock->material) << "\n";
    out << "  low_mm: " << point(stock->low, units::MM) << "\n";
    out << "  high_mm: " << point(stock->high, units::MM) << "\n";
  }
  if (!model.workpiece_modes.empty()) out << "  modes:\n";
  for (const WorkpieceModes& place : model.workpiece_modes) {
    writeKey(out, "  - ", "position_mm", place.position / units::MM);
    writeModes(out, "    ", "x", place.x.modes, ModeKind::stiffness);
    writeModes(out, "    ", "y", place.y.modes, ModeKind::stiffness);
  }
}

void writeUncertainty(std::ostream& out, const Uncertainty& u) {
  out << "uncertainty_percent: {cutting: " << yamlNumber(u.cutting)
      << ", frequency: " << yamlNumber(u.frequency) << ", damping: " << yamlNumber(u.damping)
      << ", stiffness: " << yamlNumber(u.stiffness) << ", spindle: " << yamlNumber(u.spindle) << "}\n";
}

}  // namespace

std::string cuttingSection(const CuttingCoefficients& value, const CuttingCoefficients& std_dev) {
  std::ostringstream out;
  out << "cutting:\n";
  for (const CuttingKey& k : cuttingKeys()) {
    const double v = value.*k.coefficient, s = std_dev.*k.coefficient;
    if (std::isfinite(v)) writeKey(out, "  ", k.key, v / k.unit);
    if (std::isfinite(v) && std::isfinite(s)) writeKey(out, "  ", std::string(k.key) + "_std", s / k.unit);
  }
  return out.str();
}

void writeMachineModel(const MachineModel& model, const std::string& file) {
  std::ostringstream out;
  out << "format: " << MODEL_FORMAT << "\n";
  if (model.tool) writeTool(out, model);
  if (model.cutting) out << cuttingSection(*model.cutting, model.cutting_std.value_or(NOT_IDENTIFIED));
  writeToolTip(out, model);
  writeForceSensor(out, model.force_sensor);
  writeFrames(out, model.frames);
  if (model.spindle) writeSpindle(out, *model.spindle);
  if (model.axes) writeAxes(out, *model.axes);
  if (model.hammer) writeHammer(out, *model.hammer);
  writeWorkpiece(out, model);
  out << "effects:" << (model.effects.empty() ? " []" : "") << "\n";
  for (const EffectEntry& effect : model.effects) writeEffect(out, effect);
  writeUncertainty(out, model.uncertainty);
  writeText(file, out.str());
}

}  // namespace smartmill
