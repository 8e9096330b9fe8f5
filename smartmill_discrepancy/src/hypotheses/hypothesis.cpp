#include "smartmill_discrepancy/hypotheses/hypothesis.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

using Values = std::vector<double>;

// What the campaign holds.
struct Scope {
  const Dataset& data;
  std::set<std::string> channels;
  bool cuts = false, moved_starts = true, known_wear = true;
  double largest_force = 0.0;

  explicit Scope(const Dataset& d) : data(d) {
    for (const TestData& t : d.tests) {
      channels.insert(t.channels.begin(), t.channels.end());
      cuts = cuts || t.test.kind == TestKind::cut;
      moved_starts = moved_starts && t.test.start_time;
      known_wear = known_wear && (t.test.kind != TestKind::cut || t.test.cut_time_before);
      for (const char* name : {"fx", "fy", "fz"}) {
        if (!t.record.has(name)) continue;
        for (const double f : t.record.column(name)) largest_force = std::max(largest_force, std::abs(f));
      }
    }
  }
  bool forces() const { return channels.count("fx") + channels.count("fy") + channels.count("fz") > 0; }
};

Values nulls(const std::vector<Coordinate>& coordinates) {
  Values v;
  for (const Coordinate& c : coordinates) v.push_back(c.null);
  return v;
}

// One point per coordinate at null + reach.
Hypothesis::Probe straight(const std::vector<Coordinate>& coordinates, double reach) {
  Hypothesis::Probe probe{nulls(coordinates), {}, false};
  for (std::size_t k = 0; k < coordinates.size(); ++k) {
    probe.points.push_back(probe.null);
    probe.points.back()[k] += reach;
  }
  return probe;
}

// An effect whose every coordinate is an amplitude and a key of the file.
Hypothesis amplitudes(const std::string& effect, std::vector<Coordinate> coordinates, double reach) {
  Hypothesis h;
  h.effect = effect;
  h.probes.push_back(straight(coordinates, reach));
  h.coordinates = std::move(coordinates);
  std::vector<std::string> keys;
  for (const Coordinate& c : h.coordinates) keys.push_back(c.name);
  h.entry = [effect, keys](const Values& v) {
    EffectEntry e;
    e.name = effect;
    for (std::size_t k = 0; k < keys.size(); ++k) e.numbers[keys[k]] = v[k];
    return e;
  };
  return h;
}

// Tries the one amplitude from several distances: what it does is not in proportion to it.
Hypothesis reaching(Hypothesis h, const Values& reaches) {
  h.probes.clear();
  for (const double reach : reaches) h.probes.push_back(straight(h.coordinates, reach));
  return h;
}

// A vector in the plane: size and direction in the file, Cartesian in the fit, which has no pole at zero.
Hypothesis planar(const std::string& effect, const std::string& size_key, double reach, double limit,
                  double prior) {
  Hypothesis h = amplitudes(effect,
                            {{size_key + " cos", 0.0, -limit, limit, 5e-4 * reach, prior},
                             {size_key + " sin", 0.0, -limit, limit, 5e-4 * reach, prior}},
                            reach);
  h.entry = [effect, size_key](const Values& v) {
    EffectEntry e;
    e.name = effect;
    e.numbers[size_key] = std::hypot(v[0], v[1]);
    const double angle = units::degFromRad(std::atan2(v[1], v[0]));
    e.numbers["angle_deg"] = angle < 0.0 ? angle + 360.0 : angle;
    return e;
  };
  return h;
}

// An amplitude and a scale: exponent and reference, breakaway and speed, cold ratio and time constant. The
// fit moves the scale's logarithm.
Hypothesis scaled(const std::string& effect, const Coordinate& amplitude, double reach,
                  const std::string& scale_key, const Values& scales, double low, double high, double prior) {
  Hypothesis h;
  h.effect = effect;
  const double middle = std::log(scales[scales.size() / 2]);
  h.coordinates = {amplitude, {"ln " + scale_key, middle, std::log(low), std::log(high), 2.5e-4, prior}};
  for (const double s : scales) {
    h.probes.push_back({{amplitude.null, std::log(s)}, {{amplitude.null + reach, std::log(s)}}, false});
  }
  const std::string key = amplitude.name;
  h.entry = [effect, key, scale_key](const Values& v) {
    EffectEntry e;
    e.name = effect;
    e.numbers[key] = v[0];
    e.numbers[scale_key] = std::exp(v[1]);
    return e;
  };
  return h;
}

// A factor: its logarithm moves along with those of the nominal values that it resembles.
Hypothesis logarithmic(const std::string& effect, const std::string& key, double low, double high) {
  Hypothesis h = amplitudes(effect, {{"ln " + key, 0.0, low, high, 1e-4, 0.2}}, 0.02);
  h.entry = [effect, key](const Values& v) {
    EffectEntry e;
    e.name = effect;
    e.numbers[key] = std::exp(v[0]);
    return e;
  };
  return h;
}

// A power law exponent and reference: force times (x / reference)^-exponent. The fit moves the exponent and
// the level at a middle x, which stays well known where the exponent is small.
Hypothesis powerLaw(const std::string& effect, const std::string& reference_key, double middle, double low,
                    double high) {
  Hypothesis h = amplitudes(
      effect, {{"exponent", 0.0, -1.0, 1.0, 5e-05, 0.3}, {"level", 0.0, -1.0, 1.0, 5e-05, 0.2}}, 0.02);
  h.entry = [effect, reference_key, middle, low, high](const Values& v) {
    EffectEntry e;
    e.name = effect;
    e.numbers["exponent"] = v[0];
    const double steep = std::abs(v[0]) > 1e-9 ? v[0] : 1e-9;
    e.numbers[reference_key] =
        std::clamp(middle * std::exp(std::clamp(v[1] / steep, -20.0, 20.0)), low, high);
    return e;
  };
  // A level without a slope cannot be written: each point has some slope.
  h.probes = {{{0.0, 0.0}, {{0.02, 0.0}, {0.02, 0.01}}, false}};
  return h;
}

Hypothesis withWord(Hypothesis h, const std::string& key, const std::string& word) {
  h.variant = word;
  const auto entry = h.entry;
  h.entry = [entry, key, word](const Values& v) {
    EffectEntry e = entry(v);
    e.words[key] = word;
    return e;
  };
  return h;
}

Hypothesis unevenPitch(const ToolGeometry& tool) {
  std::vector<Coordinate> coordinates;
  for (int k = 0; k + 1 < tool.teeth; ++k)
    coordinates.push_back({"pitch " + std::to_string(k), 0.0, -30.0, 30.0, 5e-4, 5.0});
  Hypothesis h = amplitudes("uneven_pitch", coordinates, 0.5);
  h.entry = [tool](const Values& v) {
    EffectEntry e;
    e.name = "uneven_pitch";
    double rest = 360.0;
    for (std::size_t k = 0; k < v.size(); ++k) {
      e.pitch_deg.push_back(std::max(units::degFromRad(tool.pitchOf(static_cast<int>(k))) + v[k], 1.0));
      rest -= e.pitch_deg.back();
    }
    e.pitch_deg.push_back(std::max(rest, 1.0));
    return e;
  };
  return h;
}

// The direct share gives the gain; how large that is, a nominal model may not know well.
Hypothesis extraMode(const std::string& axis, double direct, bool second) {
  const double most = std::max(direct, 0.2);
  Hypothesis h;
  h.effect = "extra_mode";
  h.variant = second ? axis + ", second" : axis;
  if (second) h.after = axis;
  h.coordinates = {{"ln frequency_hz", std::log(800.0), std::log(20.0), std::log(12000.0), 2.5e-06, 1.5},
                   {"ln damping_ratio", std::log(0.03), std::log(0.001), std::log(0.6), 0.00025, 1.0},
                   {"gain", 0.0, -most, most, 2.5e-05, 0.2}};
  h.entry = [axis](const Values& v) {
    EffectEntry e;
    e.name = "extra_mode";
    e.words["axis"] = axis;
    e.numbers = {{"frequency_hz", std::exp(v[0])}, {"damping_ratio", std::exp(v[1])}, {"gain", v[2]}};
    return e;
  };
  return h;
}

Hypothesis flexibility(const std::string& axis) {
  Hypothesis h;
  h.effect = "tool_flexibility";
  h.variant = axis;
  for (const char a : axis) {
    const std::string name(1, a);
    h.coordinates.push_back(
        {"ln " + name + " frequency_hz", std::log(1200.0), std::log(100.0), std::log(8000.0), 2.5e-5, 1.0});
    h.coordinates.push_back(
        {"ln " + name + " damping_ratio", std::log(0.04), std::log(0.003), std::log(0.4), 5e-4, 1.0});
    h.coordinates.push_back({name + " compliance_um_per_kn", 0.0, 0.0, 1000.0, 5e-3, 100.0});
  }
  h.entry = [axis](const Values& v) {
    EffectEntry e;
    e.name = "tool_flexibility";
    for (std::size_t k = 0; k < axis.size(); ++k) {
      if (v[3 * k + 2] <= 0.0) continue;
      Mode mode;
      mode.frequency = std::exp(v[3 * k]);
      mode.damping_ratio = std::exp(v[3 * k + 1]);
      mode.gain = v[3 * k + 2] * 1e-9;  // um/kN
      (axis[k] == 'x' ? e.flexibility.x : e.flexibility.y).modes.push_back(mode);
    }
    return e;
  };
  return h;
}

}  // namespace

std::vector<Hypothesis> catalogueHypotheses(const Dataset& data, std::vector<std::string>* notes) {
  const Scope scope(data);
  const MachineModel& model = data.nominal;
  std::vector<Hypothesis> all;
  const auto leaveOut = [&](const std::string& effect, const std::string& why) {
    if (notes) notes->push_back(effect + " is not tried: " + why);
  };
  const bool sensor_modes = [&] {
    for (const ModalModel& a : model.force_sensor.axis) {
      if (!a.modes.empty()) return true;
    }
    return false;
  }();

  if (scope.cuts) {
    all.push_back(planar("runout", "offset_um", 1.0, 200.0, 20.0));
    // No edge pulls: what is added takes away no more than the model has.
    const auto edge = [&](const char* key, double stated) {
      return Coordinate{key, 0.0, -1e-3 * stated, 200.0, 0.005, 20.0};
    };
    const CuttingCoefficients stated = model.cutting.value_or(CuttingCoefficients{});
    all.push_back(amplitudes("edge_forces",
                             {edge("Kte_n_per_mm", stated.kte), edge("Kre_n_per_mm", stated.kre),
                              edge("Kae_n_per_mm", stated.kae)},
                             2.0));
    all.push_back(powerLaw("size_effect", "reference_chip_um", 60.0, 1.0, 3000.0));
    if (scope.known_wear) {
      all.push_back(amplitudes("tool_wear", {{"edge_growth_per_min", 0.0, -0.2, 20.0, 0.000125, 1.0}}, 0.1));
    } else {
      leaveOut("tool_wear", "cut_time_before_s is not stated");
    }
    all.push_back(powerLaw("cutting_speed", "reference_m_per_min", 150.0, 1.0, 5000.0));
    if (model.tool && model.tool->teeth > 1) all.push_back(unevenPitch(*model.tool));
    if (model.tool) {
      const double helix = units::degFromRad(model.tool->helix);
      all.push_back(
          amplitudes("helix", {{"helix_deg", helix, 0.0, 75.0, 0.0025, 8.0}}, helix > 60.0 ? -1.0 : 1.0));
    }
    for (const char* axis : {"x", "y", "xy"}) all.push_back(flexibility(axis));
    if (!model.tool_tip.x.modes.empty() || !model.tool_tip.y.modes.empty()) {
      all.push_back(reaching(
          amplitudes("process_damping", {{"coefficient_n_per_mm", 0.0, -1e4, 1e6, 0.125, 2000.0}}, 50.0),
          {50.0, 300.0, 1500.0}));
    } else {
      leaveOut("process_damping", "the model's tool is rigid");
    }
    all.push_back(amplitudes("depth_tilt", {{"slope_um_per_mm", 0.0, -900.0, 900.0, 0.0125, 50.0}}, 5.0));
    all.push_back(logarithmic("feed_error", "ratio", std::log(0.2), std::log(5.0)));
  }
  if (scope.forces()) {
    for (const char* axis : {"x", "y", "z"}) {
      if (!scope.channels.count(std::string("f") + axis)) continue;
      for (const bool second : {false, true}) {
        all.push_back(
            extraMode(axis, model.force_sensor.axis[static_cast<std::size_t>(axis[0] - 'x')].direct, second));
      }
    }
    if (sensor_modes) {
      // A light mode answers in proportion only while it moves by less than its width.
      // In logarithms the mass does just what the modes' stated frequencies do, all at once.
      Hypothesis mass = amplitudes(
          "mass_loading", {{"ln 1 + mass_ratio", 0.0, std::log(0.4), std::log(4.0), 5e-05, 0.3}}, 0.01);
      mass.entry = [](const Values& v) {
        EffectEntry e;
        e.name = "mass_loading";
        e.numbers["mass_ratio"] = std::expm1(v[0]);
        return e;
      };
      all.push_back(reaching(std::move(mass), {0.01, 0.05, 0.12, 0.2, 0.3, 0.45, 0.7, -0.05, -0.12, -0.25}));
      all.push_back(reaching(
          amplitudes("speed_dependent_mode", {{"softening_per_krpm", 0.0, -0.04, 0.04, 5e-06, 0.02}}, 0.001),
          {0.001, 0.003, 0.006, 0.01, 0.015, 0.025, -0.003, -0.01}));
    } else {
      leaveOut("mass_loading and speed_dependent_mode", "the model's force sensor has no modes");
    }
    std::vector<Coordinate> pairs;
    for (const char* pair : {"xy", "xz", "yx", "yz", "zx", "zy"})
      pairs.push_back({pair, 0.0, -0.9, 0.9, 0.002, 0.1});
    all.push_back(amplitudes("cross_talk", pairs, 0.01));
    Hypothesis drift = amplitudes("charge_drift",
                                  {{"rate_n_per_min", 0.0, -1e5, 1e5, 0.025, 500.0},
                                   {"y rate_n_per_min", 0.0, -1e5, 1e5, 0.025, 500.0}},
                                  20.0);
    drift.entry = [](const Values& v) {
      EffectEntry e;
      e.name = "charge_drift";
      e.numbers["rate_n_per_min"] = v[0];
      e.numbers["y_ratio"] = v[0] != 0.0 ? v[1] / v[0] : 0.0;
      return e;
    };
    // The two need both: a rate of zero on x leaves y without its ratio.
    drift.probes = {{{0.0, 0.0}, {{20.0, 0.0}, {20.0, 20.0}}, false}};
    all.push_back(std::move(drift));
    for (const double frequency : {50.0, 60.0}) {
      if (!scope.channels.count("fx") && !scope.channels.count("fy")) break;
      Hypothesis hum = amplitudes(
          "mains_hum",
          {{"amplitude_n", 0.0, 0.0, 1e4, 0.0005, 10.0}, {"y_ratio", 0.5, -20.0, 20.0, 0.000125, 1.0}}, 1.0);
      hum.variant = frequency == 50.0 ? "50 Hz" : "60 Hz";
      // The twin takes each record's phase from the record, for which the amplitude must not be zero.
      hum.probes.clear();
      for (const double ratio : {0.6, -0.6}) hum.probes.push_back({{0.0, ratio}, {{2.0, ratio}}, false});
      hum.entry = [frequency](const Values& v) {
        EffectEntry e;
        e.name = "mains_hum";
        e.numbers = {{"frequency_hz", frequency}, {"amplitude_n", v[0]}, {"y_ratio", v[1]}};
        return e;
      };
      all.push_back(std::move(hum));
    }
    all.push_back(planar("unbalance", "mass_eccentricity_g_mm", 1.0, 5000.0, 30.0));
    const double limit = scope.largest_force;
    Hypothesis saturation;
    saturation.effect = "saturation";
    saturation.coordinates = {{"limit_n", 4.0 * limit, 0.02 * limit, 8.0 * limit, 1e-5 * limit, 4.0 * limit}};
    for (const double share : {0.99, 0.97})
      saturation.probes.push_back({{4.0 * limit}, {{share * limit}}, true});
    saturation.entry = [](const Values& v) {
      EffectEntry e;
      e.name = "saturation";
      e.numbers["limit_n"] = v[0];
      return e;
    };
    all.push_back(std::move(saturation));
  }
  for (const std::string& channel : scope.channels) {
    const bool slow = channel == "load_meter";
    all.push_back(withWord(reaching(amplitudes("channel_delay",
                                               {{"delay_us", 0.0, 0.0, slow ? 2e5 : 5000.0, slow ? 2.0 : 0.02,
                                                 slow ? 10000.0 : 200.0}},
                                               slow ? 500.0 : 10.0),
                                    slow ? Values{500.0, 5000.0, 30000.0} : Values{10.0, 60.0, 150.0, 400.0}),
                           "channel", channel));
    all.push_back(
        withWord(logarithmic("gain_error", "gain", std::log(0.05), std::log(5.0)), "channel", channel));
  }
  if (scope.channels.count("load_meter")) {
    all.push_back(scaled("stribeck_friction", {"breakaway_nm", 0.0, -20.0, 20.0, 0.000125, 0.5}, 0.05,
                         "speed_rpm", {400.0, 1200.0, 3500.0}, 50.0, 30000.0, 1.0));
    if (scope.moved_starts) {
      all.push_back(scaled("friction_warmup", {"cold_ratio", 0.0, -0.9, 20.0, 0.000125, 0.5}, 0.05,
                           "time_constant_s", {80.0, 250.0, 700.0}, 2.0, 20000.0, 1.0));
    } else {
      leaveOut("friction_warmup", "start_time_s is not stated");
    }
    const double nominal = model.spindle->load_meter_bandwidth;
    Hypothesis lag =
        reaching(amplitudes("load_meter_lag",
                            {{"ln bandwidth_hz", 0.0, std::log(0.01), std::log(20.0), 0.000125, 0.7}}, -0.1),
                 {-0.1, -0.5, -1.2, 0.4});
    lag.entry = [nominal](const Values& v) {
      EffectEntry e;
      e.name = "load_meter_lag";
      e.numbers["bandwidth_hz"] = nominal * std::exp(v[0]);
      return e;
    };
    all.push_back(std::move(lag));
  }
  return all;
}

std::vector<std::pair<std::string, double>> numbersOf(const EffectEntry& entry) {
  std::vector<std::pair<std::string, double>> numbers(entry.numbers.begin(), entry.numbers.end());
  for (std::size_t k = 0; k < entry.pitch_deg.size(); ++k)
    numbers.emplace_back("pitch_deg[" + std::to_string(k) + "]", entry.pitch_deg[k]);
  const auto add = [&](const std::string& axis, const ModalModel& modes) {
    for (std::size_t k = 0; k < modes.modes.size(); ++k) {
      const std::string name = axis + "[" + std::to_string(k) + "].";
      numbers.emplace_back(name + "frequency_hz", modes.modes[k].frequency);
      numbers.emplace_back(name + "damping_ratio", modes.modes[k].damping_ratio);
      numbers.emplace_back(name + "stiffness_n_per_um", 1e-6 / modes.modes[k].gain);
    }
  };
  add("x", entry.flexibility.x);
  add("y", entry.flexibility.y);
  return numbers;
}

}  // namespace smartmill::discrepancy
