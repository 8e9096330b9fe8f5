#include "loadmeter/machine_cases.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_core/math/running_line.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"

namespace smartmill::loadmeter {

namespace {

using units::PI;
using units::TWO_PI;

constexpr double RATE = 1000.0;  // [Hz]
constexpr double LENGTH = 1.6;   // [s] of a record
constexpr double ENGAGE = 0.4;   // [s]
constexpr int SUBSTEPS = 10;
constexpr std::size_t ANGLES = 360;
constexpr double ZERO_BELOW_RPM = 2000.0;  // the thesis assumes zero friction below

}  // namespace

std::vector<double> torqueOverARevolution(const ToolGeometry& tool, const Engagement& e,
                                          const CuttingCoefficients& k, double offset, double angle,
                                          std::size_t steps) {
  const int slices = tool.helix > 0.0 ? 24 : 1;
  const double dz = e.axial_depth / slices;
  const RigidCut cut(tool, {}, e, runoutRadii(tool, offset, angle));
  std::vector<double> torque(steps, 0.0);
  for (std::size_t i = 0; i < steps; ++i) {
    for (int s = 0; s < slices; ++s) {
      const double lag = tool.lag() * (s + 0.5) * dz;
      for (int t = 0; t < tool.teeth; ++t) {
        double phi = TWO_PI * static_cast<double>(i) / static_cast<double>(steps) + tool.toothAngle(t) - lag;
        phi -= TWO_PI * std::floor(phi / TWO_PI);
        if (phi < e.entry || phi > e.exit) continue;
        const double h = cut.chip(t, phi);
        if (h > 0.0) torque[i] += (k.ktc * h + k.kte) * dz * tool.radius();
      }
    }
  }
  return torque;
}

namespace {

/// Random numbers of one case.
struct Draws {
  explicit Draws(unsigned seed) : random(seed) {}
  double normal() { return normal_distribution(random); }
  double uniform() { return uniform_distribution(random); }
  double between(double low, double high) { return low + (high - low) * uniform(); }

  std::mt19937 random;
  std::normal_distribution<double> normal_distribution;
  std::uniform_real_distribution<double> uniform_distribution;
};

ToolGeometry drawTool(Draws& draw) {
  ToolGeometry tool;
  tool.teeth = 2 + static_cast<int>(draw.uniform() * 3.0);
  tool.diameter = draw.between(0.010, 0.025);
  tool.helix = units::radFromDeg(draw.between(0.0, 45.0));
  return tool;
}

Spindle drawSpindle(Draws& draw, const Faults& faults) {
  Spindle s;
  s.viscous = draw.between(2e-4, 6e-4);
  s.coulomb = draw.between(0.0, 0.15);
  s.load_meter_gain = 3.88e-4;
  s.load_meter_bandwidth = 7.0;
  s.load_meter_resolution = faults.resolution > 0.0 ? faults.resolution : 1e-9;
  return s;
}

FrictionLaw drawFriction(Draws& draw, const Spindle& nominal, const Faults& faults) {
  FrictionLaw law;
  law.viscous = nominal.viscous * (1.0 + 0.1 * draw.normal());
  law.coulomb = nominal.coulomb * (1.0 + 0.1 * draw.normal());
  if (faults.stribeck) {
    law.breakaway = draw.between(0.1, 0.6);
    law.stribeck_speed = units::radPerSecFromRpm(draw.between(1000.0, 3000.0));
  }
  if (faults.warmup) {
    law.cold_ratio = draw.between(0.1, 0.4);
    law.warmup_time = draw.between(200.0, 1200.0);
  }
  return law;
}

/// The true machine, which runs one test after the other.
struct TrueMachine {
  const Faults& faults;
  ToolGeometry tool;
  CuttingCoefficients truth;
  FrictionLaw law;
  double gain = 0.0;                   // [V/W] of the load meter
  double depth_share = 1.0;            // [1] actual over commanded axial depth
  double offset = 0.0, angle = 0.0;    // [m], [rad] runout
  double clock = 0.0, cut_time = 0.0;  // [s]

  TestRecord run(Draws& draw, const std::string& name, TestKind kind, double speed, const Engagement& e) {
    TestRecord t;
    t.test.name = name;
    t.test.kind = kind;
    t.test.sample_rate = RATE;
    t.test.spindle_speed = speed;
    t.test.start_time = clock;
    std::vector<double> torque(ANGLES, 0.0);
    if (kind == TestKind::cut) {
      t.test.engagement = e;
      t.test.engage_time = ENGAGE;
      t.test.cut_time_before = cut_time;
      Engagement actual = e;
      actual.axial_depth *= depth_share;
      torque = torqueOverARevolution(tool, actual, truth, offset, angle, ANGLES);
      cut_time += 5.0;
    }
    t.record.file = name;
    record(draw, speed, torque, &t.record);
    clock += 45.0;
    return t;
  }

 private:
  /// The load meter: a first-order filter of the power, with noise, rounded.
  void record(Draws& draw, double speed, const std::vector<double>& torque, Record* r) const {
    const double tau = timeConstant(faults.bandwidth), friction = law.torque(speed, clock);
    double meter = gain * friction * speed, at = TWO_PI * draw.uniform();
    r->add("load_meter");
    const double dt = 1.0 / RATE / SUBSTEPS, keep = std::exp(-dt / tau);
    for (int i = 0; i < static_cast<int>(LENGTH * RATE); ++i) {
      const double time = i / RATE;
      r->time.push_back(time);
      const double shown = meter + faults.noise * draw.normal();
      r->columns[0].push_back(
          faults.resolution > 0.0 ? faults.resolution * std::round(shown / faults.resolution) : shown);
      for (int k = 0; k < SUBSTEPS; ++k) {
        const double now = time + (k + 0.5) * dt;
        at = std::fmod(at + speed * dt, TWO_PI);
        // Air gives no torque at any angle.
        const double cutting =
            now >= ENGAGE ? torque[static_cast<std::size_t>(at / TWO_PI * ANGLES) % ANGLES] : 0.0;
        meter = keep * meter + (1.0 - keep) * gain * (friction + cutting) * speed;
      }
    }
  }
};

}  // namespace

MachineCase drawCase(unsigned seed, const Faults& faults) {
  Draws draw(seed);
  MachineCase c;
  const ToolGeometry tool = drawTool(draw);
  c.truth.ktc = draw.between(500e6, 2200e6);
  c.truth.kte = draw.between(8e3, 40e3);
  const Spindle spindle = drawSpindle(draw, faults);
  TrueMachine machine{faults, tool, c.truth, drawFriction(draw, spindle, faults)};
  machine.gain = spindle.load_meter_gain * (1.0 + faults.gain_error * draw.normal());
  machine.depth_share = 1.0 + faults.depth_error * draw.normal();
  machine.offset = draw.between(0.0, faults.largest_runout);
  machine.angle = draw.between(0.0, TWO_PI);
  c.depth = machine.depth_share - 1.0;
  c.model.file = "case " + std::to_string(seed);
  c.model.tool = tool;
  c.model.spindle = spindle;

  const auto run = [&](TestKind kind, double speed, const Engagement& e) {
    c.tests.push_back(machine.run(draw, "test" + std::to_string(c.tests.size()), kind, speed, e));
  };
  for (const double rpm :
       {1000.0, 1500.0, 2000.0, 3000.0, 4500.0, 6000.0, 8000.0, 10000.0, 12500.0, 15000.0}) {
    run(TestKind::air, units::radPerSecFromRpm(rpm), {});
  }
  // Depth for a torque within the limit of the spindle.
  const double torque_per_metre = tool.radius() * tool.teeth * (c.truth.ktc * 8e-5 / PI + c.truth.kte / 2.0);
  const double depth = std::min(2.5 / torque_per_metre, 0.004);
  const double slow = units::radPerSecFromRpm(draw.between(2500.0, 4000.0));
  for (const double speed : {slow, 1.8 * slow}) {
    for (const double feed : {4e-5, 7e-5, 1.0e-4, 1.3e-4}) run(TestKind::cut, speed, {0.0, PI, depth, feed});
  }
  return c;
}

CaseErrors judge(const MachineCase& one, const Faults& faults) {
  CaseErrors errors{};
  const Spindle& s = *one.model.spindle;
  const ToolGeometry& tool = *one.model.tool;
  // The thesis: straight lines through steady means, friction zero below 2000 rpm, one speed.
  std::vector<AirCut> air;
  RunningLine line;  // [N/m] over [m]
  IdleVoltage idle;
  double slot_speed = 0.0;
  for (const auto& [test, record] : one.tests) {
    const std::vector<double>& v = record.columns[0];
    const auto steady = v.begin() + static_cast<std::ptrdiff_t>((ENGAGE + 0.3) * RATE);
    double level = 0.0;
    for (auto i = steady; i != v.end(); ++i) level += *i / static_cast<double>(v.end() - steady);
    if (test.kind == TestKind::air) {
      air.push_back({test.spindle_speed, level, 0.0});
      continue;
    }
    const double zero_below = units::radPerSecFromRpm(ZERO_BELOW_RPM);
    if (line.count() == 0) {
      idle = fitIdleVoltage(air, zero_below, s.load_meter_resolution);
      slot_speed = test.spindle_speed;
    }
    if (test.spindle_speed != slot_speed) continue;
    const double w = test.spindle_speed, friction = w < zero_below ? 0.0 : idle.at(w);
    // eq. 3.5, 3.19: T / (R N a) = Ktc s / pi + Kte / 2.
    const double y = (level - friction) / (s.load_meter_gain * w) /
                     (tool.radius() * tool.teeth * test.engagement->axial_depth);
    const double x = test.engagement->feed_per_tooth;
    line.add(x, y);
  }
  errors.thesis_ktc = line.slope() * PI / one.truth.ktc - 1.0;
  errors.thesis_kte = line.level() * 2.0 / one.truth.kte - 1.0;

  LoadRecordOptions options;
  options.depth_uncertainty = faults.depth_error;
  options.runout_uncertainty =
      faults.largest_runout / std::sqrt(3.0);  // of a uniform distribution up to the largest
  MachineModel model = one.model;
  if (faults.gain_error > 0.0) {
    options.spindle_uncertainty = true;
    model.uncertainty.spindle = 100.0 * faults.gain_error;
  }
  const LoadRecordResult found = identifyFromLoadRecords(one.tests, model, options, one.model.file);
  errors.ktc = found.set.value.ktc / one.truth.ktc - 1.0;
  errors.kte = found.set.value.kte / one.truth.kte - 1.0;
  errors.z_ktc = (found.set.value.ktc - one.truth.ktc) / found.set.std_dev.ktc;
  errors.z_kte = (found.set.value.kte - one.truth.kte) / found.set.std_dev.kte;
  errors.depth = one.depth;
  const double own = found.set.std_dev.ktc / found.set.value.ktc;
  errors.z_beside_depth = ((1.0 + errors.ktc) / (1.0 + one.depth) - 1.0) /
                          std::sqrt(own * own - options.depth_uncertainty * options.depth_uncertainty);
  errors.terms = found.terms;
  return errors;
}

}  // namespace smartmill::loadmeter
