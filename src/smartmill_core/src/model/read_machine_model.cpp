#include <cmath>
#include <limits>
#include <numeric>

#include "machine_model_format.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

constexpr double NOT_KNOWN = std::numeric_limits<double>::quiet_NaN();
// Pitch lists have few digits.
constexpr double PITCH_SUM_TOLERANCE_DEG = 1e-3;

const Range ANY{};
const Range POSITIVE = Range::positive();
const Range NOT_NEGATIVE = Range::notNegative();
const Range HELIX_DEG{0.0, 80.0, false, true};
const Range DAMPING{0.0, 1.0, true, true};

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

}  // namespace

void readEdges(const StrictYaml& map, ToolGeometry& tool) {
  EdgeShape& edge = tool.edge;
  if (map.isList("helix_deg")) {
    std::vector<double> helix = map.numbers("helix_deg", static_cast<std::size_t>(tool.teeth), HELIX_DEG);
    for (double& h : helix) h = units::radFromDeg(h);
    tool.setHelix(helix);
  } else if (map.has("helix_deg")) {
    tool.helix = units::radFromDeg(map.number("helix_deg", HELIX_DEG));
  }
  const double angle = map.optionalNumber("edge_angle_deg", Range::openLow(0.0, 90.0)).value_or(90.0);
  if (angle < 90.0) edge.edge_angle = units::radFromDeg(angle);
  // The largest corner whose centre does not lie beyond the axis.
  const double most = tool.radius() / std::tan(0.5 * edge.edge_angle) / units::MM;
  constexpr double ROUNDING = 1e-12;
  edge.corner_radius =
      units::MM *
      map.optionalNumber("corner_radius_mm", Range::closed(0.0, most * (1.0 + ROUNDING))).value_or(0.0);
  if (const auto serration = map.optionalMap("serration")) {
    edge.serration_amplitude = units::MM * serration->number("amplitude_mm", POSITIVE);
    edge.serration_wavelength = units::MM * serration->number("wavelength_mm", POSITIVE);
    serration->finish();
  }
}

namespace {

void readTool(const StrictYaml& map, MachineModel& model) {
  ToolGeometry tool;
  tool.teeth = map.integer("teeth", 1, 20);
  tool.diameter = map.number("diameter_mm", POSITIVE) * units::MM;
  if (!map.has("helix_deg")) map.fail("helix_deg", "is missing");
  readEdges(map, tool);
  if (map.has("pitch_deg")) {
    for (const double p :
         readPerTooth(map, "pitch_deg", static_cast<std::size_t>(tool.teeth), POSITIVE, 360.0)) {
      tool.pitch.push_back(units::radFromDeg(p));
    }
  }
  if (const auto stickout = map.optionalNumber("stickout_mm", POSITIVE))
    model.stickout = *stickout * units::MM;
  if (const auto height = map.optionalNumber("edge_height_mm", POSITIVE))
    model.edge_height = *height * units::MM;
  if (const auto diameter = map.optionalNumber("holder_diameter_mm", POSITIVE)) {
    if (!model.stickout) map.fail("holder_diameter_mm", "needs stickout_mm, where the holder begins");
    model.holder_diameter = *diameter * units::MM;
  }
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

Axes3 axes3(const std::vector<double>& v, double unit) {
  return {v[0] * unit, v[1] * unit, v[2] * unit};
}

double forcePerUnit(const StrictYaml& map, const std::string& key, double value) {
  if (value == 0.0) map.fail(key, "0, expected a number other than 0");
  return value;
}

/// The channels of a piezoelectric dynamometer with four three-component sensors at x = +-a, y = +-b,
/// numbered from (a, b) counter-clockwise; lateral channels are summed in pairs.
std::vector<SensorChannel> kistlerChannels(const StrictYaml& map) {
  const double a = map.number("distance_x_mm", POSITIVE) * units::MM;
  const double b = map.number("distance_y_mm", POSITIVE) * units::MM;
  const double z = map.optionalNumber("height_mm", ANY).value_or(0.0) * units::MM;
  Axes3 scale{{1.0, 1.0, 1.0}};
  if (map.has("n_per_unit")) scale = axes3(map.numbers("n_per_unit", 3), 1.0);
  for (const double s : scale) forcePerUnit(map, "n_per_unit", s);
  const Axes3 x{{1, 0, 0}}, y{{0, 1, 0}}, up{{0, 0, 1}};
  return {{"fx12", scale[0], x, {{0, b, z}}, {}},   {"fx34", scale[0], x, {{0, -b, z}}, {}},
          {"fy14", scale[1], y, {{a, 0, z}}, {}},   {"fy23", scale[1], y, {{-a, 0, z}}, {}},
          {"fz1", scale[2], up, {{a, b, z}}, {}},   {"fz2", scale[2], up, {{-a, b, z}}, {}},
          {"fz3", scale[2], up, {{-a, -b, z}}, {}}, {"fz4", scale[2], up, {{a, -b, z}}, {}}};
}

SensorChannel readChannel(const StrictYaml& map, std::size_t components) {
  SensorChannel channel;
  channel.name = map.word("name");
  if (map.has("response")) {
    channel.response = map.numbers("response", components);
  } else {
    channel.direction = axes3(map.numbers("direction", 3), 1.0);
    const double length = std::hypot(channel.direction[0], channel.direction[1], channel.direction[2]);
    if (!(length > 0.0)) map.fail("direction", "has length 0");
    for (double& d : channel.direction) d /= length;
    if (components == 6 || map.has("position_mm"))
      channel.position = axes3(map.numbers("position_mm", 3), units::MM);
    channel.force_per_unit =
        forcePerUnit(map, "n_per_unit", map.optionalNumber("n_per_unit", ANY).value_or(1.0));
  }
  map.finish();
  return channel;
}

SensorChannels readSensorChannels(const StrictYaml& map) {
  SensorChannels sensor;
  if (map.has("unit")) sensor.unit = map.word("unit");
  sensor.noise_rms = map.optionalNumber("noise_rms", POSITIVE);
  if (map.has("components")) {
    sensor.components = static_cast<std::size_t>(map.integer("components", 3, 6));
    if (sensor.components != 3 && sensor.components != 6)
      map.fail("components", std::to_string(sensor.components) + ", expected 3 (forces) or 6 (and moments)");
  }
  if (map.has("arrangement")) {
    map.oneOf("arrangement", {"kistler_8"});
    sensor.channels = kistlerChannels(map);
  } else {
    bool measured = false;
    for (const StrictYaml& entry : map.maps("list")) {
      const SensorChannel channel = readChannel(entry, sensor.components);
      if (!sensor.channels.empty() && measured != !channel.response.empty())
        map.fail("list", "channel " + channel.name + ": expected response for all channels or for none");
      measured = !channel.response.empty();
      for (const SensorChannel& other : sensor.channels) {
        if (other.name == channel.name) map.fail("list", "channel " + channel.name + " occurs twice");
      }
      sensor.channels.push_back(channel);
    }
  }
  if (sensor.channels.size() < sensor.components) {
    map.fail("list", std::to_string(sensor.channels.size()) + " channels, expected at least " +
                         std::to_string(sensor.components) + " for as many components");
  }
  map.finish();
  return sensor;
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
  if (const auto channels = map.optionalMap("channels")) sensor.channels = readSensorChannels(*channels);
  if (map.has("samples")) sensor.mean_samples = map.oneOf("samples", {"instant", "mean"}) == "mean";
  map.finish();
}

FramePose readFrame(const StrictYaml& map, const std::string& parent) {
  FramePose pose;
  pose.parent = map.has("parent") ? map.word("parent") : parent;
  if (map.has("position_mm")) pose.position = axes3(map.numbers("position_mm", 3), units::MM);
  if (map.has("rotation_xyzw") && map.has("about_z_deg"))
    map.fail("about_z_deg", "is stated together with rotation_xyzw, expected one of them");
  if (const auto turn = map.optionalNumber("about_z_deg", ANY)) {
    const double half = 0.5 * units::radFromDeg(*turn);
    pose.rotation = {{0.0, 0.0, std::sin(half), std::cos(half)}};
  } else if (map.has("rotation_xyzw")) {
    const std::vector<double> q = map.numbers("rotation_xyzw", 4);
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    // As the printed digits of a pose.
    if (std::abs(length - 1.0) > 1e-3)
      map.fail("rotation_xyzw", "has length " + yamlNumber(length, 4) + ", expected a unit quaternion");
    for (std::size_t i = 0; i < 4; ++i) pose.rotation[i] = q[i] / length;
  }
  map.finish();
  return pose;
}

FramePoses readFrames(const StrictYaml& map) {
  FramePoses poses;
  for (const std::string& name : map.keys()) {
    const auto usual = usualFrames().find(name);
    if (usual == usualFrames().end())
      map.fail(name, "is not a frame (expected dynamometer, hammer, spindle_sensor, table or tool_tip)");
    const FramePose pose = readFrame(map.map(name), usual->second.parent);
    if (pose.parent != frames::MACHINE && pose.parent != frames::SPINDLE &&
        usualFrames().count(pose.parent) == 0)
      map.fail(name,
               "parent '" + pose.parent + "' is not a frame (expected machine, spindle or a fixed one)");
    poses[name] = pose;
  }
  map.finish();
  for (const auto& [name, pose] : poses) {
    // A chain that does not end at the machine or its spindle is a loop.
    std::string at = name;
    for (std::size_t i = 0; at != frames::MACHINE && at != frames::SPINDLE; ++i) {
      if (i > usualFrames().size()) map.fail(name, "parent '" + pose.parent + "' is below it: a loop");
      const auto stated = poses.find(at);
      at = stated != poses.end() ? stated->second.parent : usualFrames().at(at).parent;
    }
  }
  return poses;
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
  if (const auto opposite = map.optionalMap("opposite")) {
    h.opposite = HammerStation::Opposite{opposite->number("distance_mm", POSITIVE) * units::MM,
                                         opposite->number("stroke_mm", POSITIVE) * units::MM};
    opposite->finish();
  }
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
  return w;
}

std::vector<WorkpieceModes> readWorkpieceModes(const StrictYaml& map) {
  std::vector<WorkpieceModes> places;
  for (const StrictYaml& entry : map.maps("modes")) {
    WorkpieceModes place;
    if (const auto position = entry.optionalNumber("position_mm", ANY))
      place.position = *position * units::MM;
    place.x.modes = readModes(entry, "x", ModeKind::stiffness);
    place.y.modes = readModes(entry, "y", ModeKind::stiffness);
    if (place.x.modes.empty() && place.y.modes.empty())
      entry.fail("x", "is missing, and y too: expected modes along one axis at least");
    if (!places.empty()) {
      if (!entry.has("position_mm")) entry.fail("position_mm", "is missing (there are several places)");
      if (!(place.position > places.back().position))
        entry.fail("position_mm", yamlNumber(place.position / units::MM) + ", expected a value above " +
                                      yamlNumber(places.back().position / units::MM));
      if (place.x.modes.size() != places.back().x.modes.size() ||
          place.y.modes.size() != places.back().y.modes.size())
        entry.fail("position_mm", yamlNumber(place.position / units::MM) +
                                      ": expected as many modes in x and in y as at the first place");
    }
    entry.finish();
    places.push_back(place);
  }
  return places;
}

void readWorkpieceSection(const StrictYaml& map, MachineModel& model) {
  if (map.has("modes")) model.workpiece_modes = readWorkpieceModes(map);
  // The modes alone make a section.
  if (!map.has("modes") || map.has("material") || map.has("low_mm") || map.has("high_mm"))
    model.workpiece = readWorkpiece(map);
  map.finish();
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

}  // namespace

MachineModel readMachineModel(const std::string& file) {
  const StrictYaml root = StrictYaml::fromFile(file);
  MachineModel model;
  model.file = file;
  root.oneOf("format", {MODEL_FORMAT});
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
  if (const auto map = root.optionalMap("frames")) model.frames = readFrames(*map);
  if (const auto map = root.optionalMap("workpiece")) readWorkpieceSection(*map, model);
  if (root.has("effects")) {
    for (const StrictYaml& map : root.maps("effects")) model.effects.push_back(readEffect(map, model));
  }
  if (const auto map = root.optionalMap("uncertainty_percent")) model.uncertainty = readUncertainty(*map);
  root.finish();
  return model;
}

}  // namespace smartmill
