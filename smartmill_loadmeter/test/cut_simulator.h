#pragma once

#include <cmath>
#include <random>
#include <string>

#include "smartmill_core/signal/streams.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

inline constexpr double SAMPLE_RATE = 8000.0;  // [Hz]
constexpr double SPEED = 400.0;                // [rad/s]
constexpr double KTC = 800e6, KRC = 250e6, KTE = 20e3, KRE = 15e3;

/// Streams of cuts with straight teeth along a heading, forces in closed form.
/// @param Consumer receives each input in stamp order
template <class Consumer>
class CutSimulator {
 public:
  explicit CutSimulator(Consumer consumer) : consumer_(consumer) {}

  double heading = 0.0;    // [rad]
  double noise = 1.0;      // [N]
  double vibration = 0.0;  // [N] of a vibration that is not synchronous with the spindle

  void cut(const std::string& name, double feed_per_tooth, double seconds = 1.5) {
    CuttingCondition c;
    c.stamp = now_;
    c.kind = CuttingCondition::Kind::cut;
    c.name = name;
    c.material = "steel";
    c.tool_name = "cutter";
    c.tool = {2, 12e-3, 0.0, {}};
    c.engagement = {0.0, units::PI, 2e-3, feed_per_tooth};
    c.spindle_speed = SPEED;
    const double feed = feed_per_tooth * 2.0 * SPEED / units::TWO_PI, length = feed * seconds;
    c.steady_to = {length * std::cos(heading), length * std::sin(heading), 0.0};
    consumer_(c);
    const double begin = now_;
    for (; now_ < begin + seconds; now_ += 0.01) {
      const double along = feed * (now_ - begin);
      CncState state;
      state.stamp = now_;
      state.connected = state.motion = true;
      state.feed = feed;
      state.axes = {"X", "Y", "Z"};
      state.position = {along * std::cos(heading), along * std::sin(heading), 0.0};
      state.distance_to_go = {0.0, 0.0, 0.0};
      consumer_(state);
      consumer_(SpindleAngle{now_, std::fmod(SPEED * now_, units::TWO_PI), SPEED});
      consumer_(block(c.engagement));
    }
    now_ = std::round(100.0 * now_) / 100.0;
  }
  void end() {
    CuttingCondition none;
    none.stamp = now_;
    none.name = "end";
    consumer_(none);
  }

 private:
  ForceBlock block(const Engagement& e) {
    ForceBlock block;
    block.stamp = now_;
    block.sample_rate = SAMPLE_RATE;
    block.status = ForceBlock::Status::compensated;
    for (int i = 0; i < static_cast<int>(0.01 * SAMPLE_RATE); ++i) {
      const double time = now_ + i / SAMPLE_RATE;
      double along = 0.0, across = 0.0;
      for (int tooth = 0; tooth < 2; ++tooth) {
        // The spindle angle is measured from the machine's +y, the immersion from the normal of the feed.
        const double phi =
            std::fmod(SPEED * time + heading + units::PI * tooth + units::TWO_PI, units::TWO_PI);
        if (phi >= units::PI) continue;
        const double h = e.feed_per_tooth * std::sin(phi);
        const double t = e.axial_depth * (KTC * h + KTE), r = e.axial_depth * (KRC * h + KRE);
        along += -t * std::cos(phi) - r * std::sin(phi);
        across += t * std::sin(phi) - r * std::cos(phi);
      }
      along += vibration * std::sin(1.37 * SPEED * time);
      block.force[0].push_back(along * std::cos(heading) - across * std::sin(heading) +
                               noise * normal_(random_));
      block.force[1].push_back(along * std::sin(heading) + across * std::cos(heading) +
                               noise * normal_(random_));
      block.force[2].push_back(0.0);
    }
    return block;
  }

  Consumer consumer_;
  double now_ = 10.0;
  std::mt19937 random_{3};
  std::normal_distribution<double> normal_;
};

}  // namespace smartmill::loadmeter
