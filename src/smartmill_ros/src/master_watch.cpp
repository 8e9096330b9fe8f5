#include "smartmill_ros/master_watch.h"

#include <chrono>
#include <cstdint>
#include <vector>

#include <ros/console.h>
#include <ros/init.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <ros/xmlrpc_manager.h>

#include <XmlRpcClient.h>
#include <XmlRpcDispatch.h>

#include "smartmill_ros/kept_messages.h"

namespace smartmill {
namespace {

using Value = XmlRpc::XmlRpcValue;

constexpr std::chrono::seconds PERIOD{1};
constexpr double ANSWER_PERIOD = 0.01;  // [s] between two looks for an answer
constexpr int MOST_LOOKS = 500;         // for an answer
constexpr int LOOKS_PER_COPY = 10;      // of the parameters, which can be large
/// After which all nodes have registered what they publish. The master sends each list of publishers to the
/// registered subscribers, which would leave those that are not in the list yet.
constexpr int LOOKS_TO_SUBSCRIBE = 2;

Value list(const std::vector<std::string>& words) {
  Value list;
  list.setSize(static_cast<int>(words.size()));
  for (int i = 0; i < list.size(); ++i) list[i] = words[static_cast<std::size_t>(i)];
  return list;
}

/// Call of the master. @return false: no answer, or refused
bool call(const std::string& method, const std::vector<std::string>& arguments, Value& result) {
  std::vector<std::string> words{ros::this_node::getName()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  Value response;
  return ros::master::execute(method, list(words), response, result, false);
}

/// Whether entries [name, [nodes]] of the master's state contain this node; calls use with each such name.
template <class Use>
bool hasOwn(Value& entries, const Use& use) {
  bool found = false;
  for (int i = 0; i < entries.size(); ++i) {
    Value& nodes = entries[i][1];
    for (int k = 0; k < nodes.size(); ++k) {
      if (static_cast<std::string>(nodes[k]) != ros::this_node::getName()) continue;
      found = true;
      use(static_cast<std::string>(entries[i][0]));
    }
  }
  return found;
}

}  // namespace

MasterWatch::MasterWatch(const ros::NodeHandle& nh)
    : names_({"/use_sim_time", ros::this_node::getName(), launchParameter(nh), keptParameter(nh)}),
      thread_([this] { watch(); }) {
}

MasterWatch::~MasterWatch() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stops_ = true;
  }
  stopped_.notify_all();
  thread_.join();
}

void MasterWatch::watch() {
  while (!stopsWithin(PERIOD)) look();
}

bool MasterWatch::stopsWithin(std::chrono::seconds time) {
  std::unique_lock<std::mutex> lock(mutex_);
  return stopped_.wait_for(lock, time, [this] { return stops_; });
}

/// Call of this node's own XML-RPC server, which lists its topics. A server that has ended answers no more.
bool MasterWatch::callSelf(const std::string& method, const Value& arguments, Value& result) {
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(ros::XMLRPCManager::instance()->getServerURI(), host, port)) return false;
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  Value response;
  if (!client.executeNonBlock(method.c_str(), arguments)) return false;
  XmlRpc::XmlRpcDispatch dispatch;
  dispatch.addSource(&client, XmlRpc::XmlRpcDispatch::WritableEvent | XmlRpc::XmlRpcDispatch::Exception);
  for (int look = 0; !client.executeCheckDone(response); ++look) {
    if (look == MOST_LOOKS || stopsWithin(std::chrono::seconds(0))) return false;
    dispatch.work(ANSWER_PERIOD);
  }
  if (client.isFault() || response.getType() != Value::TypeArray || response.size() != 3) return false;
  result = response[2];
  return true;
}

void MasterWatch::look() {
  Value state;
  const bool answers = call("getSystemState", {}, state) && state.size() == 3;
  if (ros::isShuttingDown()) return;  // unregisters, or has done so
  if (!answers) {
    if (!is_gone_) ROS_ERROR("no answer of the ROS master at %s", ros::master::getURI().c_str());
    is_gone_ = true;
    return;
  }
  if (is_gone_) ROS_WARN("the ROS master at %s answers again", ros::master::getURI().c_str());
  is_gone_ = false;
  const auto ignore = [](const std::string&) {};
  const bool publishes = hasOwn(state[0], ignore), subscribes = hasOwn(state[1], ignore);
  if (publishes || subscribes) {
    is_known_ = true;
    remember(state[2]);
    if (to_subscribe_ > 0 && --to_subscribe_ == 0) registerSubscriptions();
  } else if (is_known_) {
    registerPublications();
    to_subscribe_ = LOOKS_TO_SUBSCRIBE;
  }
}

void MasterWatch::remember(Value& services) {
  hasOwn(services, [this](const std::string& name) {
    Value address;
    if (services_.count(name) == 0 && call("lookupService", {name}, address))
      services_[name] = static_cast<std::string>(address);
  });
  if (looks_++ % LOOKS_PER_COPY == 0) rememberParameters();
}

void MasterWatch::rememberParameters() {
  for (const std::string& name : names_) {
    Value value;
    if (call("getParam", {name}, value)) parameters_[name] = value;
  }
}

void MasterWatch::registerPublications() {
  for (auto& [name, value] : parameters_) {
    Value request, response, result;
    request[0] = ros::this_node::getName();
    request[1] = name;
    request[2] = value;
    ros::master::execute("setParam", request, response, result, false);
  }
  const std::string address = ros::XMLRPCManager::instance()->getServerURI();
  Value published, result;
  if (!callSelf("getPublications", list({ros::this_node::getName()}), published)) return;
  for (int i = 0; i < published.size(); ++i)
    call("registerPublisher", {published[i][0], published[i][1], address}, result);
  for (const auto& [name, service] : services_) call("registerService", {name, service, address}, result);
  ROS_WARN("new ROS master at %s: registered again with %d topics and %zu services",
           ros::master::getURI().c_str(), published.size(), services_.size());
}

void MasterWatch::registerSubscriptions() {
  const std::string address = ros::XMLRPCManager::instance()->getServerURI();
  Value subscribed, result;
  if (!callSelf("getSubscriptions", list({ros::this_node::getName()}), subscribed)) return;
  for (int i = 0; i < subscribed.size(); ++i) {
    Value update = list({ros::this_node::getName(), subscribed[i][0]});
    if (call("registerSubscriber", {subscribed[i][0], subscribed[i][1], address}, update[2]) &&
        update[2].size() > 0)
      callSelf("publisherUpdate", update, result);
  }
}

}  // namespace smartmill
