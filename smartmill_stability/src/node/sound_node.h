#pragma once

#include <future>
#include <string>

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_server.h>
#include <smartmill_msgs/SetSoundCut.h>

#include "node/sound_parameters.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::stability {

/// Shell around SoundListener: the microphone and cnc/state in, sound/advice and sound/features out, service
/// sound/set_cut. Needs the microphone only.
class SoundNode {
 public:
  using Parameters = SoundNodeParameters;
  /// @throws Error on a wrong parameter.
  SoundNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void work();
  void publishAdvice();
  void publishFeatures();
  bool setCut(smartmill_msgs::SetSoundCut::Request& request, smartmill_msgs::SetSoundCut::Response& response);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  SoundNodeParameters parameters_;
  NodeShell shell_;
  SoundListener listener_;
  std::future<SoundListener::Outcome> outcome_;  // of the job in progress
  ros::Publisher advice_, features_;
  ros::ServiceServer set_cut_;
};

}  // namespace smartmill::stability
