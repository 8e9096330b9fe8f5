#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include <geometry_msgs/WrenchStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/ForceEstimate.h>

#include "smartmill_core/names.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/inputs.h"

namespace smartmill {
namespace {

constexpr std::size_t CUTS = 4;  // one of each pass of lathe.yaml

/// Messages of the cuts so far; the true force is read by this test only.
class Cuts {
 public:
  explicit Cuts(ros::NodeHandle& nh)
      : truth_(nh.subscribe(names::TRUE_FORCE, STREAM_QUEUE, &Cuts::addTruth, this)),
        conditions_(nh.subscribe(names::CUTTING_CONDITION, STREAM_QUEUE, &Cuts::addCondition, this)),
        wrenches_(nh.subscribe(names::FORCE_OF_MOTORS, STREAM_QUEUE, &Cuts::addWrench, this)),
        estimates_(nh.subscribe(names::FORCE_ESTIMATE, STREAM_QUEUE, &Cuts::addEstimate, this)) {}

  std::size_t complete() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::min(wrench.size(), estimate.size());
  }
  /// [N] mean true force over an interval; false: not all of it was received.
  bool meanForce(double from, double to, std::array<double, 3>* mean) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    double n = 0.0;
    mean->fill(0.0);
    if (truths_.empty() || truths_.front().stamp > from) return false;
    for (const Truth& one : truths_) {
      if (one.stamp < from || one.stamp > to) continue;
      ++n;
      for (std::size_t a = 0; a < 3; ++a) (*mean)[a] += one.force[a];
    }
    for (double& f : *mean) f /= n;
    return n > 0.0;
  }

  std::vector<geometry_msgs::WrenchStamped> wrench;
  std::vector<smartmill_msgs::ForceEstimate> estimate;
  std::map<std::string, CuttingCondition> condition;

 private:
  struct Truth {
    double stamp;
    std::array<double, 3> force;
  };
  void addTruth(const smartmill_msgs::ForceBlock& message) {
    const ForceBlock block = fromMsg(message);
    Truth one{block.stamp, {}};
    for (std::size_t a = 0; a < 3; ++a) {
      for (const double f : block.force[a]) one.force[a] += f / static_cast<double>(block.force[a].size());
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    truths_.push_back(one);
  }
  void addCondition(const smartmill_msgs::CuttingCondition& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    condition[message.name] = fromMsg(message);
  }
  void addWrench(const geometry_msgs::WrenchStamped& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    wrench.push_back(message);
  }
  void addEstimate(const smartmill_msgs::ForceEstimate& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    estimate.push_back(message);
  }

  mutable std::mutex mutex_;
  std::vector<Truth> truths_;
  ros::Subscriber truth_, conditions_, wrenches_, estimates_;
};

// Longitudinal, taper and facing passes: three forces from three currents, each within three of the standard
// deviations that its estimate states; the motor of an axis at rest shows no force.
TEST(TurningForces, motorCurrentsGiveTheForcesOfTheCut) {
  ros::NodeHandle nh;
  Cuts cuts(nh);
  ros::AsyncSpinner spinner(1);
  spinner.start();
  for (int i = 0; i < 8000 && cuts.complete() < CUTS; ++i) ros::WallDuration(0.05).sleep();
  spinner.stop();
  EXPECT_TRUE(ros::Time::isSimTime());
  ASSERT_GE(cuts.complete(), CUTS);
  for (std::size_t i = 0; i < CUTS; ++i) {
    const auto& e = cuts.estimate[i];
    const auto& w = cuts.wrench[i];
    ASSERT_EQ(e.header.stamp, w.header.stamp);
    const CuttingCondition& condition = cuts.condition.at(e.cut);
    ASSERT_EQ(condition.kind, CuttingCondition::Kind::cut);
    std::array<double, 3> truth{};
    ASSERT_TRUE(cuts.meanForce(toSec(e.header.stamp) - e.duration, toSec(e.header.stamp), &truth)) << e.cut;
    const std::array<double, 3> mean{e.mean.x, e.mean.y, e.mean.z},
        std_dev{e.mean_std.x, e.mean_std.y, e.mean_std.z},
        motor{w.wrench.force.x, w.wrench.force.y, w.wrench.force.z};
    for (std::size_t a = 0; a < 3; ++a) {
      std::printf("%s F%c: estimate %.1f +- %.1f N, by its motor %.1f N, true %.1f N\n", e.cut.c_str(),
                  "xyz"[a], mean[a], std_dev[a], motor[a], truth[a]);
      EXPECT_GT(std_dev[a], 0.0) << e.cut;
      EXPECT_NEAR(mean[a], truth[a], 3.0 * std_dev[a]) << e.cut << " F"
                                                       << "xyz"[a];
      const bool moves = std::abs(condition.steady_to[a] - condition.steady_from[a]) > 1e-6;
      EXPECT_EQ(std::isfinite(motor[a]), moves) << e.cut << " F"
                                                << "xyz"[a];
      const std::string source = std::string("motor_") + "xyz"[a];
      EXPECT_EQ(std::count(e.sources.begin(), e.sources.end(), source), moves ? 1 : 0) << e.cut;
    }
    const double torque = truth[1] * condition.tool.radius();
    std::printf("%s torque: estimate %.3f +- %.3f N m, by its motor %.3f N m, true %.3f N m\n", e.cut.c_str(),
                e.torque, e.torque_std, w.wrench.torque.z, torque);
    EXPECT_NEAR(e.torque, torque, 3.0 * e.torque_std) << e.cut;
    EXPECT_TRUE(std::isfinite(w.wrench.torque.z)) << e.cut;
  }
}

}  // namespace
}  // namespace smartmill

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "turning_forces_test");
  return RUN_ALL_TESTS();
}
