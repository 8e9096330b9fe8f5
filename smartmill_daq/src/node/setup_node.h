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
  using TryInstrument = smartmill_msgs::TryInstrument;
  using CalibrateChannel = smartmill_msgs::CalibrateChannel;

  bool tryInstrument(TryInstrument::Request& request, TryInstrument::Response& response);
  bool calibrate(CalibrateChannel::Request& request, CalibrateChannel::Response& response);

  InstrumentSetup setup_;
  ros::ServiceServer try_, calibrate_;
};

}  // namespace smartmill::daq
