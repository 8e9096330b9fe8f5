#include "discrepancy/bench_campaign.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/hypotheses/nominal_freedom.h"
#include "smartmill_sim/twin/cutting_machine.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

using Random = std::mt19937_64;

double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

template <class T>
T oneOf(Random& random, const std::vector<T>& choices) {
  return choices[std::uniform_int_distribution<std::size_t>(0, choices.size() - 1)(random)];
}

Mode modeOf(double frequency, double damping_ratio, double gain) {
  Mode m;
  m.frequency = frequency;
  m.damping_ratio = damping_ratio;
  m.gain = gain;
  return m;
}

std::vector<CampaignTest> plan() {
  std::vector<CampaignTest> tests;
  double start = 0.0, cut_time = 0.0;
  const auto add = [&](const std::string& name, TestKind kind, double rpm) -> CampaignTest& {
    CampaignTest t;
    t.name = name;
    t.kind = kind;
    t.file = name + ".csv";
    t.sample_rate = 25600.0;
    t.spindle_speed = units::radPerSecFromRpm(rpm);
    t.start_time = start;
    start += 45.0;
    tests.push_back(t);
    return tests.back();
  };
  for (const int rpm : {1000, 3000, 6000, 9000, 12000, 18000})
    add("air_" + std::to_string(rpm), TestKind::air, rpm);
  for (const char* axis : {"x", "y", "z"})
    add(std::string("tap_") + axis, TestKind::tap, 0.0).direction = axis;
  const auto cut = [&](const std::string& name, double rpm, double feed, double depth, double entry,
                       double exit) {
    CampaignTest& t = add(name, TestKind::cut, rpm);
    t.engagement =
        Engagement{units::radFromDeg(entry), units::radFromDeg(exit), depth * units::MM, feed * units::MM};
    t.engage_time = 0.02;
    t.cut_time_before = cut_time;
    cut_time += 20.0;
  };
  cut("slot_4500_030", 4500, 0.03, 2, 0, 180);
  cut("slot_4500_060", 4500, 0.06, 2, 0, 180);
  cut("slot_4500_100", 4500, 0.10, 2, 0, 180);
  for (const int rpm : {1200, 3000, 7200, 9000, 13950})
    cut("slot_" + std::to_string(rpm), rpm, 0.06, 2, 0, 180);
  cut("up_4500", 4500, 0.08, 2, 0, 90);
  cut("down_4500", 4500, 0.08, 2, 90, 180);
  cut("slot_4500_deep", 4500, 0.06, 4, 0, 180);
  cut("slot_4500_again", 4500, 0.06, 2, 0, 180);
  return tests;
}

// One test of a hidden machine as its sensors show it.
class BenchRecorder {
 public:
  BenchRecorder(const CampaignTest& test, const BenchTruth& truth, int substeps, Random& random)
      : test_(test),
        outside_(truth.outside),
        substeps_(substeps),
        machine_(truth.machine, 1.0 / (test.sample_rate * substeps)) {
    machine_.setClock({test.start_time.value_or(0.0), test.cut_time_before.value_or(0.0), true});
    machine_.resetLoadMeter(test.spindle_speed);
    for (sim::Tone* tone : machine_.tones()) tone->phase = between(random, 0.0, units::TWO_PI);
    phase_ = between(random, 0.0, units::TWO_PI);
    own_phase_ = between(random, 0.0, units::TWO_PI);
    peak_ = between(random, 150.0, 300.0);
    if (cut())
      feed_ =
          test.engagement->feed_per_tooth * truth.machine.tool->teeth * test.spindle_speed / units::TWO_PI;
  }

  Record record(Random& random, std::normal_distribution<double>& normal) {
    Record record;
    std::vector<double> angles, hammer, load;
    std::array<std::vector<double>, 3> force;
    const std::size_t count = samples();
    for (std::size_t i = 0; i < count; ++i) {
      const double t = static_cast<double>(i) / test_.sample_rate;
      const sim::CuttingMachine::Input now = inputAt(t);
      sim::ChannelValues shown = step(i);
      record.time.push_back(t);
      angles.push_back(std::fmod(now.motion.angle, units::TWO_PI));
      double blow = 0.0;
      for (const double f : now.sensor_force) blow += f;
      hammer.push_back(blow + 0.2 * normal(random));
      addOutside(t, shown);
      machine_.finish(t, shown);
      for (std::size_t a = 0; a < 3; ++a) force[a].push_back(shown[a] + normal(random));
      load.push_back(machine_.rounded(shown[sim::LOAD_METER] + 2e-4 * normal(random)));
    }
    record.add("spindle_angle") = angles;
    record.add("fx") = force[0];
    record.add("fy") = force[1];
    record.add("fz") = force[2];
    if (tap()) {
      record.add("hammer") = hammer;
    } else {
      record.add("load_meter") = load;
    }
    return record;
  }

 private:
  static constexpr double HIT = 5e-3, WIDTH = 0.6e-3;  // [s] of a tap

  bool tap() const { return test_.kind == TestKind::tap; }
  bool cut() const { return test_.kind == TestKind::cut; }
  std::size_t samples() const {
    return tap() ? 3072 : cut() ? (test_.spindle_speed < 200.0 ? 7680 : 5120) : 3840;
  }

  sim::CuttingMachine::Input inputAt(double t) const {
    sim::CuttingMachine::Input input;
    input.motion.angle = phase_ + test_.spindle_speed * t;
    input.motion.speed = test_.spindle_speed;
    input.motion.velocity[0] = feed_;
    input.motion.centre[0] = feed_ * t;
    const std::size_t axis = test_.direction == "x" ? 0 : test_.direction == "y" ? 1 : 2;
    if (tap() && t > HIT && t < HIT + WIDTH)
      input.sensor_force[axis] = peak_ * std::sin(units::PI * (t - HIT) / WIDTH);
    return input;
  }

  // From sample i to the next. @return the early channels at sample i
  sim::ChannelValues step(std::size_t i) {
    sim::ChannelValues shown{};
    for (int s = 0; s < substeps_; ++s) {
      const double t = (static_cast<double>(i) + static_cast<double>(s) / substeps_) / test_.sample_rate;
      const sim::CuttingMachine::Input input = inputAt(t);
      if (cut() && !engaged_ && t >= *test_.engage_time - 1e-3 / test_.sample_rate) {
        machine_.engage({{test_.engagement->entry, test_.engagement->exit, test_.engagement->axial_depth}},
                        input.motion, sim::engagementRise(machine_.vibrates()) * substeps_);
        engaged_ = true;
      }
      const sim::CuttingMachine::Output out = machine_.step(input);
      if (s == 0) shown = out.early;
    }
    return shown;
  }

  // Locked to the spindle or the same in every record, order and level would be effects.
  void addOutside(double t, sim::ChannelValues& shown) const {
    if (!outside_) return;
    const OutsideCause& o = *outside_;
    const double wave = o.kind == "tone" ? std::sin(units::TWO_PI * o.place * t + own_phase_)
                        : o.kind == "order"
                            ? (tap() ? 0.0 : std::sin(o.place * test_.spindle_speed * t + own_phase_))
                        : o.kind == "level" ? std::cos(own_phase_)
                                            : std::exp(-t / o.place);
    shown[sim::channelOf(o.channel)] += o.amplitude * wave;
  }

  const CampaignTest& test_;
  const std::optional<OutsideCause>& outside_;
  int substeps_;
  sim::CuttingMachine machine_;
  double phase_ = 0.0, own_phase_ = 0.0;  // [rad] of tooth 1 and of what comes from outside
  double peak_ = 0.0;                     // [N] of a tap
  double feed_ = 0.0;                     // [m/s]
  bool engaged_ = false;
};

}  // namespace

std::string OutsideCause::domain() const {
  return kind == "tone" ? "frequency" : kind == "order" ? "order" : kind == "level" ? "level" : "time";
}

MachineModel drawMachine(Random& random, bool flexible) {
  MachineModel m;
  ToolGeometry tool;
  tool.teeth = oneOf<int>(random, {2, 3, 4});
  tool.diameter = oneOf<double>(random, {10e-3, 12e-3, 16e-3, 19.05e-3});
  tool.helix = units::radFromDeg(oneOf<double>(random, {20, 30, 35, 40}));
  m.tool = tool;
  m.cutting = CuttingCoefficients{between(random, 650e6, 1000e6), between(random, 150e6, 400e6),
                                  between(random, 120e6, 250e6),  between(random, 10e3, 30e3),
                                  between(random, 12e3, 35e3),    between(random, 0.6e3, 4e3)};
  const std::array<double, 3> low{{900.0, 1000.0, 1900.0}}, high{{1500.0, 1900.0, 2800.0}};
  for (std::size_t a = 0; a < 3; ++a) {
    const double gain = a < 2 ? 0.9 : 0.95;
    m.force_sensor.axis[a].modes = {
        modeOf(between(random, low[a], high[a]), between(random, 0.015, 0.04), gain)};
    m.force_sensor.axis[a].direct = 1.0 - gain;
  }
  m.force_sensor.noise_rms = Axes3{{1.0, 1.0, 1.0}};
  Spindle s;
  s.viscous = between(random, 3.0e-4, 5.0e-4);
  s.coulomb = between(random, 0.02, 0.08);
  s.load_meter_gain = 3.88e-4;
  s.load_meter_bandwidth = 7.0;
  s.load_meter_resolution = 3e-4;
  m.spindle = s;
  if (flexible) {
    m.tool_tip.x.modes = {modeOf(between(random, 900.0, 1800.0), between(random, 0.03, 0.05),
                                 1e-6 / between(random, 25.0, 45.0))};
    m.tool_tip.y.modes = {modeOf(between(random, 900.0, 1800.0), between(random, 0.03, 0.05),
                                 1e-6 / between(random, 25.0, 45.0))};
  }
  return m;
}

MachineModel drawTruth(const MachineModel& nominal, Random& random) {
  const NominalFreedom freedom(nominal);
  std::normal_distribution<double> normal;
  std::vector<double> values;
  for (const Coordinate& c : freedom.coordinates()) values.push_back(c.prior_std * normal(random));
  return freedom.apply(nominal, values);
}

OutsideCause drawOutside(Random& random) {
  OutsideCause o;
  o.kind = oneOf<std::string>(random, {"tone", "level", "order", "settling"});
  o.channel = oneOf<std::string>(random, {"fx", "fy", "fz"});
  o.amplitude = between(random, 3.0, 12.0);
  o.place = o.kind == "tone" ? between(random, 25.0, 45.0) + (between(random, 0.0, 1.0) < 0.5 ? 0.0 : 200.0)
            : o.kind == "order" ? oneOf<double>(random, {0.5, 5.0, 7.0})
                                : between(random, 0.03, 0.08);
  return o;
}

void writeBenchCampaign(const MachineModel& nominal, const BenchTruth& truth, const std::string& folder,
                        std::uint64_t seed, int substeps) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw Error(folder + ": " + failed.message());
  Campaign campaign;
  campaign.folder = folder;
  campaign.model_file = "model.yaml";
  campaign.tests = plan();
  writeMachineModel(nominal, folder + "/model.yaml");
  writeCampaign(campaign, folder);
  Random random(seed);
  std::normal_distribution<double> normal;
  for (const CampaignTest& test : campaign.tests) {
    BenchRecorder recorder(test, truth, substeps, random);
    writeCsv(recorder.record(random, normal), folder + "/" + test.file);
  }
}

}  // namespace smartmill::discrepancy
