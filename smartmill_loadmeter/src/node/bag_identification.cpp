#include "bag_identification.h"

#include "smartmill_core/error.h"
#include "smartmill_loadmeter/identification/sorted_identification.h"
#include "smartmill_msgs/CncState.h"
#include "smartmill_msgs/CuttingCondition.h"
#include "smartmill_msgs/IdentifyCoefficientsActionGoal.h"
#include "smartmill_msgs/LoadSample.h"
#include "smartmill_msgs/SampleBlock.h"
#include "smartmill_ros/bag_reader.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::loadmeter {

std::vector<IdentifyResult> identifyFromBag(const std::string& path, const MachineModel& model,
                                            const NodeParameters& parameters,
                                            const std::function<void(double)>& progress,
                                            const std::function<void(const MotorForce&)>& force) {
  SortedIdentification identification(model, parameters.identification, parameters.hold_back);
  if (!parameters.motor_calibration.empty()) {
    identification.identification().setMotors(readMotorCalibration(parameters.motor_calibration));
    identification.identification().onMotorForce([&](const MotorForce& f) {
      if (force) force(f);
    });
  }
  std::vector<IdentifyResult> results;
  identification.identification().onResult([&](const IdentifyResult& result) {
    if (!result.reset) results.push_back(result);
  });
  BagReader bag(path);
  std::size_t loads = 0;
  bag.on<smartmill_msgs::CncState>(
      "cnc/state", [&](const smartmill_msgs::CncState& m, double) { identification.push(fromMsg(m)); });
  bag.on<smartmill_msgs::LoadSample>("cnc/load", [&](const smartmill_msgs::LoadSample& m, double) {
    ++loads;
    identification.push(fromMsg(m));
  });
  bag.on<smartmill_msgs::SampleBlock>("daq/motor_current", [&](const smartmill_msgs::SampleBlock& m, double) {
    if (!parameters.motor_calibration.empty()) identification.push(fromMsg(m));
  });
  bag.on<smartmill_msgs::CuttingCondition>("cut/condition", [&](const smartmill_msgs::CuttingCondition& m,
                                                                double) { identification.push(fromMsg(m)); });
  bag.on<smartmill_msgs::IdentifyCoefficientsActionGoal>(
      "loadmeter/identify_coefficients/goal",
      [&](const smartmill_msgs::IdentifyCoefficientsActionGoal& m, double) {
        const ros::Time stamp = m.goal.header.stamp.isZero() ? m.goal_id.stamp : m.goal.header.stamp;
        identification.push(IdentifyGoal{toSec(stamp), m.goal.tool, m.goal.material, m.goal.reset != 0, 0});
      });
  bag.run(progress);
  if (loads == 0) throw Error(path + ": holds no cnc/load");
  identification.flush();
  if (results.empty()) {
    identification.push(IdentifyGoal{identification.newest(), "", "", false, 0});
    identification.flush();
  }
  return results;
}

}  // namespace smartmill::loadmeter
