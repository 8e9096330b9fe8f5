#include "node/fault_node.h"

#include <memory>
#include <utility>

#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::sim {
namespace {

constexpr double WATCH_PERIOD = 0.2;  // [s]

FaultParameters read(const ros::NodeHandle& private_nh) {
  if (!ros::Time::isSimTime())
    throw Error(
        "/use_sim_time: false, expected true: faults of sensors are for a simulation or a replay only");
  return parametersFromServer(private_nh).readAll<FaultParameters>();
}

}  // namespace

FaultNode::FaultNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_(read(private_nh)), shell_(nh, private_nh, "none", parameters_.input_timeout) {
  for (const std::string& topic : parameters_.topicList()) {
    if (topic == names::SPINDLE_ANGLE) {
      passAngles(nh, topic);
    } else {
      passBlocks(nh, topic);
    }
  }
  for (const TopicFault& entry : readFaults(parameters_.faults)) streams_.at(entry.topic).add(entry.fault);
  service_ = nh.advertiseService(names::SET_FAULT, &FaultNode::set, this);
  shell_.diagnose("faults", [this](auto& status) { diagnose(status); });
  shell_.every(WATCH_PERIOD, [this] {
    if (!shell_.inputs().any().ended()) return;
    for (auto& [topic, stream] : streams_) stream.flush();
  });
}

// The messages are passed as they are: a check of the healthy stream is not the task of this node.
template <class Data, class Publish>
void FaultNode::pass(ros::NodeHandle& nh, const std::string& topic, Publish publish) {
  using Message = typename MessageOf<Data>::Type;
  const auto publisher = std::make_shared<ros::Publisher>(nh.advertise<Message>(topic, STREAM_QUEUE));
  const auto faulty = std::make_shared<FaultyStream<Data>>();
  const auto frame = std::make_shared<std::string>();
  const auto send = [publisher, frame, publish](const std::vector<Data>& items) {
    for (const Data& item : items) publisher->publish(publish(item, *frame));
  };
  shell_.inputs().on<Message>(names::healthy(topic), [faulty, frame, send](const Message& message, double) {
    *frame = message.header.frame_id;
    send(faulty->push(fromMsg(message)));
  });
  streams_[topic] = {[faulty](const StreamFault& fault) { faulty->add(fault); },
                     [faulty](const StreamFault& fault) { faulty->begin(fault); },
                     [faulty] { faulty->clear(); }, [faulty, send] { send(faulty->flush()); }};
}

void FaultNode::passBlocks(ros::NodeHandle& nh, const std::string& topic) {
  pass<SampleBlock>(nh, topic,
                    [](const SampleBlock& block, const std::string& frame) { return toMsg(block, frame); });
}

void FaultNode::passAngles(ros::NodeHandle& nh, const std::string& topic) {
  pass<SpindleAngle>(nh, topic, [](const SpindleAngle& angle, const std::string&) { return toMsg(angle); });
}

bool FaultNode::set(smartmill_msgs::SetFault::Request& request,
                    smartmill_msgs::SetFault::Response& response) {
  using Response = smartmill_msgs::SetFault::Response;
  try {
    const auto stream = streams_.find(request.topic);
    if (stream == streams_.end())
      throw Error("topic " + request.topic + " does not pass through this node, expected one of " +
                  parameters_.topics);
    if (request.fault.empty()) {
      stream->second.clear();
      response.message = request.topic + ": no fault";
    } else {
      stream->second.begin(makeFault(request.fault, 0.0, request.duration, request.value));
      response.message = request.topic + ": " + request.fault +
                         (request.duration > 0.0 ? formatted(" for %.3f s", request.duration) : "");
    }
    stream->second.command = response.message;
    response.code = Response::OK;
    ROS_WARN_STREAM(response.message);
  } catch (const Error& error) {
    response.code = Response::REFUSED;
    response.message = error.what();
  }
  return true;
}

void FaultNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  status.summary(diagnostic_msgs::DiagnosticStatus::OK, "passes " + parameters_.topics);
  status.add("faults", parameters_.faults);
  for (const auto& [topic, stream] : streams_) status.add(topic, stream.command);
}

}  // namespace smartmill::sim

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<sim::FaultNode>(argc, argv, "fault_node");
}
