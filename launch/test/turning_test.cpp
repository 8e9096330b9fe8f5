#include <cmath>
#include <mutex>
#include <vector>

#include <gtest/gtest.h>
#include <ros/ros.h>
#include <ros/topic.h>
#include <smartmill_msgs/ModalModel.h>
#include <smartmill_msgs/SampleBlock.h>

#include "smartmill_core/names.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/conversions.h"

namespace smartmill {
namespace {

/// RMS about the mean of the deflection minus the tool motion, per tenth of a second.
class Vibration {
 public:
  void add(const SampleBlock& block) {
    for (std::size_t i = 0; i < block.size(); ++i) {
      const double motion = block.at(i, 0) - block.at(i, 1);
      sum_ += motion, squares_ += motion * motion;
      if (++count_ < block.sample_rate / 10.0) continue;
      const double mean = sum_ / count_;
      const std::lock_guard<std::mutex> lock(mutex_);
      last_ = std::sqrt(std::max(0.0, squares_ / count_ - mean * mean));
      max_ = std::max(max_, last_);
      sum_ = squares_ = count_ = 0.0;
    }
  }
  double last() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return last_;
  }
  double max() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return max_;
  }

 private:
  mutable std::mutex mutex_;
  double sum_ = 0.0, squares_ = 0.0, count_ = 0.0, last_ = 1.0, max_ = 0.0;
};

TEST(Turning, theMachineIsIdentifiedAndChatterSuppressed) {
  ros::NodeHandle nh;
  Vibration vibration;
  const ros::Subscriber probes = nh.subscribe<smartmill_msgs::SampleBlock>(
      names::DISPLACEMENT, 0,
      boost::function<void(const smartmill_msgs::SampleBlock::ConstPtr&)>(
          [&](const auto& m) { vibration.add(fromMsg(*m)); }));
  ros::AsyncSpinner spinner(1);
  spinner.start();
  ASSERT_TRUE(ros::Time::waitForValid(ros::WallDuration(120.0)));  // the lathe is the clock
  const auto identified = ros::topic::waitForMessage<smartmill_msgs::ModalModel>(names::CONTROL_MACHINE, nh,
                                                                                 ros::Duration(300.0));
  ASSERT_TRUE(identified);
  const ModalModel machine = fromMsg(*identified).model;
  ASSERT_EQ(machine.modes.size(), 1u);
  EXPECT_NEAR(machine.modes[0].frequency * units::TWO_PI, 350.0, 3.5);
  EXPECT_NEAR(machine.modes[0].damping_ratio, 0.02, 0.004);
  // Chatter grows beyond 4 um (the first response to the chip is half of that) and then falls below 0.1 um.
  for (int i = 0; i < 3000 && !(vibration.last() < 0.1e-6); ++i) ros::Duration(0.1).sleep();
  EXPECT_GT(vibration.max(), 4e-6);
  EXPECT_LT(vibration.last(), 0.1e-6);
}

}  // namespace
}  // namespace smartmill

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "turning_test");
  return RUN_ALL_TESTS();
}
