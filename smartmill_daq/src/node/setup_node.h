#pragma once

#include <string>

#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <smartmill_msgs/CalibrateChannel.h>
#include <smartmill_msgs/TryInstrument.h>

#include "node/setup_parameters.h"
#include "smartmill_daq/setup/instrument_setup.h"

namespace smartmill::daq {

/// InstrumentSetup in ROS: services that try and store descriptions of instruments and calibrate channels.
class SetupNode {
 public:
  using Parameters = SetupNodeParameters;
  /// @throws Error on an invalid parameter.
  SetupNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh);

 private:
  bool tryInstrument(smartmill_msgs::TryInstrument::Request& request,
                     smartmill_msgs::TryInstrument::Response& response);
  bool calibrate(smartmill_msgs::CalibrateChannel::Request& request,
                 smartmill_msgs::CalibrateChannel::Response& response);

  InstrumentSetup setup_;
  ros::ServiceServer try_, calibrate_;
};

}  // namespace smartmill::daq
