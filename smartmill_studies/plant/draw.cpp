#include "plant/draw.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"

namespace smartmill::plant {
namespace {

using Random = std::mt19937_64;

double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

template <class T>
const T& oneOf(Random& random, const std::vector<T>& choices) {
  return choices[std::uniform_int_distribution<std::size_t>(0, choices.size() - 1)(random)];
}

// Steel block on a sensor plate, with springs that give a first lateral mode as of real dynamometers.
Plate drawPlate(Random& random) {
  Plate p;
  p.mass = between(random, 10.0, 25.0);
  p.size = {between(random, 0.18, 0.26), between(random, 0.16, 0.2), between(random, 0.06, 0.09)};
  const double first = units::TWO_PI * between(random, 1300.0, 1700.0),
               second = first * between(random, 1.05, 1.3);
  const double upright = units::TWO_PI * between(random, 2200.0, 2900.0);
  p.stiffness = {0.25 * p.mass * first * first, 0.25 * p.mass * second * second,
                 0.25 * p.mass * upright * upright};
  p.springs = {0.4 * p.size[0], 0.4 * p.size[1], 0.1 * p.size[2]};
  // Close to the plate's centre, so that its tilting modes are weak.
  p.force_point = {between(random, -0.004, 0.004), between(random, -0.004, 0.004),
                   between(random, 0.0, 0.004)};
  p.damping_ratio = between(random, 0.015, 0.04);
  return p;
}

ToolInSpindle drawTool(const ToolGeometry& geometry, Random& random) {
  ToolInSpindle t;
  t.shank_diameter = geometry.diameter;
  t.stickout = geometry.diameter * between(random, 3.0, 4.2);
  t.fluted_length = 0.6 * t.stickout;
  t.flute_ratio = between(random, 0.78, 0.86);
  t.young = 580e9;
  t.density = 14500.0;
  t.spindle_mass = between(random, 0.6, 1.6);
  t.spindle_inertia = t.spindle_mass * 0.03 * 0.03;
  t.stiffness_across = t.spindle_mass * std::pow(units::TWO_PI * between(random, 900.0, 1500.0), 2);
  t.stiffness_tilting = t.spindle_inertia * std::pow(units::TWO_PI * between(random, 1800.0, 2600.0), 2);
  t.damping_ratio = between(random, 0.025, 0.045);
  return t;
}

Plant drawPlant(bool vibrating, Random& random) {
  Plant p;
  p.tool.teeth = oneOf<int>(random, {2, 3, 4});
  p.tool.diameter = oneOf<double>(random, {10e-3, 12e-3, 16e-3, 19.05e-3});
  p.tool.helix = units::radFromDeg(oneOf<double>(random, {20, 30, 35, 40}));
  p.cutting = {between(random, 650e6, 1000e6), between(random, 150e6, 400e6), between(random, 120e6, 250e6),
               between(random, 10e3, 30e3),    between(random, 12e3, 35e3),   between(random, 0.6e3, 4e3)};
  p.sensor = modesOf(drawPlate(random));
  p.sensor_direct = {0.0, 0.0, 0.0};
  if (vibrating) {
    for (auto& axis : p.tip) {
      axis = tipModes(drawTool(p.tool, random), 6000.0);
    }
  }
  Spindle s;
  s.viscous = between(random, 3.0e-4, 5.0e-4);
  s.coulomb = between(random, 0.02, 0.08);
  s.load_meter_gain = 3.88e-4;
  s.load_meter_bandwidth = 7.0;
  s.load_meter_resolution = 3e-4;
  p.spindle = s;
  p.unsteadiness = {0.01, 5e-4, 0.1};
  return p;
}

// A value as stated in the model: its error is drawn from its uncertainty [percent].
double believed(double value, double percent, Random& random) {
  return value * (1.0 + percent / 100.0 * std::normal_distribution<double>()(random));
}

Mode believedMode(double frequency, double damping_ratio, double gain, double gain_percent,
                  const Uncertainty& u, Random& random) {
  Mode m;
  m.frequency = believed(frequency, u.frequency, random);
  m.damping_ratio = believed(damping_ratio, u.damping, random);
  m.gain = believed(gain, gain_percent, random);
  return m;
}

// The model of a user, from measurements and tables.
MachineModel believedOf(const Plant& plant, double errors, Random& random) {
  MachineModel m;
  Uncertainty u = m.uncertainty;
  for (double* value : {&u.cutting, &u.frequency, &u.damping, &u.stiffness, &u.spindle}) *value *= errors;
  m.tool = plant.tool;
  CuttingCoefficients c = plant.cutting;
  for (double* value : {&c.ktc, &c.krc, &c.kac, &c.kte, &c.kre, &c.kae})
    *value = believed(*value, u.cutting, random);
  m.cutting = c;
  for (std::size_t a = 0; a < 3; ++a) {
    // The main mode of the sensor along that axis; the rest of its response is taken as direct.
    const auto main = std::max_element(plant.sensor.begin(), plant.sensor.end(),
                                       [&](const SensorMode& x, const SensorMode& y) {
                                         return x.input[a] * x.output[a] < y.input[a] * y.output[a];
                                       });
    const Mode mode = believedMode(main->frequency, main->damping_ratio,
                                   std::min(1.0, main->input[a] * main->output[a]), 0.0, u, random);
    m.force_sensor.axis[a].modes = {mode};
    m.force_sensor.axis[a].direct = 1.0 - mode.gain;
  }
  m.force_sensor.noise_rms = plant.noise_rms;
  for (std::size_t a = 0; a < 2; ++a) {
    double compliance = 0.0;
    for (const PointMode& p : plant.tip[a]) compliance += p.compliance;
    std::vector<Mode>& modes = (a == 0 ? m.tool_tip.x : m.tool_tip.y).modes;
    for (const PointMode& p : plant.tip[a]) {
      if (p.compliance < 0.05 * compliance) continue;
      modes.push_back(believedMode(p.frequency, p.damping_ratio, p.compliance, u.stiffness, u, random));
    }
  }
  Spindle s = *plant.spindle;
  for (double* value : {&s.viscous, &s.coulomb, &s.load_meter_gain})
    *value = believed(*value, u.spindle, random);
  m.spindle = s;
  return m;
}

/// Test plan: the usual one or a common alternative.
struct Plan {
  double sample_rate = 25600.0;
  bool taps = true, angle = true, few = false, moves = false;
  double other_immersion = 0.0;  // [deg] of one more cut; 0: none
};

Plan drawPlan(Random& random) {
  Plan plan;
  switch (std::uniform_int_distribution<int>(0, 9)(random)) {
    case 0:
      plan.sample_rate = 12800.0;
      break;
    case 1:
      plan.taps = false;
      break;
    case 2:
      plan.angle = false;
      break;
    case 3:
      plan.few = true;
      break;
    case 4:
      plan.other_immersion = between(random, 30.0, 70.0);
      break;
    default:
      break;
  }
  return plan;
}

class Tests {
 public:
  Tests(const Plan& plan, double depth) : plan_(plan), depth_(depth) {}

  CampaignTest& add(const std::string& name, TestKind kind, double rpm) {
    CampaignTest t;
    t.name = name;
    t.kind = kind;
    t.file = name + ".csv";
    t.sample_rate = plan_.sample_rate;
    t.spindle_speed = units::radPerSecFromRpm(rpm);
    t.start_time = start_;
    start_ += 45.0;
    tests_.push_back(t);
    return tests_.back();
  }
  /// @param depth [1] of the plan's depth
  void cut(const std::string& name, double rpm, double feed_mm, double depth, double entry_deg,
           double exit_deg) {
    CampaignTest& t = add(name, TestKind::cut, rpm);
    t.engagement = Engagement{units::radFromDeg(entry_deg), units::radFromDeg(exit_deg), depth * depth_,
                              feed_mm * units::MM};
    t.engage_time = 0.02;
    t.cut_time_before = cut_time_;
    cut_time_ += 20.0;
  }
  const std::vector<CampaignTest>& all() const { return tests_; }

 private:
  Plan plan_;
  double depth_, start_ = 0.0, cut_time_ = 0.0;
  std::vector<CampaignTest> tests_;
};

std::vector<CampaignTest> testsOf(const Plan& plan, double depth) {
  Tests tests(plan, depth);
  for (const int rpm : {1000, 3000, 6000, 9000, 12000, 18000}) {
    if (!plan.few || rpm % 6000 == 0) tests.add("air_" + std::to_string(rpm), TestKind::air, rpm);
  }
  if (plan.taps) {
    for (const char* axis : {"x", "y", "z"})
      tests.add(std::string("tap_") + axis, TestKind::tap, 0.0).direction = axis;
  }
  if (plan.moves) tests.add("move", TestKind::move, 0.0);
  tests.cut("slot_4500_030", 4500, 0.03, 1.0, 0, 180);
  tests.cut("slot_4500_060", 4500, 0.06, 1.0, 0, 180);
  tests.cut("slot_4500_100", 4500, 0.10, 1.0, 0, 180);
  for (const int rpm : {1200, 3000, 7200, 9000, 13950}) {
    if (!plan.few || rpm == 1200 || rpm == 9000)
      tests.cut("slot_" + std::to_string(rpm), rpm, 0.06, 1.0, 0, 180);
  }
  tests.cut("up_4500", 4500, 0.08, 1.0, 0, 90);
  tests.cut("down_4500", 4500, 0.08, 1.0, 90, 180);
  if (plan.other_immersion > 0.0)
    tests.cut("down_shallow", 4500, 0.08, 1.0, 180.0 - plan.other_immersion, 180);
  tests.cut("slot_4500_deep", 4500, 0.06, plan.few ? 1.5 : 2.0, 0, 180);
  tests.cut("slot_4500_again", 4500, 0.06, 1.0, 0, 180);
  return tests.all();
}

// Ratio of the largest tip vibration in the last third to that in the second: a cut with more than 1.3 does
// not settle.
double growth(const Plant& plant, const CampaignTest& test, std::uint64_t seed) {
  Random random(seed);
  RunOptions options;
  options.steps = 6;
  options.slice = 0.2e-3;
  options.noise = false;
  options.show_tip = true;
  const Record r = run(plant, test, options, random);
  double worst = 0.0;
  for (const char* axis : {"tool_x", "tool_y"}) {
    const std::vector<double>& tip = r.column(axis);
    const auto largest = [&](double from, double to) {
      double peak = 1e-9;
      for (std::size_t i = static_cast<std::size_t>(from * tip.size());
           i < static_cast<std::size_t>(to * tip.size()); ++i)
        peak = std::max(peak, std::abs(tip[i]));
      return peak;
    };
    worst = std::max(worst, largest(0.66, 1.0) / largest(0.33, 0.66));
    if (largest(0.2, 1.0) > 150e-6) worst = 10.0;
  }
  return worst;
}

bool vibrates(const Plant& plant) {
  return !plant.tip[0].empty() ||
         std::any_of(plant.effects.begin(), plant.effects.end(), [](const EffectEntry& e) {
           return !e.flexibility.x.modes.empty() || !e.flexibility.y.modes.empty();
         });
}

// A depth at which all cuts of the plan settle.
double depthFor(const Plant& plant, const Plan& plan, std::uint64_t seed) {
  if (!vibrates(plant)) return 2e-3;
  double depth = 1.5e-3;
  for (; depth > 0.2e-3; depth *= 0.7) {
    const std::vector<CampaignTest> tests = testsOf(plan, depth);
    const bool settles = std::all_of(tests.begin(), tests.end(), [&](const CampaignTest& t) {
      return t.kind != TestKind::cut || growth(plant, t, seed) < 1.15;
    });
    if (settles) return 0.8 * depth;
  }
  return depth;
}

Outside drawOutside(const std::string& kind, double depth, Random& random) {
  Outside o;
  o.kind = kind;
  const auto on_channel = [&](double low, double high) {
    o.channel = oneOf<std::string>(random, {"fx", "fy", "fz"});
    o.size = between(random, low, high);
  };
  if (kind == "tone")
    on_channel(3.0, 12.0), o.place = between(random, 25.0, 45.0) + oneOf<double>(random, {0.0, 200.0});
  if (kind == "settling") on_channel(4.0, 12.0), o.place = between(random, 0.03, 0.08);
  if (kind == "half_order") on_channel(3.0, 12.0);
  if (kind == "bursts") on_channel(10.0, 30.0), o.place = between(random, 0.02, 0.05);
  if (kind == "curve")
    o.channel = oneOf<std::string>(random, {"fx", "fy"}), o.size = between(random, 0.1, 0.3);
  if (kind == "kink") o.size = between(random, 0.2, 0.5), o.place = between(random, 25e-6, 50e-6);
  if (kind == "softer_with_time") o.size = between(random, 0.1, 0.3), o.place = between(random, 0.03, 0.1);
  if (kind == "hard_skin") o.size = between(random, 0.15, 0.5), o.place = between(random, 0.2, 0.5) * depth;
  if (kind == "hard_spot")
    o.size = between(random, 0.15, 0.5), o.place = between(random, 0.3e-3, 1.5e-3),
    o.width = between(random, 0.1e-3, 0.4e-3);
  if (kind == "hardness_wave")
    o.size = between(random, 0.1, 0.3), o.width = between(random, 1e-3, 4e-3),
    o.place = between(random, 0.0, o.width);
  if (kind == "hardness_slope") o.size = between(random, 0.03, 0.1) * oneOf<double>(random, {-1.0, 1.0});
  const auto zero = [&](double low, double high) {
    on_channel(low, high);
    o.size *= oneOf<double>(random, {-1.0, 1.0});
  };
  if (kind == "zero_drift") zero(0.5, 3.0);
  if (kind == "zero_approach") zero(6.0, 25.0), o.place = between(random, 100.0, 400.0);
  if (kind == "zero_step") zero(4.0, 20.0), o.place = between(random, 200.0, 700.0);
  if (kind == "zero_of_record") zero(4.0, 15.0);
  if (kind == "lost_corner") o.place = between(random, 0.2, 0.5) * depth;
  return o;
}

}  // namespace

std::vector<Case> drawCases(const Counts& counts, const std::vector<std::string>& names, std::uint64_t seed,
                            const std::vector<std::string>& outside) {
  Random random(seed);
  std::vector<Case> cases;
  const auto add = [&](const std::string& kind, const std::vector<std::string>& hidden) {
    const bool needs_tip = std::any_of(hidden.begin(), hidden.end(), [](const std::string& name) {
      const EffectKind* effect = findEffect(name);
      return effect && effect->has(EffectNeed::flexible_tool);
    });
    cases.push_back({kind, hidden, needs_tip || cases.size() % 2 == 1, random()});
  };
  const auto several = [&](const std::string& kind, std::size_t count) {
    std::vector<std::string> hidden;
    while (hidden.size() < std::min(count, names.size())) {
      const std::string& name = oneOf(random, names);
      if (std::find(hidden.begin(), hidden.end(), name) == hidden.end()) hidden.push_back(name);
    }
    add(kind, hidden);
  };
  for (const std::string& name : names) {
    for (int k = 0; k < counts.singles; ++k) add("single", {name});
  }
  for (int k = 0; k < counts.pairs; ++k) several("pair", 2);
  for (int k = 0; k < counts.triples; ++k) several("triple", 3);
  for (int k = 0; k < counts.none; ++k) add("none", {});
  for (int k = 0; k < counts.outside; ++k)
    add("outside", {outside[static_cast<std::size_t>(k) % outside.size()]});
  return cases;
}

Drawn draw(const Case& hidden) {
  Random random(hidden.seed);
  Drawn drawn;
  drawn.plant = drawPlant(hidden.vibrating, random);
  drawn.nominal = believedOf(drawn.plant, hidden.nominal_errors, random);
  if (hidden.kind != "outside") {
    for (const std::string& name : hidden.names)
      drawn.plant.effects.push_back(drawEffect(name, drawn.nominal, random));
  }
  Plan plan = drawPlan(random);
  plan.moves = std::any_of(drawn.plant.effects.begin(), drawn.plant.effects.end(), [](const EffectEntry& e) {
    return findEffect(e.name)->has(EffectNeed::axis_motion);
  });
  const double depth = depthFor(drawn.plant, plan, hidden.seed);
  if (hidden.kind == "outside") drawn.plant.outside = drawOutside(hidden.names.front(), depth, random);
  drawn.campaign.model_file = "model.yaml";
  drawn.campaign.tests = testsOf(plan, depth);
  drawn.angle = plan.angle;
  return drawn;
}

std::vector<Record> runCampaign(const Drawn& drawn, const Case& hidden, bool second) {
  Random phases(hidden.seed + 1), random(hidden.seed + (second ? 3 : 2));
  RunOptions options;
  options.show_tip = !drawn.plant.tip[0].empty();
  options.show_angle = drawn.angle;
  std::vector<Record> records;
  for (const CampaignTest& test : drawn.campaign.tests) {
    options.phase = between(phases, 0.0, units::TWO_PI);
    records.push_back(run(drawn.plant, test, options, random));
  }
  return records;
}

void writeCampaignOf(const Drawn& drawn, const std::vector<Record>& records, const std::string& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw Error(folder + ": " + failed.message());
  writeMachineModel(drawn.nominal, folder + "/model.yaml");
  writeCampaign(drawn.campaign, folder);
  for (std::size_t k = 0; k < records.size(); ++k)
    writeCsv(records[k], folder + "/" + drawn.campaign.tests[k].file);
}

void writeTruth(const Drawn& drawn, const std::string& file) {
  std::ostringstream text;
  text << "effects:" << (drawn.plant.effects.empty() ? " {}" : "") << "\n";
  for (const EffectEntry& e : drawn.plant.effects) {
    text << "  " << e.name << ":\n";
    for (const auto& [key, word] : e.words) text << "    " << key << ": " << word << "\n";
    for (const auto& [key, value] : numbersOf(e)) text << "    " << key << ": " << value << "\n";
  }
  if (drawn.plant.outside) {
    const Outside& o = *drawn.plant.outside;
    text << "outside: {kind: " << o.kind << ", channel: '" << o.channel << "', size: " << o.size
         << ", place: " << o.place << ", width: " << o.width << "}\n";
  }
  writeText(file, text.str());
}

}  // namespace smartmill::plant
