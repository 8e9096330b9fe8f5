#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "smartmill_core/testing/mill.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {

constexpr double AIR_CUT_NOISE = 2.2e-4;  // [V]

inline MachineModel spindleOnly() {
  MachineModel m;
  m.spindle = mill().spindle;
  m.spindle->load_meter_resolution = 1e-6;
  return m;
}

inline EffectEntry stribeckFriction(double breakaway_nm, double speed_rpm) {
  EffectEntry e;
  e.name = "stribeck_friction";
  e.numbers = {{"breakaway_nm", breakaway_nm}, {"speed_rpm", speed_rpm}};
  return e;
}

/// Air cuts of a machine, load meter only.
inline Dataset airCuts(const MachineModel& machine, const MachineModel& nominal, std::mt19937_64& random) {
  std::normal_distribution<double> noise(0.0, AIR_CUT_NOISE);
  Dataset data;
  data.nominal = nominal;
  data.noise["load_meter"] = AIR_CUT_NOISE;
  sim::SimulationOptions quiet;
  quiet.noise = false;
  for (const double rpm : {600.0, 1000.0, 2000.0, 3000.0, 6000.0, 12000.0}) {
    TestData t;
    t.test.name = "air_" + std::to_string(static_cast<int>(rpm));
    t.test.kind = TestKind::air;
    t.test.sample_rate = 2000.0;
    t.test.spindle_speed = units::radPerSecFromRpm(rpm);
    t.test.start_time = 0.0;
    t.channels = {"load_meter"};
    std::vector<double> angle, blank;
    for (int i = 0; i < 300; ++i) {
      t.record.time.push_back(i / t.test.sample_rate);
      angle.push_back(std::fmod(t.test.spindle_speed * t.record.time.back(), units::TWO_PI));
      blank.push_back(0.0);
    }
    t.record.add("spindle_angle") = angle;
    t.record.add("load_meter") = blank;
    std::vector<double> load = sim::simulateTest(machine, t.test, t.record, quiet).column("load_meter");
    for (double& v : load) v += noise(random);
    t.record.add("load_meter") = load;
    t.quiet = t.first_cut = t.record.size();
    data.tests.push_back(std::move(t));
  }
  return data;
}

}  // namespace smartmill::discrepancy
