#pragma once

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/testing/mill.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::sim {

constexpr double RATE = 25600.0;  // [Hz]

inline MachineModel with(MachineModel model, const std::vector<EffectEntry>& effects) {
  for (const EffectEntry& e : effects) model.effects.push_back(e);
  return model;
}

inline CampaignTest airCut(double rpm) {
  CampaignTest test;
  test.name = "air";
  test.kind = TestKind::air;
  test.sample_rate = RATE;
  test.spindle_speed = units::radPerSecFromRpm(rpm);
  test.start_time = 100.0;
  return test;
}

/// A slot, in cut over the whole record.
inline CampaignTest slotCut(double rpm, double depth = 2e-3, double feed = 1e-4) {
  CampaignTest test = airCut(rpm);
  test.name = "slot";
  test.kind = TestKind::cut;
  test.cut_time_before = 60.0;
  test.engagement = Engagement{0.0, units::PI, depth, feed};
  return test;
}

/// Simulates without noise; tooth 1 is at phase [rad] at the first sample.
inline Record run(const MachineModel& model, const CampaignTest& test, double duration, double phase = 0.0) {
  SimulationOptions options;
  options.noise = false;
  options.phase = phase;
  return simulateTest(model, test, duration, options);
}

/// Value of a channel when tooth 1 is at an angle, in the first revolution; the angle must fall on a
/// sample.
inline double at(const Record& record, const char* channel, double angle, double speed) {
  const double sample = angle / speed * RATE;
  return record.column(channel).at(static_cast<std::size_t>(std::lround(sample)));
}

/// A speed at which a revolution has 512 samples: quarters and tenths of a revolution fall on samples.
constexpr double EVEN_RPM = RATE / 512.0 * 60.0;  // 3000 rpm
constexpr double EVEN_SPEED = RATE / 512.0 * units::TWO_PI;
constexpr double REVOLUTION = 512.0 / RATE;  // [s]

}  // namespace smartmill::sim
