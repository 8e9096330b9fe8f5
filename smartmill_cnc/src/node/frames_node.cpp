#include <string>
#include <vector>

#include <geometry_msgs/TransformStamped.h>
#include <ros/ros.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::cnc {
namespace {

struct FramesNodeParameters {
  std::string model;

  void declare(ParameterTable& table) {
    table.title("Parameters of frames_node (package smartmill_cnc): fixed tf2 frames of the machine.");
    table.atLaunch("model", model, "path of a smartmill-model/1 file; its section frames states the poses");
  }
  /// @throws Error naming key and value.
  void validate() const {
    if (model.empty()) throw Error("model: empty, expected the path of a smartmill-model/1 file");
  }
};

/// Publishes the fixed frames of the machine model on /tf_static, once.
class FramesNode {
 public:
  using Parameters = FramesNodeParameters;
  /// @throws Error on an invalid parameter or model.
  FramesNode(const ros::NodeHandle& /*nh*/, const ros::NodeHandle& private_nh) {
    const auto parameters = parametersFromServer(private_nh).readAll<FramesNodeParameters>();
    FramePoses poses = readMachineModel(parameters.model).frames;
    poses.insert(usualFrames().begin(), usualFrames().end());
    std::vector<geometry_msgs::TransformStamped> transforms;
    for (const auto& [name, pose] : poses) {
      geometry_msgs::TransformStamped transform;
      transform.header.stamp = ros::Time::now();
      transform.header.frame_id = pose.parent;
      transform.child_frame_id = name;
      transform.transform.translation.x = pose.position[0];
      transform.transform.translation.y = pose.position[1];
      transform.transform.translation.z = pose.position[2];
      transform.transform.rotation.x = pose.rotation[0];
      transform.transform.rotation.y = pose.rotation[1];
      transform.transform.rotation.z = pose.rotation[2];
      transform.transform.rotation.w = pose.rotation[3];
      transforms.push_back(transform);
    }
    broadcaster_.sendTransform(transforms);
  }

 private:
  tf2_ros::StaticTransformBroadcaster broadcaster_;
};

}  // namespace
}  // namespace smartmill::cnc

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<cnc::FramesNode>(argc, argv, "frames");
}
