#include "smartmill_core/model/machine_model.h"

#include <cmath>
#include <limits>
#include <numeric>
#include <sstream>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/units.h"

namespace smartmill {

namespace {

constexpr double NOT_KNOWN = std::numeric_limits<double>::quiet_NaN();
constexpr const char* FORMAT = "smartmill-model/1";
// Pitch lists have few digits.
constexpr double PITCH_SUM_TOLERANCE_DEG = 1e-3;

const Range ANY{};
const Range POSITIVE = Range::positive();
const Range NOT_NEGATIVE = Range::notNegative();
const Range HELIX_DEG{0.0, 80.0, false, true};
const Range DAMPING{0.0, 1.0, true, true};

/// Key of a mode's static gain in the file.
enum class ModeKind { stiffness, gain };

double stdDev(const StrictYaml& map, const std::string& key) {
  return map.optionalNumber(key + "_std", NOT_NEGATIVE).value_or(NOT_KNOWN);
}

std::vector<Mode> readModes(const StrictYaml& parent, const std::string& key, ModeKind kind) {
  std::vector<Mode> modes;
  if (!parent.has(key)) return modes;
  for (const StrictYaml& map : parent.maps(key)) {
    Mode mode;
    mode.frequency = map.number("frequency_hz", POSITIVE);
    mode.frequency_std = stdDev(map, "frequency_hz");
    mode.damping_ratio = map.number("damping_ratio", DAMPING);
    mode.damping_ratio_std = stdDev(map, "damping_ratio");
    if (kind == ModeKind::stiffness) {
      const double stiffness = map.number("stiffness_n_per_um", POSITIVE);
      mode.gain = 1.0 / (stiffness * units::N_PER_UM);
      mode.gain_std = mode.gain * stdDev(map, "stiffness_n_per_um") / stiffness;
    } else {
      mode.gain = map.number("gain", ANY);
      mode.gain_std = stdDev(map, "gain");
    }
    map.finish();
    modes.push_back(mode);
  }
  return modes;
}

// One value per tooth (teeth 0: any number). @param sum of the pitches
std::vector<double> readPerTooth(const StrictYaml& map, const std::string& key, std::size_t teeth,
                                 const Range& range, std::optional<double> sum) {
  const std::vector<double> list = map.numbers(key, teeth, range);
  const double is = std::accumulate(list.begin(), list.end(), 0.0);
  if (sum && std::abs(is - *sum) > PITCH_SUM_TOLERANCE_DEG)
    map.fail(key, "the pitches sum to " + yamlNumber(is) + ", expected " + shortNumber(*sum));
  return list;
}

void readTool(const StrictYaml& map, MachineModel& model) {
  ToolGeometry tool;
  tool.teeth = map.integer("teeth", 1, 20);
  tool.diameter = map.number("diameter_mm", POSITIVE) * units::MM;
  tool.helix = units::radFromDeg(map.number("helix_deg", HELIX_DEG));
  if (map.has("pitch_deg")) {
    for (const double p :
         readPerTooth(map, "pitch_deg", static_cast<std::size_t>(tool.teeth), POSITIVE, 360.0)) {
      tool.pitch.push_back(units::radFromDeg(p));
    }
  }
  if (const auto stickout = map.optionalNumber("stickout_mm", POSITIVE))
    model.stickout = *stickout * units::MM;
  map.finish();
  model.tool = tool;
}

void readCutting(const StrictYaml& map, MachineModel& model) {
  CuttingCoefficients value = NOT_IDENTIFIED;
  CuttingCoefficients std_dev = value;
  bool any_std = false;
  for (const CuttingKey& k : cuttingKeys()) {
    if (const auto number = map.optionalNumber(k.key, NOT_NEGATIVE)) value.*k.coefficient = *number * k.unit;
    const std::string std_key = std::string(k.key) + "_std";
    if (!map.has(std_key)) continue;
    std_dev.*k.coefficient = map.number(std_key, NOT_NEGATIVE) * k.unit;
    any_std = true;
  }
  map.finish();
  model.cutting = value;
  if (any_std) model.cutting_std = std_dev;
}

void readForceSensor(const StrictYaml& map, ForceSensor& sensor) {
  for (std::size_t a = 0; a < 3; ++a) {
    sensor.axis[a].modes = readModes(map, AXIS_NAMES[a], ModeKind::gain);
    double sum = 0.0;
    for (const Mode& mode : sensor.axis[a].modes) sum += mode.gain;
    // 0.9 + 0.1 in binary may exceed 1 by rounding.
    if (sum > 1.0 + 1e-9)
      map.fail(AXIS_NAMES[a], "the gains sum to " + yamlNumber(sum) + ", out of range (<= 1)");
    sensor.axis[a].direct = 1.0 - sum;
  }
  if (map.has("noise_rms_n")) {
    const std::vector<double> noise = map.numbers("noise_rms_n", 3, POSITIVE);
    sensor.noise_rms = Axes3{noise[0], noise[1], noise[2]};
  }
  if (map.has("measures")) {
    sensor.measures_workpiece =
        map.oneOf("measures", {"force_on_tool", "force_on_workpiece"}) == "force_on_workpiece";
  }
  if (map.has("samples")) sensor.mean_samples = map.oneOf("samples", {"instant", "mean"}) == "mean";
  map.finish();
}

Spindle readSpindle(const StrictYaml& map) {
  Spindle s;
  s.viscous = map.number("viscous_nm_s_per_rad", NOT_NEGATIVE);
  s.coulomb = map.number("coulomb_nm", ANY);
  s.load_meter_gain = map.number("load_meter_v_per_w", POSITIVE);
  s.load_meter_bandwidth = map.number("load_meter_bandwidth_hz", POSITIVE);
  s.load_meter_resolution = map.number("load_meter_resolution_v", POSITIVE);
  s.friction_zero_below =
      units::radPerSecFromRpm(map.optionalNumber("friction_zero_below_rpm", NOT_NEGATIVE).value_or(0.0));
  s.load_meter_full_scale = map.optionalNumber("load_meter_full_scale_v", POSITIVE);
  if (const auto rpm = map.optionalNumber("max_speed_rpm", POSITIVE))
    s.max_speed = units::radPerSecFromRpm(*rpm);
  s.rated_torque = map.optionalNumber("rated_torque_nm", POSITIVE);
  s.rated_power = map.optionalNumber("rated_power_w", POSITIVE);
  if (const auto rate = map.optionalNumber("acceleration_rpm_per_s", POSITIVE)) {
    s.acceleration = units::radPerSecFromRpm(*rate);
  }
  map.finish();
  return s;
}

Axes3 readPoint(const StrictYaml& map, const std::string& key) {
  const std::vector<double> p = map.numbers(key, 3);
  return {p[0] * units::MM, p[1] * units::MM, p[2] * units::MM};
}

MachineAxes readAxes(const StrictYaml& map) {
  MachineAxes axes;
  for (std::size_t a = 0; a < 3; ++a) {
    const std::string key = std::string(AXIS_NAMES[a]) + "_travel_mm";
    const std::vector<double> travel = map.numbers(key, 2);
    if (!(travel[1] > travel[0])) {
      map.fail(key, yamlNumber(travel[0]) + ".." + yamlNumber(travel[1]) + " is out of range (min < max)");
    }
    axes.travel[a] = {travel[0] * units::MM, travel[1] * units::MM};
  }
  axes.rapid = map.number("rapid_mm_per_min", POSITIVE) * units::MM / 60.0;
  axes.acceleration = map.number("acceleration_mm_per_s2", POSITIVE) * units::MM;
  if (map.has("home_mm")) axes.home = readPoint(map, "home_mm");
  map.finish();
  return axes;
}

HammerStation readHammer(const StrictYaml& map) {
  HammerStation h;
  h.offset = map.number("offset_mm", NOT_NEGATIVE) * units::MM;
  h.peak_force = map.number("peak_force_n", POSITIVE);
  h.contact_time = map.number("contact_time_us", POSITIVE) * 1e-6;
  h.force_noise_rms = map.number("force_noise_rms_n", NOT_NEGATIVE);
  h.gap_at_zero_volt = map.number("gap_at_zero_volt_um", POSITIVE) * units::UM;
  h.gain_volt = map.number("gain_v", POSITIVE);
  h.range_volt = map.number("range_v", POSITIVE);
  h.voltage_noise_rms = map.number("voltage_noise_rms_v", NOT_NEGATIVE);
  h.flute_depth = map.number("flute_depth_mm", POSITIVE) * units::MM;
  const StrictYaml position = map.map("position_mm");
  for (const char* direction : {"x", "y"}) {
    if (position.has(direction)) h.position[direction] = readPoint(position, direction);
  }
  position.finish();
  map.finish();
  return h;
}

Workpiece readWorkpiece(const StrictYaml& map) {
  Workpiece w;
  w.material = map.word("material");
  w.low = readPoint(map, "low_mm");
  w.high = readPoint(map, "high_mm");
  for (std::size_t a = 0; a < 3; ++a) {
    if (!(w.high[a] > w.low[a]))
      map.fail("high_mm", "expected a value above low_mm in " + std::string(AXIS_NAMES[a]));
  }
  map.finish();
  return w;
}

// The effect of an entry; an empirical one is identified by stage and form.
const EffectKind& kindOf(const StrictYaml& map) {
  const std::string name = map.word("name");
  if (name == EMPIRICAL) {
    const std::string stage = map.word("stage"), form = map.word("form");
    const EffectKind* kind = findEmpirical(stage, form);
    if (!kind)
      map.fail("form", "'" + form + "' is not a form of an empirical effect of stage '" + stage + "'");
    return *kind;
  }
  const EffectKind* kind = findEffect(name);
  if (!kind || kind->empirical()) map.fail("name", "'" + name + "' is not an effect of the catalogue");
  return *kind;
}

EffectEntry readEffect(const StrictYaml& map, const MachineModel& model) {
  const EffectKind* kind = &kindOf(map);
  EffectEntry effect;
  effect.name = kind->name;
  for (const EffectParameter& p : kind->parameters) {
    switch (p.value) {
      case EffectValue::number: {
        if (p.optional && !map.has(p.key)) {
          effect.numbers[p.key] = 0.0;
          break;
        }
        const double value = map.number(p.key, p.range);
        if (!p.allows(value)) map.fail(p.key, yamlNumber(value) + " is out of range (" + p.rangeText() + ")");
        effect.numbers[p.key] = value;
        if (map.has(p.key + "_std")) effect.std_devs[p.key] = map.number(p.key + "_std", NOT_NEGATIVE);
        break;
      }
      case EffectValue::word:
        effect.words[p.key] = map.oneOf(p.key, p.words);
        break;
      case EffectValue::list:
      case EffectValue::series:
      case EffectValue::table: {
        if (p.optional && !map.has(p.key)) break;
        const bool per_tooth = p.value == EffectValue::list && model.tool;
        const std::size_t teeth = per_tooth ? static_cast<std::size_t>(model.tool->teeth) : 0;
        effect.lists[p.key] = readPerTooth(map, p.key, teeth, p.range, p.sum);
        if (!map.has(p.key + "_std")) break;
        const std::vector<double> stds =
            map.numbers(p.key + "_std", effect.lists[p.key].size(), NOT_NEGATIVE);
        for (std::size_t k = 0; k < stds.size(); ++k) effect.std_devs[itemOf(p.key, k)] = stds[k];
        break;
      }
      case EffectValue::modes:
        (p.key == "x" ? effect.flexibility.x : effect.flexibility.y).modes =
            readModes(map, p.key, ModeKind::stiffness);
        break;
    }
  }
  map.finish();
  return effect;
}

Uncertainty readUncertainty(const StrictYaml& map) {
  Uncertainty u;
  u.cutting = map.optionalNumber("cutting", NOT_NEGATIVE).value_or(u.cutting);
  u.frequency = map.optionalNumber("frequency", NOT_NEGATIVE).value_or(u.frequency);
  u.damping = map.optionalNumber("damping", NOT_NEGATIVE).value_or(u.damping);
  u.stiffness = map.optionalNumber("stiffness", NOT_NEGATIVE).value_or(u.stiffness);
  u.spindle = map.optionalNumber("spindle", NOT_NEGATIVE).value_or(u.spindle);
  map.finish();
  return u;
}

template <typename Section>
const Section& need(const std::optional<Section>& section, const MachineModel& model, const char* name,
                    const std::string& why) {
  if (!section) throw Error(model.file + ": " + name + " is missing (needed to " + why + ")");
  return *section;
}

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
  writeKey(out, "  ", "helix_deg", units::degFromRad(tool.helix));
  if (!tool.pitch.empty()) out << "  pitch_deg: " << list(tool.pitch, units::radFromDeg(1.0)) << "\n";
  writeOptional(out, "stickout_mm", model.stickout, units::MM);
}

void writeToolTip(std::ostream& out, const MachineModel& model) {
  if (model.tool_tip.x.modes.empty() && model.tool_tip.y.modes.empty()) return;
  out << "tool_tip:\n";
  writeModes(out, "  ", "x", model.tool_tip.x.modes, ModeKind::stiffness);
  writeModes(out, "  ", "y", model.tool_tip.y.modes, ModeKind::stiffness);
}

void writeForceSensor(std::ostream& out, const ForceSensor& sensor) {
  out << "force_sensor:\n";
  for (std::size_t a = 0; a < 3; ++a)
    writeModes(out, "  ", AXIS_NAMES[a], sensor.axis[a].modes, ModeKind::gain);
  if (sensor.noise_rms) out << "  noise_rms_n: " << point(*sensor.noise_rms, 1.0) << "\n";
  if (sensor.measures_workpiece) out << "  measures: force_on_workpiece\n";
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

void writeWorkpiece(std::ostream& out, const Workpiece& workpiece) {
  out << "workpiece:\n  material: " << yamlWord(workpiece.material) << "\n";
  out << "  low_mm: " << point(workpiece.low, units::MM) << "\n";
  out << "  high_mm: " << point(workpiece.high, units::MM) << "\n";
}

void writeUncertainty(std::ostream& out, const Uncertainty& u) {
  out << "uncertainty_percent: {cutting: " << yamlNumber(u.cutting)
      << ", frequency: " << yamlNumber(u.frequency) << ", damping: " << yamlNumber(u.damping)
      << ", stiffness: " << yamlNumber(u.stiffness) << ", spindle: " << yamlNumber(u.spindle) << "}\n";
}

}  // namespace

const std::array<CuttingKey, 6>& cuttingKeys() {
  static const std::array<CuttingKey, 6> KEYS{
      CuttingKey{"Ktc_n_per_mm2", &CuttingCoefficients::ktc, units::N_PER_MM2},
      CuttingKey{"Krc_n_per_mm2", &CuttingCoefficients::krc, units::N_PER_MM2},
      CuttingKey{"Kac_n_per_mm2", &CuttingCoefficients::kac, units::N_PER_MM2},
      CuttingKey{"Kte_n_per_mm", &CuttingCoefficients::kte, units::N_PER_MM},
      CuttingKey{"Kre_n_per_mm", &CuttingCoefficients::kre, units::N_PER_MM},
      CuttingKey{"Kae_n_per_mm", &CuttingCoefficients::kae, units::N_PER_MM}};
  return KEYS;
}

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

const ToolGeometry& MachineModel::needTool(const std::string& why) const {
  return need(tool, *this, "tool", why);
}
const CuttingCoefficients& MachineModel::needCutting(const std::string& why) const {
  const CuttingCoefficients& value = need(cutting, *this, "cutting", why);
  for (const CuttingKey& k : cuttingKeys()) {
    if (!std::isfinite(value.*k.coefficient)) {
      throw Error(file + ": cutting." + k.key + " is missing (needed to " + why + ")");
    }
  }
  return value;
}
const Spindle& MachineModel::needSpindle(const std::string& why) const {
  return need(spindle, *this, "spindle", why);
}
const MachineAxes& MachineModel::needAxes(const std::string& why) const {
  return need(axes, *this, "axes", why);
}
const HammerStation& MachineModel::needHammer(const std::string& why) const {
  return need(hammer, *this, "hammer", why);
}
const Workpiece& MachineModel::needWorkpiece(const std::string& why) const {
  return need(workpiece, *this, "workpiece", why);
}

MachineModel readMachineModel(const std::string& file) {
  const StrictYaml root = StrictYaml::fromFile(file);
  MachineModel model;
  model.file = file;
  root.oneOf("format", {FORMAT});
  if (const auto map = root.optionalMap("tool")) readTool(*map, model);
  if (const auto map = root.optionalMap("cutting")) readCutting(*map, model);
  if (const auto map = root.optionalMap("tool_tip")) {
    model.tool_tip.x.modes = readModes(*map, "x", ModeKind::stiffness);
    model.tool_tip.y.modes = readModes(*map, "y", ModeKind::stiffness);
    map->finish();
  }
  if (const auto map = root.optionalMap("force_sensor")) readForceSensor(*map, model.force_sensor);
  if (const auto map = root.optionalMap("spindle")) model.spindle = readSpindle(*map);
  if (const auto map = root.optionalMap("axes")) model.axes = readAxes(*map);
  if (const auto map = root.optionalMap("hammer")) model.hammer = readHammer(*map);
  if (const auto map = root.optionalMap("workpiece")) model.workpiece = readWorkpiece(*map);
  if (root.has("effects")) {
    for (const StrictYaml& map : root.maps("effects")) model.effects.push_back(readEffect(map, model));
  }
  if (const auto map = root.optionalMap("uncertainty_percent")) model.uncertainty = readUncertainty(*map);
  root.finish();
  return model;
}

void writeMachineModel(const MachineModel& model, const std::string& file) {
  std::ostringstream out;
  out << "format: " << FORMAT << "\n";
  if (model.tool) writeTool(out, model);
  if (model.cutting) out << cuttingSection(*model.cutting, model.cutting_std.value_or(NOT_IDENTIFIED));
  writeToolTip(out, model);
  writeForceSensor(out, model.force_sensor);
  if (model.spindle) writeSpindle(out, *model.spindle);
  if (model.axes) writeAxes(out, *model.axes);
  if (model.hammer) writeHammer(out, *model.hammer);
  if (model.workpiece) writeWorkpiece(out, *model.workpiece);
  out << "effects:" << (model.effects.empty() ? " []" : "") << "\n";
  for (const EffectEntry& effect : model.effects) writeEffect(out, effect);
  writeUncertainty(out, model.uncertainty);
  writeText(file, out.str());
}

}  // namespace smartmill
