#include "recordings/bag_cuts.h"

#include <cmath>
#include <complex>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>

#include "smartmill_core/error.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::kalman {
namespace {

using ::testing::HasSubstr;
using Complex = std::complex<double>;

constexpr double RATE = 20000.0;
constexpr const char* SENSOR = names::SPINDLE_FORCE;

/// A force of all orders of the spindle through a structure, in closed form, as messages of a bag.
class Shop {
 public:
  Shop(const std::string& file, bool tool) : bag_(file, rosbag::bagmode::Write), tool_(tool) {}

  double apart = 0.0;  // [samples] of the response behind the force

  void rest(const char* direction, const ModalModel& model) {
    MeasuredModes modes;
    modes.stamp = now_;
    modes.point = tool_ ? POINT_TOOL_TIP : POINT_FORCE_SENSOR;
    modes.direction = direction;
    modes.unit = tool_ ? "m/N" : "1";
    modes.model = model;
    write(names::TOOL_MODES, toMsg(modes));
  }

  void cut(double rpm, const ModalModel& structure) {
    const double speed = units::radPerSecFromRpm(rpm), seconds = 1.2;
    CuttingCondition c;
    c.stamp = now_;
    c.kind = CuttingCondition::Kind::cut;
    c.name = std::to_string(static_cast<int>(rpm));
    c.tool = {4, 12e-3, 0.0, {}};
    c.engagement = {0.0, units::PI, 1e-3, 1e-4};
    c.spindle_speed = speed;
    c.steady_to = {0.05, 0.0, 0.0};
    write(names::CUTTING_CONDITION, toMsg(c));
    std::vector<double> phase(80);
    for (double& p : phase) p = std::uniform_real_distribution<double>(0.0, units::TWO_PI)(random_);
    for (int step = 0; step < static_cast<int>(100.0 * seconds); ++step, now_ += 0.01) {
      CncState state;
      state.stamp = now_;
      state.connected = state.motion = true;
      state.feed = 0.02;
      state.axes = {"X", "Y", "Z"};
      state.position = {4e-4 * step, 0.0, 0.0};
      state.distance_to_go = {0.0, 0.0, 0.0};
      write(names::CNC_STATE, toMsg(state));
      write(names::SPINDLE_ANGLE, toMsg(SpindleAngle{now_, std::fmod(speed * now_, units::TWO_PI), speed}));
      blocks(speed, phase, structure);
    }
    CuttingCondition none;
    none.stamp = now_ + 0.001;
    write(names::CUTTING_CONDITION, toMsg(none));
    now_ = std::round(100.0 * now_) / 100.0 + 0.5;
  }

 private:
  template <class Message>
  void write(const std::string& topic, const Message& message) {
    bag_.write("/smartmill/" + topic, message.header.stamp, message);
  }

  void blocks(double speed, const std::vector<double>& phase, const ModalModel& structure) {
    ForceBlock force;
    SampleBlock response;
    force.stamp = now_;
    force.sample_rate = response.sample_rate = RATE;
    force.status = ForceBlock::Status::compensated;
    response.stamp = now_ + apart / RATE;
    response.channels =
        tool_ ? std::vector<std::string>{"x", "y"} : std::vector<std::string>{"fx", "fy", "fz"};
    response.units.assign(response.channels.size(), tool_ ? "m" : "N");
    const double noise = tool_ ? 3e-8 : 0.3;
    for (int i = 0; i < static_cast<int>(0.01 * RATE); ++i) {
      const double time = now_ + i / RATE;
      double f = 300.0, r = 300.0 * structure.staticGain();
      for (std::size_t k = 1; k < phase.size(); ++k) {
        const double frequency = static_cast<double>(k) * speed / units::TWO_PI;
        if (frequency > 4500.0) break;
        const Complex wave =
            std::polar(k % 4 == 0 ? 30.0 : 8.0, static_cast<double>(k) * speed * time + phase[k]);
        f += wave.real();
        r += (structure.response(frequency) * wave).real();
      }
      for (std::size_t a = 0; a < 3; ++a) force.force[a].push_back(f + normal_(random_));
      for (std::size_t a = 0; a < response.channels.size(); ++a)
        response.samples.push_back(r + noise * normal_(random_));
    }
    write(names::FORCE_COMPENSATED, toMsg(force, "machine"));
    write(tool_ ? names::DISPLACEMENT : SENSOR, toMsg(response, "machine"));
  }

  rosbag::Bag bag_;
  bool tool_;
  double now_ = 10.0;
  std::mt19937 random_{5};
  std::normal_distribution<double> normal_;
};

std::vector<SpeedFrf> frfs(const std::vector<CutSegment>& cuts, bool tool) {
  CuttingFrfOptions options;
  options.high = 4000.0;
  options.speed_width = 0.1;
  options.unit_static_gain = !tool;
  std::vector<FrfLine> lines;
  for (const CutSegment& cut : cuts) {
    const auto some = frfLines(cut, options);
    lines.insert(lines.end(), some.begin(), some.end());
  }
  return cuttingFrfs(lines, tool ? "m/N" : "1", options);
}

TEST(BagCuts, TheToolsModeInTheCutBesideItsTapAtRest) {
  const TemporaryFolder folder;
  const std::string file = folder.file("run.bag");
  const ModalModel at_rest{{{1150.0, 0.03, 1.0 / 22e6}}}, turning{{{1080.0, 0.034, 1.0 / 20e6}}};
  {
    Shop shop(file, true);
    shop.rest("x", at_rest);
    for (const double rpm : {6000.0, 6150.0, 6320.0}) shop.cut(rpm, turning);
  }
  BagCutsRequest request;
  request.path = file;
  request.response = names::DISPLACEMENT;
  const BagCuts cuts = cutsOfBag(request);
  ASSERT_EQ(cuts.axis[0].size(), 3u);
  ASSERT_EQ(cuts.rest[0].modes.size(), 1u);
  EXPECT_TRUE(cuts.rest[1].modes.empty());
  EXPECT_EQ(cuts.rest[0].modes[0].frequency, 1150.0);
  const auto found = frfs(cuts.axis[0], true);
  ASSERT_EQ(found.size(), 1u);
  ASSERT_TRUE(found[0].fit) << found[0].reason;
  ASSERT_EQ(found[0].fit->model.modes.size(), 1u);
  const Mode& mode = found[0].fit->model.modes[0];
  EXPECT_NEAR(mode.frequency, 1080.0, 4.0 * mode.frequency_std);
  EXPECT_LT(mode.frequency_std, 2.0);
  EXPECT_NEAR(1.0 / mode.gain, 20e6, 0.02 * 20e6);
}

// The sensor in the spindle against the table's, at two speeds: what it rings with goes with the speed.
TEST(BagCuts, ASensorOverTheSpeed) {
  const TemporaryFolder folder;
  const std::string file = folder.file("run.bag");
  const auto sensor = [](double frequency) {
    ModalModel model{{{frequency, 0.04, 1.0}}};
    return model;
  };
  {
    Shop shop(file, false);
    shop.rest("x", sensor(1500.0));
    for (const double rpm : {5000.0, 5130.0, 5260.0}) shop.cut(rpm, sensor(1480.0));
    for (const double rpm : {9000.0, 9210.0, 9430.0, 9650.0}) shop.cut(rpm, sensor(1420.0));
  }
  BagCutsRequest request;
  request.path = file;
  request.tool = false;
  request.response = SENSOR;
  const BagCuts cuts = cutsOfBag(request);
  const auto found = frfs(cuts.axis[1], false);
  ASSERT_EQ(found.size(), 2u);
  for (std::size_t g = 0; g < 2; ++g) {
    ASSERT_TRUE(found[g].fit) << found[g].reason;
    EXPECT_NEAR(found[g].fit->model.modes[0].frequency, g == 0 ? 1480.0 : 1420.0, 8.0);
  }
}

TEST(BagCuts, WhatIsMissingOrNotSampledTogetherIsNamed) {
  const TemporaryFolder folder;
  {
    Shop shop(folder.file("run.bag"), false);
    shop.apart = 0.3;
    shop.cut(6000.0, {{{1500.0, 0.04, 1.0}}});
  }
  BagCutsRequest request;
  request.path = folder.file("run.bag");
  request.response = names::DISPLACEMENT;
  EXPECT_THAT(errorOf([&] { cutsOfBag(request); }), HasSubstr("run.bag: topic daq/displacement not found"));
  request.tool = false;
  request.response = SENSOR;
  EXPECT_THAT(errorOf([&] { cutsOfBag(request); }), HasSubstr("cut '6000': force/compensated and"));
}

}  // namespace
}  // namespace smartmill::kalman
