// Interfaces of sim_node: blocks without gaps, a common clock of both sensors, hits, true values for late
// subscribers.

#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/Frf.h>
#include <smartmill_msgs/ModalModel.h>
#include <smartmill_msgs/PanelKey.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <smartmill_msgs/Strike.h>
#include <boost/function.hpp>

#include "smartmill_core/names.h"

namespace smartmill {
namespace {

class SimNode : public testing::Test {
 protected:
  SimNode() : spinner(2) { spinner.start(); }

  /// Shared with the callback, which may run until the subscriber is destroyed.
  template <class Message>
  std::shared_ptr<std::vector<Message>> collect(const std::string& topic) {
    const auto into = std::make_shared<std::vector<Message>>();
    const boost::function<void(const boost::shared_ptr<const Message>&)> add =
        [this, into](const boost::shared_ptr<const Message>& m) {
          const std::lock_guard<std::mutex> lock(mutex);
          into->push_back(*m);
        };
    subscribers.push_back(nh.subscribe<Message>(topic, 0, add));
    return into;
  }

  /// Waits in wall time; the assertions do not depend on it.
  bool until(const std::function<bool()>& done) {
    for (int k = 0; k < 12000 && ros::ok(); ++k) {
      {
        const std::lock_guard<std::mutex> lock(mutex);
        if (done()) return true;
      }
      ros::WallDuration(0.01).sleep();
    }
    return false;
  }

  smartmill_msgs::Strike strike(const std::string& service, const std::string& point,
                                const std::string& direction) {
    ros::ServiceClient client = nh.serviceClient<smartmill_msgs::Strike>(service);
    EXPECT_TRUE(client.waitForExistence(ros::Duration(120.0)));
    smartmill_msgs::Strike call;
    call.request.point = point;
    call.request.direction = direction;
    EXPECT_TRUE(client.call(call));
    return call;
  }

  ~SimNode() override { spinner.stop(); }

  ros::NodeHandle nh;
  std::mutex mutex;
  std::vector<ros::Subscriber> subscribers;
  ros::AsyncSpinner spinner;
};

TEST_F(SimNode, blocksHaveNoGapsAndShareOneClock) {
  const auto hammer_ = collect<smartmill_msgs::SampleBlock>(names::HAMMER);
  auto& hammer = *hammer_;
  const auto dynamometer_ = collect<smartmill_msgs::SampleBlock>(names::DYNAMOMETER);
  auto& dynamometer = *dynamometer_;
  const auto truth_ = collect<smartmill_msgs::ForceBlock>(names::TRUE_FORCE);
  auto& truth = *truth_;
  const auto angle_ = collect<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE);
  auto& angle = *angle_;
  ASSERT_TRUE(until([&] {
    return hammer.size() > 100 && dynamometer.size() > 100 && truth.size() > 100 && angle.size() > 200;
  }));
  const std::lock_guard<std::mutex> lock(mutex);
  std::map<std::uint64_t, double> stamps;
  for (const auto& b : hammer) stamps[b.first_index] = b.header.stamp.toSec();
  std::size_t shared = 0;
  for (std::size_t i = 1; i < dynamometer.size(); ++i) {
    const auto& b = dynamometer[i];
    ASSERT_EQ(b.first_index, dynamometer[i - 1].first_index + 256);
    ASSERT_EQ(b.samples.size(), 3u * 256u);
    ASSERT_EQ(b.header.frame_id, "dynamometer");
    ASSERT_EQ(b.sample_rate, 25600.0);
    ASSERT_NEAR(b.header.stamp.toSec() - dynamometer[0].header.stamp.toSec(),
                static_cast<double>(b.first_index - dynamometer[0].first_index) / 25600.0, 2e-6);
    if (stamps.count(b.first_index)) {
      ASSERT_EQ(stamps.at(b.first_index), b.header.stamp.toSec());
      ++shared;
    }
  }
  EXPECT_GT(shared, 50u);
  EXPECT_EQ(truth.back().first_index % 256, dynamometer.back().first_index % 256);
  for (std::size_t i = 1; i < angle.size(); ++i)
    ASSERT_NEAR((angle[i].header.stamp - angle[i - 1].header.stamp).toSec(), 0.005, 2e-6);
}

// A state of the controller that is stamped on reception then belongs to the samples of the same stamp,
// however late the simulation is.
TEST_F(SimNode, itsClockIsTheEndOfTheLastBlock) {
  ASSERT_TRUE(ros::Time::isSimTime());
  const auto clock_ = collect<rosgraph_msgs::Clock>("/clock");
  auto& clock = *clock_;
  const auto dynamometer_ = collect<smartmill_msgs::SampleBlock>(names::DYNAMOMETER);
  auto& dynamometer = *dynamometer_;
  ASSERT_TRUE(until([&] { return clock.size() > 100 && dynamometer.size() > 100; }));
  const std::lock_guard<std::mutex> lock(mutex);
  for (const auto& c : clock) {
    const double blocks = (c.clock - dynamometer[0].header.stamp).toSec() * 25600.0 / 256.0;
    ASSERT_NEAR(blocks, std::round(blocks), 1e-3);
  }
  for (std::size_t i = 1; i < clock.size(); ++i)
    ASSERT_NEAR((clock[i].clock - clock[i - 1].clock).toSec(), 0.01, 2e-6);
}

TEST_F(SimNode, aHitOnTheSensorActsOnBothChannels) {
  const auto hammer_ = collect<smartmill_msgs::SampleBlock>(names::HAMMER);
  auto& hammer = *hammer_;
  const auto dynamometer_ = collect<smartmill_msgs::SampleBlock>(names::DYNAMOMETER);
  auto& dynamometer = *dynamometer_;
  ASSERT_TRUE(until([&] { return hammer.size() > 2 && dynamometer.size() > 2; }));
  EXPECT_EQ(strike(names::STRIKE, "force_sensor", "z").response.code, smartmill_msgs::Strike::Response::OK);
  double peak = 0.0, force = 0.0;
  EXPECT_TRUE(until([&] {
    for (const auto& b : hammer) {
      for (std::size_t i = 0; i < b.samples.size(); i += 2) peak = std::max(peak, b.samples[i]);
    }
    for (const auto& b : dynamometer) {
      for (std::size_t i = 2; i < b.samples.size(); i += 3) force = std::max(force, b.samples[i]);
    }
    return peak > 100.0 && force > 100.0;
  })) << peak
      << " N, " << force << " N";
}

TEST_F(SimNode, anInvalidHitIsRefusedInOneLine) {
  const auto nonsense = strike(names::STRIKE, "moon", "x");
  EXPECT_EQ(nonsense.response.code, smartmill_msgs::Strike::Response::FAILED);
  EXPECT_NE(nonsense.response.message.find("moon"), std::string::npos);
  // The model has no hammer station.
  EXPECT_EQ(strike(names::STRIKE, "tool", "x").response.code, smartmill_msgs::Strike::Response::FAILED);
}

TEST_F(SimNode, anOperatorHitsByHand) {
  const auto dynamometer_ = collect<smartmill_msgs::SampleBlock>("by_hand/dynamometer");
  auto& dynamometer = *dynamometer_;
  ASSERT_TRUE(until([&] { return dynamometer.size() > 2; }));
  EXPECT_EQ(strike("by_hand/strike", "force_sensor", "x").response.code,
            smartmill_msgs::Strike::Response::NO_HAMMER);
  EXPECT_TRUE(until([&] {
    for (const auto& b : dynamometer) {
      for (std::size_t i = 0; i < b.samples.size(); i += 3) {
        if (b.samples[i] > 100.0) return true;
      }
    }
    return false;
  }));
}

TEST_F(SimNode, servoStreamHasNoGapsAtOneKilohertz) {
  const auto blocks = collect<smartmill_msgs::SampleBlock>(names::SERVO_RECORD);
  ASSERT_TRUE(until([&] { return blocks->size() > 100; }));
  const std::lock_guard<std::mutex> lock(mutex);
  EXPECT_EQ(blocks->front().channels,
            (std::vector<std::string>{"spindle_load", "current_x", "current_y", "current_z", "axis_vx",
                                      "axis_vy", "axis_vz", "sequence", "trigger"}));
  for (std::size_t i = 1; i < blocks->size(); ++i) {
    const auto& b = (*blocks)[i];
    ASSERT_EQ(b.sample_rate, 1000.0);
    ASSERT_EQ(b.first_index, (*blocks)[i - 1].first_index + (*blocks)[i - 1].samples.size() / 9);
  }
}

TEST_F(SimNode, panelKeysActOrRefuse) {
  const auto press = [&](const std::string& key, const std::vector<double>& values) {
    ros::ServiceClient client = nh.serviceClient<smartmill_msgs::PanelKey>("sim/panel/" + key);
    EXPECT_TRUE(client.waitForExistence(ros::Duration(120.0)));
    smartmill_msgs::PanelKey call;
    call.request.values = values;
    EXPECT_TRUE(client.call(call));
    return call.response;
  };
  EXPECT_EQ(press("mode", {1.0}).message, "mode: done");
  EXPECT_EQ(press("mode", {77.0}).code, smartmill_msgs::PanelKey::Response::REFUSED);
  EXPECT_EQ(press("mode", {}).message, "mode: 0 values, expected 1");
  EXPECT_EQ(press("emergency_stop", {1.0}).message, "emergency_stop: done");
  EXPECT_EQ(press("cycle_start", {}).message, "cycle_start: EW_ALARM");
  EXPECT_EQ(press("emergency_stop", {0.0}).message, "emergency_stop: done");
  EXPECT_EQ(press("alarm", {1001.0}).message, "alarm: done");
  EXPECT_EQ(press("cycle_start", {}).message, "cycle_start: EW_ALARM");
  EXPECT_EQ(press("reset", {}).message, "reset: done");
  EXPECT_EQ(press("overrides", {1.0, 0.5, 1.0}).message, "overrides: done");
  EXPECT_EQ(press("feed_hold", {}).message, "feed_hold: done");
  EXPECT_EQ(press("mode", {10.0}).message, "mode: done");
}

TEST_F(SimNode, lateSubscribersGetAllTrueValues) {
  const auto modes_ = collect<smartmill_msgs::ModalModel>(names::TRUE_MODES);
  auto& modes = *modes_;
  const auto frfs_ = collect<smartmill_msgs::Frf>(names::TRUE_FRF);
  auto& frfs = *frfs_;
  ASSERT_TRUE(until([&] { return modes.size() >= 5 && frfs.size() >= 5; }));
  const std::lock_guard<std::mutex> lock(mutex);
  for (const auto& m : modes) {
    if (m.point != "tool_tip" || m.direction != "x") continue;
    ASSERT_EQ(m.modes.size(), 1u);
    EXPECT_DOUBLE_EQ(m.modes[0].frequency, 1210.0);
    EXPECT_NEAR(m.modes[0].gain, 1.0 / 28e6, 1e-15);
    EXPECT_EQ(m.unit, "m/N");
  }
  for (const auto& f : frfs) {
    if (f.point != "force_sensor" || f.direction != "y") continue;
    // An ideal axis.
    for (std::size_t i = 0; i < f.frequency.size(); ++i) EXPECT_EQ(f.real[i], 1.0);
  }
}

}  // namespace
}  // namespace smartmill

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "sim_node_test");
  return RUN_ALL_TESTS();
}
