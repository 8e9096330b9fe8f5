// The closed-form rig as a ROS node, in the place of the sensors' driver, for the wiring test: strikes on
// request, spins and cuts by cut/condition.

#include <cmath>

#include <ros/ros.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <smartmill_msgs/Strike.h>
#include <boost/function.hpp>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/tap_rig.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::kalman {
namespace {

void run() {
  ros::NodeHandle nh;
  ModalModel sensor;
  sensor.modes = {{930.0, 0.03, 0.9}};
  sensor.direct = 0.1;
  TapRig rig(TapRig::diagonal(sensor), toSec(ros::Time::now()), 7);
  auto hammer = nh.advertise<smartmill_msgs::SampleBlock>(names::HAMMER, 0);
  auto dynamometer = nh.advertise<smartmill_msgs::SampleBlock>(names::DYNAMOMETER, 0);
  auto angle = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 0);
  const boost::function<bool(smartmill_msgs::Strike::Request&, smartmill_msgs::Strike::Response&)> strike =
      [&](smartmill_msgs::Strike::Request& request, smartmill_msgs::Strike::Response& response) {
        if (request.point != "force_sensor" || request.direction == "z") {
          response.code = smartmill_msgs::Strike::Response::NO_HAMMER;
          return true;
        }
        rig.strike(request.direction == "x" ? 0 : 1);
        return true;
      };
  const auto service = nh.advertiseService(names::STRIKE, strike);
  const boost::function<void(const smartmill_msgs::CuttingCondition&)> turn =
      [&](const smartmill_msgs::CuttingCondition& message) {
        const CuttingCondition condition = fromMsg(message);
        rig.cut = {};
        rig.speed = 0.0;
        if (condition.kind != CuttingCondition::Kind::cut) return;
        const MechanisticForce process(condition.tool, {796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3},
                                       condition.engagement);
        rig.speed = condition.spindle_speed;
        rig.cut = [process, speed = rig.speed](double t) {
          const CuttingForce f = process.at(std::fmod(speed * t, units::TWO_PI));
          return std::array<double, 3>{f.fx, f.fy, f.fz};
        };
      };
  const auto conditions = nh.subscribe<smartmill_msgs::CuttingCondition>(names::CUTTING_CONDITION, 10, turn);
  const auto timer = nh.createWallTimer(ros::WallDuration(0.005), [&](const ros::WallTimerEvent&) {
    // A block is there when its last sample is.
    while (rig.now() + TapRig::BLOCK / TapRig::RATE < toSec(ros::Time::now())) {
      const TapRig::Blocks blocks = rig.next();
      hammer.publish(toMsg(blocks.hammer));
      dynamometer.publish(toMsg(blocks.sensor, "dynamometer"));
      angle.publish(toMsg(blocks.angle));
    }
  });
  ros::spin();
}

}  // namespace
}  // namespace smartmill::kalman

int main(int argc, char** argv) {
  ros::init(argc, argv, "rig");
  smartmill::kalman::run();
  return 0;
}
