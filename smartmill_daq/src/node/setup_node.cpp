#include "node/setup_node.h"

#include <ros/ros.h>

#include "smartmill_core/formatted.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::daq {
namespace {

using TryResponse = smartmill_msgs::TryInstrument::Response;
using CalibrateRequest = smartmill_msgs::CalibrateChannel::Request;
using CalibrateResponse = smartmill_msgs::CalibrateChannel::Response;

void addDrivers(TryResponse& response) {
  for (const DriverKind& kind : driverKinds()) {
    if (!kind.make) continue;
    response.drivers.push_back(kind.name);
    for (const DriverOption& option : kind.options) {
      response.option_driver.push_back(kind.name);
      response.option_key.push_back(option.key);
      response.option_meaning.push_back(option.meaning);
    }
  }
}

void addTrial(const Trial& trial, TryResponse& response) {
  for (const TriedChannel& tried : trial.channels) {
    response.topic.push_back(tried.topic);
    response.channel.push_back(tried.channel.name);
    response.unit.push_back(tried.channel.unit);
    response.mean.push_back(tried.mean);
    response.rms.push_back(tried.rms);
    response.peak.push_back(tried.peak);
    response.clipped.push_back(tried.clipped);
    response.faulty.push_back(static_cast<std::uint8_t>(tried.faulty));
    response.samples = tried.samples.size();
  }
  response.drift = trial.clock.drift;
  response.drift_std = trial.clock.drift_std;
  response.jitter = trial.clock.jitter;
  response.faults = trial.faults;
}

CalibrationRequest requestOf(const CalibrateRequest& message) {
  CalibrationRequest request;
  request.file = message.file;
  request.topic = message.topic;
  request.channel = message.channel;
  using Method = CalibrationRequest::Method;
  switch (message.method) {
    case CalibrateRequest::EXCITER:
      request.method = Method::exciter;
      break;
    case CalibrateRequest::EMPTY:
      request.method = Method::empty;
      break;
    case CalibrateRequest::MASS:
      request.method = Method::mass;
      break;
    case CalibrateRequest::HITS:
      request.method = Method::hits;
      break;
    default:
      throw Error(formatted("method: %d, expected one of CalibrateChannel", message.method));
  }
  request.seconds = message.seconds;
  request.exciter = message.exciter;
  request.frequency = message.frequency;
  request.mass = message.mass;
  request.against = message.against != 0;
  request.gravity = message.gravity;
  request.accelerometer = message.accelerometer;
  request.reference_std = message.reference_std;
  return request;
}

std::optional<NewSensitivity> resultOf(InstrumentSetup& setup, const CalibrateRequest& request) {
  if (request.method != CalibrateRequest::STORE) return setup.calibrate(requestOf(request));
  return setup.storeResult(request.file, request.topic, request.channel,
                           request.date.empty() ? today() : request.date);
}

std::string messageOf(const CalibrateRequest& request, const std::optional<NewSensitivity>& found) {
  if (!found) return request.channel + ": recorded without the mass";
  const std::string text = sensitivityText(request.channel, *found);
  return request.method == CalibrateRequest::STORE ? text + "; stored, daq_node reads it at its next start"
                                                   : text;
}

}  // namespace

SetupNode::SetupNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
    : setup_(parametersFromServer(private_nh).readAll<SetupNodeParameters>().folder,
             [] { return ros::WallTime::now().toSec(); }),
      try_(nh.advertiseService(names::TRY_INSTRUMENT, &SetupNode::tryInstrument, this)),
      calibrate_(nh.advertiseService(names::CALIBRATE_CHANNEL, &SetupNode::calibrate, this)) {
}

bool SetupNode::tryInstrument(smartmill_msgs::TryInstrument::Request& request, TryResponse& response) {
  try {
    response.code = TryResponse::BAD_DESCRIPTION;
    if (!request.description.empty()) {
      const Trial trial = setup_.check(request.description, request.seconds);
      addTrial(trial, response);
      response.code = trial.problem.empty() ? TryResponse::OK : TryResponse::NO_SAMPLES;
      response.message = trial.problem;
      if (!request.file.empty()) {
        response.path = setup_.store(request.description, request.file, request.replace != 0);
        response.message = "stored in " + response.path;
      }
    } else {
      response.code = TryResponse::OK;
    }
  } catch (const NotWritten& error) {
    response.code = TryResponse::NOT_WRITTEN;
    response.message = error.what();
  } catch (const Error& error) {
    response.code = TryResponse::BAD_DESCRIPTION;
    response.message = error.what();
  }
  addDrivers(response);
  response.files = setup_.files();
  if (!response.message.empty()) ROS_INFO("%s", response.message.c_str());
  return true;
}

bool SetupNode::calibrate(CalibrateRequest& request, CalibrateResponse& response) {
  response.sensitivity = response.sensitivity_std = response.before = NOT_A_NUMBER;
  try {
    const std::optional<NewSensitivity> found = resultOf(setup_, request);
    response.message = messageOf(request, found);
    if (found) {
      response.sensitivity = found->value;
      response.sensitivity_std = found->std_dev;
      response.before = found->before;
      response.parts = static_cast<std::uint32_t>(found->parts);
    }
  } catch (const NoSamples& error) {
    response.code = CalibrateResponse::NO_SAMPLES;
    response.message = error.what();
  } catch (const UnsuitableRecord& error) {
    response.code = CalibrateResponse::REFUSED;
    response.message = error.what();
  } catch (const Error& error) {
    response.code = CalibrateResponse::BAD_REQUEST;
    response.message = error.what();
  }
  ROS_INFO("%s", response.message.c_str());
  return true;
}

}  // namespace smartmill::daq

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<daq::SetupNode>(argc, argv, "setup");
}
