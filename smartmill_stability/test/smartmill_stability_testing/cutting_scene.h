#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include "smartmill_core/signal/streams.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {

inline constexpr double RATE = 25600.0, SPEED = units::TWO_PI * 75.3;  // 4518 rpm
inline constexpr int BLOCK = 256;

struct Scene {
  double chatter = 0.0;       // [N] amplitude in x
  double frequency = 1043.0;  // [Hz]
  double noise = 1.0;         // [N]
  double chatter_from = 0.0;  // [s]
  double alternating = 0.0;   // [N] at half the tooth passing frequency of four teeth
  double transient = 0.0;     // [N] at the chatter frequency from the start of the cut, time constant 0.12 s
  int teeth = 0;              // stated in the condition
  double duration = 3.0;      // [s]; full engagement from 0.5 s to 2.5 s
};

/// A cut along x of 20 mm/s with forced vibration at the harmonics of tooth and spindle.
/// @param handle called with each condition, state, angle and force block in stamp order
/// @param start [s] added to all stamps
template <typename Handle>
void play(const Scene& scene, const Handle& handle, double start = 0.0) {
  CuttingCondition condition;
  condition.stamp = start + 0.01;
  condition.kind = CuttingCondition::Kind::cut;
  condition.name = "cut_1";
  condition.tool.teeth = scene.teeth;
  condition.steady_from = {{0.010, 0.0, -0.001}};
  condition.steady_to = {{0.050, 0.0, -0.001}};
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0.0, scene.noise);
  handle(condition);
  double next_block = 0.0, next_angle = 0.0, next_state = 0.0;
  for (int b = 0; next_block < scene.duration;) {
    if (next_state <= next_angle && next_state <= next_block) {
      CncState state;
      state.stamp = start + next_state;
      state.connected = true;
      state.axes = {"X", "Y", "Z"};
      state.position = {0.020 * next_state, 0.0, -0.001};
      state.distance_to_go = {0.0, 0.0, 0.0};
      state.feed = 0.020;
      state.spindle_speed = SPEED;
      handle(state);
      next_state += 0.02;
    } else if (next_angle <= next_block) {
      handle(SpindleAngle{start + next_angle, std::fmod(SPEED * next_angle, units::TWO_PI), SPEED});
      next_angle += 0.0087;
    } else {
      ForceBlock block;
      block.stamp = start + next_block;
      block.sample_rate = RATE;
      block.first_index = static_cast<std::uint64_t>(b) * BLOCK;
      block.status = ForceBlock::Status::compensated;
      for (int i = 0; i < BLOCK; ++i) {
        const double t = next_block + i / RATE, angle = SPEED * t;
        const bool cutting = t > 0.5 && t < 2.5;
        const double forced = cutting ? 200.0 + 150.0 * std::cos(4.0 * angle) +
                                            60.0 * std::cos(8.0 * angle + 1.0) +
                                            40.0 * std::cos(angle + 0.3)  // runout
                                      : 0.0;
        const double chatter = cutting && t > scene.chatter_from
                                   ? scene.chatter * std::cos(units::TWO_PI * scene.frequency * t)
                                   : 0.0;
        const double more = cutting ? scene.alternating * std::cos(2.0 * angle + 0.7) +
                                          scene.transient * std::exp(-(t - 0.5) / 0.12) *
                                              std::cos(units::TWO_PI * scene.frequency * t)
                                    : 0.0;
        block.force[0].push_back(forced + chatter + more + normal(random));
        block.force[1].push_back(0.7 * forced + normal(random));
        block.force[2].push_back(normal(random));
      }
      handle(block);
      next_block += BLOCK / RATE;
      ++b;
    }
  }
}

}  // namespace smartmill::stability
