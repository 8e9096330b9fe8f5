// A spindle with an encoder, one pulse a turn, a controller and a cut; sources fail one after the other.

#include "smartmill_cnc/angle/angle_sources.h"

#include <cmath>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::cnc {
namespace {

constexpr double RATE = 10000.0, SPEED = 420.0;  // [Hz], [rad/s]
constexpr std::uint64_t BLOCK = 100;

double apart(double a, double b) {
  return std::remainder(a - b, units::TWO_PI);
}

class Spindle {
 public:
  Spindle() {
    AngleSourcesParameters parameters;
    parameters.encoder.counts_per_revolution = 4096.0;
    sources_ = std::make_unique<AngleSources>(parameters);
    CuttingCondition condition;
    condition.kind = CuttingCondition::Kind::cut;
    condition.tool.teeth = 4;
    sources_->push(condition);
  }

  void run(double seconds, bool encoder, bool pulses, bool controller, bool forces) {
    const auto end = next_ + static_cast<std::uint64_t>(seconds * RATE);
    for (; next_ < end; next_ += BLOCK) {
      CncState state;
      state.stamp = time(0);
      state.connected = true;
      state.spindle_speed = 1.01 * SPEED;  // its load meter, not an encoder
      take(sources_->push(state));
      if (encoder)
        take(sources_->pushEncoder(
            block("encoder", "1", [](double angle) { return std::floor(angle / units::TWO_PI * 4096.0); })));
      if (pulses)
        take(sources_->pushPulses(block("tachometer", "V", [](double angle) {
          return angle - units::TWO_PI * std::floor(angle / units::TWO_PI) < 0.5 ? 5.0 : 0.0;
        })));
      if (controller) take(sources_->pushController({time(50), wrapped(SPEED * time(50) + 0.03), SPEED}));
      if (forces)
        take(sources_->pushForces(block("fx", "N", [this](double angle) {
          return 100.0 + 80.0 * std::cos(4.0 * angle - 1.0) + 10.0 * normal_(random_);
        })));
    }
  }

  AngleSources& sources() { return *sources_; }
  std::vector<SpindleAngle> angles;
  std::vector<std::string> news;

 private:
  static double wrapped(double angle) { return angle - units::TWO_PI * std::floor(angle / units::TWO_PI); }
  double time(std::uint64_t i) const { return 1000.0 + static_cast<double>(next_ + i) / RATE; }
  template <class Value>
  SampleBlock block(const char* channel, const char* unit, const Value& value) {
    SampleBlock block{time(0), RATE, next_, {channel}, {unit}, {}};
    for (std::uint64_t i = 0; i < BLOCK; ++i) block.samples.push_back(value(SPEED * time(i)));
    return block;
  }
  void take(const std::vector<SpindleAngle>& more) {
    angles.insert(angles.end(), more.begin(), more.end());
    if (const std::string line = sources_->takeNews(); !line.empty()) news.push_back(line);
  }

  std::unique_ptr<AngleSources> sources_;
  std::mt19937_64 random_{1};
  std::normal_distribution<double> normal_;
  std::uint64_t next_ = 0;
};

TEST(AngleSources, TheBestThatWorksIsUsedInTheReadingOrder) {
  Spindle spindle;
  spindle.run(3.0, true, true, true, true);
  EXPECT_EQ(spindle.sources().selector().active(), std::size_t{AngleSources::ENCODER});
  spindle.run(2.0, false, true, true, true);
  EXPECT_EQ(spindle.sources().selector().active(), std::size_t{AngleSources::PULSES});
  spindle.run(2.0, false, false, true, true);
  EXPECT_EQ(spindle.sources().selector().active(), std::size_t{AngleSources::CONTROLLER});
  spindle.run(2.0, false, false, false, true);
  EXPECT_EQ(spindle.sources().selector().active(), std::size_t{AngleSources::FORCES});
  EXPECT_TRUE(spindle.sources().selector().related());
  ASSERT_GE(spindle.news.size(), 4u);
  const std::size_t last = spindle.news.size() - 1;
  EXPECT_EQ(spindle.news[last - 2], "pulses in place of encoder: no reading for 0.15 s");
  EXPECT_EQ(spindle.news[last - 1].rfind("controller in place of pulses: no reading for ", 0), 0u)
      << spindle.news[last - 1];
  EXPECT_EQ(spindle.news[last], "order tracking of the forces in place of controller: no reading for 0.15 s");
  // Never off by more than the noise of the order tracking and a count of the encoder, nowhere a gap.
  for (std::size_t i = 0; i < spindle.angles.size(); ++i) {
    const SpindleAngle& angle = spindle.angles[i];
    if (angle.stamp < 1000.02) continue;  // the controller's first reading is there before the encoder's
    EXPECT_NEAR(apart(angle.angle, SPEED * angle.stamp), 0.0, 0.03) << angle.stamp;
    if (i > 0) {
      ASSERT_LT(angle.stamp - spindle.angles[i - 1].stamp, 0.03) << angle.stamp;
    }
  }
  EXPECT_NEAR(spindle.angles.back().speed, SPEED, 0.005 * SPEED);
  EXPECT_GT(spindle.sources().angleStd(AngleSources::FORCES), 0.0);
}

TEST(AngleSources, ForcesAloneGiveTheSpeedAndAnAngleUpToAConstant) {
  Spindle spindle;
  spindle.run(2.0, false, false, false, true);
  EXPECT_EQ(spindle.sources().selector().active(), std::size_t{AngleSources::FORCES});
  EXPECT_FALSE(spindle.sources().selector().related());
  EXPECT_NEAR(spindle.angles.back().speed, SPEED, 0.005 * SPEED);
}

}  // namespace
}  // namespace smartmill::cnc
