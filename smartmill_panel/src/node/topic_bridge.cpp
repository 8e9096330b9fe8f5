#include "node/topic_bridge.h"

#include <optional>
#include <set>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/master.h>
#include <ros/message_traits.h>
#include <smartmill_msgs/ChatterAdvice.h>
#include <smartmill_msgs/ChatterState.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/CuttingCoefficients.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/DiscrepancyState.h>
#include <smartmill_msgs/FleetState.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/ForceRevolution.h>
#include <smartmill_msgs/ForceSensorState.h>
#include <smartmill_msgs/ForceSpectrum.h>
#include <smartmill_msgs/ForceStrip.h>
#include <smartmill_msgs/Frf.h>
#include <smartmill_msgs/LoadSample.h>
#include <smartmill_msgs/ModalModel.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SessionState.h>
#include <smartmill_msgs/SoundAdvice.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <smartmill_msgs/StabilityChart.h>
#include <std_msgs/String.h>
#include <boost/function.hpp>

#include "smartmill_core/formatted.h"
#include "smartmill_core/names.h"

namespace smartmill::panel {
namespace {

constexpr std::uint32_t QUEUE = 1000;  // [messages] of a topic
/// Number of latched messages of topics that the page draws over time.
constexpr std::uint64_t STRIPS_KEPT = 1200, STATES_KEPT = 600, LINES_KEPT = 200;

/// Message types whose definition is available before the first message.
template <class... Messages>
std::map<std::string, std::string> definitionsOf() {
  return {{ros::message_traits::DataType<Messages>::value(),
           ros::message_traits::Definition<Messages>::value()}...};
}

const std::map<std::string, std::string>& knownDefinitions() {
  using namespace smartmill_msgs;
  static const auto definitions =
      definitionsOf<ChatterAdvice, ChatterState, CncState, CuttingCoefficients, CuttingCondition,
                    DiscrepancyState, FleetState, ForceBlock, ForceRevolution, ForceSensorState,
                    ForceSpectrum, ForceStrip, Frf, LoadSample, ModalModel, SampleBlock, SessionState,
                    SoundAdvice, SpindleAngle, StabilityChart, diagnostic_msgs::DiagnosticArray>();
  return definitions;
}

template <class Message>
bool is(const std::string& type) {
  return type == ros::message_traits::DataType<Message>::value();
}

bool isStream(const std::string& type) {
  return is<smartmill_msgs::SampleBlock>(type) || is<smartmill_msgs::ForceBlock>(type) ||
         is<smartmill_msgs::SpindleAngle>(type);
}

/// Whether a topic of a machine in another namespace is part of its status line.
bool isStatusTopic(const std::string& topic) {
  for (const char* name : {names::CNC_STATE, names::CHATTER_STATE, names::CUTTING_CONDITION}) {
    const std::string ending = std::string("/") + name;
    if (topic.size() > ending.size() &&
        topic.compare(topic.size() - ending.size(), ending.size(), ending) == 0)
      return true;
  }
  return false;
}

std::string ringKey(std::uint64_t count, std::uint64_t most) {
  return formatted("%06lu", static_cast<unsigned long>(count % most));
}

}  // namespace

TopicBridge::TopicBridge(ros::NodeHandle nh, Server& server) : nh_(std::move(nh)), server_(server) {
}

void TopicBridge::discover() {
  ros::master::V_TopicInfo topics;
  if (!ros::master::getTopics(topics)) return;
  static const std::set<std::string> OTHERS{"/diagnostics", "/tf", "/tf_static"};
  const std::string prefix = nh_.getNamespace() + "/";
  // Who reads the panel must not listen to the workshop.
  const std::string private_sound = prefix + names::SOUND;
  for (const ros::master::TopicInfo& topic : topics)
    if ((topic.name.rfind(prefix, 0) == 0 && topic.name != private_sound) || OTHERS.count(topic.name) ||
        isStatusTopic(topic.name))
      add(topic.name, topic.datatype);
}

void TopicBridge::add(const std::string& name, const std::string& type) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (topics_.count(name)) return;
  Topic& topic = topics_[name];
  topic.id = static_cast<std::uint32_t>(topics_.size());
  topic.type = type;
  const auto definition = knownDefinitions().find(type);
  topic.advertised = definition != knownDefinitions().end();
  // Before the subscription: the channel must exist when a latched message arrives at once.
  if (topic.advertised) server_.advertise({topic.id, name, type, definition->second});
  // A stream of an unknown type is not recognised before its first message.
  if (!isStream(type)) topic.subscriber = subscribe(name);
}

void TopicBridge::setWanted(std::uint32_t channel, bool wanted) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (auto& [name, topic] : topics_) {
    if (topic.id != channel || !isStream(topic.type)) continue;
    topic.subscriber = wanted ? subscribe(name) : ros::Subscriber();
  }
}

ros::Subscriber TopicBridge::subscribe(const std::string& name) {
  const boost::function<void(const topic_tools::ShapeShifter&)> callback =
      [this, name](const topic_tools::ShapeShifter& message) { forward(name, message); };
  return nh_.subscribe<topic_tools::ShapeShifter>(name, QUEUE, callback, ros::VoidConstPtr(),
                                                  ros::TransportHints().tcpNoDelay());
}

std::string TopicBridge::keyOf(const Topic& topic, const topic_tools::ShapeShifter& message) {
  const std::string& type = topic.type;
  if (is<smartmill_msgs::Frf>(type)) {
    const auto frf = message.instantiate<smartmill_msgs::Frf>();
    return frf->point + frf->direction;
  }
  if (is<smartmill_msgs::ModalModel>(type)) {
    const auto modes = message.instantiate<smartmill_msgs::ModalModel>();
    return modes->point + modes->direction;
  }
  // The newest of each source, and the newest of a steady cut.
  const auto digest = [](const auto& found) {
    return std::to_string(found->source) + (found->steady ? " steady" : "");
  };
  if (is<smartmill_msgs::ForceRevolution>(type))
    return digest(message.instantiate<smartmill_msgs::ForceRevolution>());
  if (is<smartmill_msgs::ForceSpectrum>(type))
    return digest(message.instantiate<smartmill_msgs::ForceSpectrum>());
  if (is<smartmill_msgs::ForceStrip>(type)) return ringKey(topic.count, STRIPS_KEPT);
  if (is<smartmill_msgs::ChatterState>(type) || is<smartmill_msgs::DiscrepancyState>(type))
    return ringKey(topic.count, STATES_KEPT);
  // Goals, accepted and rejected hits, results; log lines.
  if (type.rfind("smartmill_msgs/MeasureFrfAction", 0) == 0 || is<std_msgs::String>(type))
    return ringKey(topic.count, LINES_KEPT);
  return {};
}

void TopicBridge::forward(const std::string& name, const topic_tools::ShapeShifter& message) {
  std::optional<Channel> news;
  std::uint32_t id = 0;
  bool latched = false;
  std::string key;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    Topic& topic = topics_.at(name);
    if (!topic.advertised) {
      topic.advertised = true;
      topic.type = message.getDataType();
      news = Channel{topic.id, name, topic.type, message.getMessageDefinition()};
    }
    id = topic.id;
    latched = !isStream(topic.type);
    if (latched) key = keyOf(topic, message);
    ++topic.count;
  }
  if (news) server_.advertise(*news);
  std::string data(message.size(), '\0');
  ros::serialization::OStream out(reinterpret_cast<std::uint8_t*>(data.data()), message.size());
  message.write(out);
  server_.publish(id, ros::WallTime::now().toNSec(), std::move(data), latched, key);
}

}  // namespace smartmill::panel
