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

constexpr double POLL = 0.02;  // [s] between two questions while nobody moves
/// So many answers of every node: what was on its way through sockets, threads and queues has arrived.
constexpr int ROUNDS = 5;

/// [1] publishers of each topic that the master knows.
std::map<std::string, std::uint32_t> publishersKnown() {
  XmlRpc::XmlRpcValue request, response, state;
  request[0] = ros::this_node::getName();
  std::map<std::string, std::uint32_t> known;
  if (!ros::master::execute("getSystemState", request, response, state, false)) return known;
  for (int i = 0; i < state[0].size(); ++i)
    known[std::string(state[0][i][0])] = static_cast<std::uint32_t>(state[0][i][1].size());
  return known;
}

}  // namespace

std::string unconnected(const smartmill_msgs::Follow::Response& inputs) {
  const std::map<std::string, std::uint32_t> known = publishersKnown();
  std::string text;
  for (std::size_t i = 0; i < inputs.topics.size(); ++i) {
    const auto publishers = known.find(inputs.topics[i]);
    if (publishers == known.end() || inputs.publishers[i] >= publishers->second) continue;
    text += (text.empty() ? "" : ", ") + inputs.topics[i];
  }
  return text;
}

Followers::Followers(std::vector<std::string> nodes) {
  for (std::string& name : nodes) nodes_.push_back({std::move(name), {}, {}, {}});
}

bool Followers::answers(Node& node, std::uint8_t phase, Response& response) {
  const std::string service = node.name + "/" + FOLLOW;
  if (!node.client.isValid()) {
    if (!ros::service::exists(service, false)) return false;
    node.client = ros::NodeHandle().serviceClient<smartmill_msgs::Follow>(service, true);
  }
  smartmill_msgs::Follow call;
  call.request.phase = phase;
  if (!node.client.call(call)) return false;
  response = call.response;
  node.taken.clear();
  for (std::size_t i = 0; i < response.topics.size(); ++i) node.taken[response.topics[i]] = response.taken[i];
  return true;
}

Followers::Response Followers::ask(Node& node, std::uint8_t phase) {
  Response response;
  if (!answers(node, phase, response)) throw Error(node.name + " answers no more");
  return response;
}

void Followers::waitFor(const std::function<std::string()>& missing, double patience) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(patience);
  for (std::string text = missing(); !text.empty(); text = missing()) {
    if (!ros::ok()) throw Error("ended while waiting: " + text);
    if (ros::WallTime::now() > end) throw Error(text);
    ros::WallDuration(POLL).sleep();
  }
}

void Followers::begin(double patience) {
  sent_.clear();
  for (Node& node : nodes_) {
    waitFor(
        [&]() -> std::string {
          Response response;
          if (!answers(node, Request::BEGIN, response)) return node.name + " is not there";
          const std::string topics = unconnected(response);
          return topics.empty() ? "" : node.name + " is not connected with " + topics;
        },
        patience);
    node.begun = node.taken;
  }
  lookOften();
  for (Node& node : nodes_) node.begun = node.taken;
}

void Followers::expect(const ros::Publisher& publisher, double patience) {
  const std::string topic = publisher.getTopic();
  const auto due = static_cast<std::uint32_t>(std::count_if(
      nodes_.begin(), nodes_.end(), [&](const Node& node) { return node.taken.count(topic) > 0; }));
  waitFor(
      [&]() -> std::string {
        return publisher.getNumSubscribers() >= due ? "" : topic + ": a node has not connected";
      },
      patience);
}

// A subscriber counts its publisher when it has asked for the connection; the publisher's thread that takes
// the request answers the questions too.
void Followers::expect(const ros::Subscriber& listener, double patience) {
  waitFor(
      [&]() -> std::string {
        return listener.getNumPublishers() > 0 ? "" : listener.getTopic() + ": nobody publishes";
      },
      patience);
  lookOften();
}

void Followers::lookOften() {
  for (int round = 0; round < ROUNDS; ++round) look();
}

std::uint64_t Followers::look() {
  std::uint64_t taken = 0;
  for (Node& node : nodes_) {
    ask(node, Request::LOOK);
    for (const auto& [topic, count] : node.taken) taken += count;
  }
  return taken;
}

std::uint64_t Followers::behind() const {
  std::uint64_t most = 0;
  for (const Node& node : nodes_) {
    std::uint64_t waiting = 0;
    for (const auto& [topic, count] : node.taken) {
      const auto sent = sent_.find(topic), begun = node.begun.find(topic);
      if (sent == sent_.end()) continue;
      const std::uint64_t since = count - (begun == node.begun.end() ? 0 : begun->second);
      waiting += sent->second - std::min(sent->second, since);
    }
    most = std::max(most, waiting);
  }
  return most;
}

void Followers::keepUp(std::uint64_t most) {
  std::uint64_t before = 0;
  ros::WallTime moved = ros::WallTime::now();
  while (behind() > most) {
    const std::uint64_t taken = look();
    if (taken != before) {
      before = taken;
      moved = ros::WallTime::now();
      continue;
    }
    if (!ros::ok() || (ros::WallTime::now() - moved).toSec() > PATIENCE)
      throw Error(std::to_string(behind()) + " messages are not taken by their nodes");
    ros::WallDuration(POLL).sleep();
  }
}

void Followers::settle() {
  keepUp(0);
  std::uint64_t before = look();
  for (int round = 0; round < ROUNDS; ++round) {
    const std::uint64_t taken = look();
    if (taken != before) round = -1;
    before = taken;
  }
}

void Followers::leave() {
  settle();
  for (Node& node : nodes_) ask(node, Request::LEAVE);
}

void Followers::end() {
  for (Node& node : nodes_) {
    settle();
    ask(node, Request::END);
  }
  settle();
}

}  // namespace smartmill
