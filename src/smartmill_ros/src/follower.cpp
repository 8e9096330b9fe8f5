#include "smartmill_ros/follower.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include <ros/master.h>
#include <ros/service.h>
#include <ros/this_node.h>

#include "smartmill_core/error.h"

namespace smartmill {
namespace {

using Request = smartmill_msgs::Follow::Request;

constexpr double POLL = 0.02;  // [s] without progress
/// Answers of every node after which messages in sockets, threads and queues are delivered.
constexpr int ROUNDS = 5;
/// The same after a step: a message that is still in a socket belongs to the next one.
constexpr int STEP_ROUNDS = 1;

/// [1] publishers of each topic, registered at the master.
std::map<std::string, std::uint32_t> registeredPublishers() {
  XmlRpc::XmlRpcValue request, response, state;
  request[0] = ros::this_node::getName();
  std::map<std::string, std::uint32_t> count;
  if (!ros::master::execute("getSystemState", request, response, state, false)) return count;
  for (int i = 0; i < state[0].size(); ++i)
    count[std::string(state[0][i][0])] = static_cast<std::uint32_t>(state[0][i][1].size());
  return count;
}

}  // namespace

std::string unconnected(const smartmill_msgs::Follow::Response& inputs) {
  const std::map<std::string, std::uint32_t> registered = registeredPublishers();
  std::string text;
  for (std::size_t i = 0; i < inputs.topics.size(); ++i) {
    const auto publishers = registered.find(inputs.topics[i]);
    if (publishers == registered.end() || inputs.publishers[i] >= publishers->second) continue;
    text += (text.empty() ? "" : ", ") + inputs.topics[i];
  }
  return text;
}

Followers::Followers(std::vector<std::string> nodes) {
  for (std::string& name : nodes) nodes_.push_back({std::move(name), {}, {}, {}});
}

bool Followers::tryCall(Node& node, std::uint8_t phase, Response& response) {
  const std::string service = node.name + "/" + FOLLOW;
  if (!node.client.isValid()) {
    if (!ros::service::exists(service, false)) return false;
    node.client = ros::NodeHandle().serviceClient<smartmill_msgs::Follow>(service, true);
  }
  smartmill_msgs::Follow message;
  message.request.phase = phase;
  if (!node.client.call(message)) return false;
  response = message.response;
  node.taken.clear();
  for (std::size_t i = 0; i < response.topics.size(); ++i) node.taken[response.topics[i]] = response.taken[i];
  return true;
}

Followers::Response Followers::call(Node& node, std::uint8_t phase) {
  Response response;
  if (!tryCall(node, phase, response)) throw Error(node.name + " no longer answers (service " + FOLLOW + ")");
  return response;
}

void Followers::waitFor(const std::function<std::string()>& missing, double timeout) {
  const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(timeout);
  for (std::string text = missing(); !text.empty(); text = missing()) {
    if (!ros::ok()) throw Error("interrupted by the shutdown of ROS: " + text);
    if (ros::SteadyTime::now() > end) throw Error(text);
    ros::WallDuration(POLL).sleep();
  }
}

void Followers::begin(double timeout) {
  sent_.clear();
  for (Node& node : nodes_) {
    waitFor(
        [&]() -> std::string {
          Response response;
          if (!tryCall(node, Request::BEGIN, response)) return node.name + " is not running";
          const std::string topics = unconnected(response);
          return topics.empty() ? "" : node.name + " is not connected to all publishers of " + topics;
        },
        timeout);
    node.taken_at_begin = node.taken;
  }
  waitForDelivery();
  for (Node& node : nodes_) node.taken_at_begin = node.taken;
}

void Followers::expect(const ros::Publisher& publisher, double timeout) {
  const std::string topic = publisher.getTopic();
  const auto expected = static_cast<std::uint32_t>(std::count_if(
      nodes_.begin(), nodes_.end(), [&](const Node& node) { return node.taken.count(topic) > 0; }));
  waitFor(
      [&]() -> std::string {
        return publisher.getNumSubscribers() >= expected ? "" : topic + ": a node has not connected";
      },
      timeout);
}

// A subscriber counts a publisher once it has requested the connection. The thread of the publisher that
// handles the request also answers the service, so that an answer shows that the connection is made.
void Followers::expect(const ros::Subscriber& subscriber, double timeout) {
  waitFor(
      [&]() -> std::string {
        return subscriber.getNumPublishers() > 0 ? "" : subscriber.getTopic() + ": no publisher";
      },
      timeout);
  waitForDelivery();
}

void Followers::waitForDelivery() {
  for (int round = 0; round < ROUNDS; ++round) updateCounts();
}

// @return [1] messages that all nodes have processed
std::uint64_t Followers::updateCounts() {
  std::uint64_t taken = 0;
  for (Node& node : nodes_) {
    call(node, Request::LOOK);
    for (const auto& [topic, count] : node.taken) taken += count;
  }
  return taken;
}

std::uint64_t Followers::behind() const {
  std::uint64_t max_behind = 0;
  for (const Node& node : nodes_) {
    std::uint64_t waiting = 0;
    for (const auto& [topic, count] : node.taken) {
      const auto sent = sent_.find(topic), at_begin = node.taken_at_begin.find(topic);
      if (sent == sent_.end()) continue;
      const std::uint64_t since = count - (at_begin == node.taken_at_begin.end() ? 0 : at_begin->second);
      waiting += sent->second - std::min(sent->second, since);
    }
    max_behind = std::max(max_behind, waiting);
  }
  return max_behind;
}

void Followers::keepUp(std::uint64_t max_behind) {
  std::uint64_t previous = 0;
  ros::SteadyTime last_progress = ros::SteadyTime::now();
  while (behind() > max_behind) {
    const std::uint64_t taken = updateCounts();
    if (taken != previous) {
      previous = taken;
      last_progress = ros::SteadyTime::now();
      continue;
    }
    if (!ros::ok() || (ros::SteadyTime::now() - last_progress).toSec() > TIMEOUT)
      throw Error(std::to_string(behind()) + " messages are not processed by a node");
    ros::WallDuration(POLL).sleep();
  }
}

void Followers::settle() {
  settle(ROUNDS);
}

// @param rounds without a processed message
void Followers::settle(int rounds) {
  keepUp(0);
  std::uint64_t previous = updateCounts();
  for (int round = 0; round < rounds; ++round) {
    const std::uint64_t taken = updateCounts();
    if (taken != previous) round = -1;
    previous = taken;
  }
}

void Followers::step() {
  settle(STEP_ROUNDS);
  for (Node& node : nodes_) call(node, Request::STEP);
}

// Messages of other publishers may never stand still.
void Followers::leave() {
  keepUp(0);
  for (Node& node : nodes_) call(node, Request::LEAVE);
}

void Followers::end() {
  for (Node& node : nodes_) {
    settle();
    call(node, Request::END);
  }
  settle();
}

}  // namespace smartmill
