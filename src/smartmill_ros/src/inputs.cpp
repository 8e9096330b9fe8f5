#include "smartmill_ros/inputs.h"

#include <exception>
#include <stdexcept>

#include <ros/console.h>

namespace smartmill {
namespace {

constexpr double LOG_PERIOD = 5.0;  // [s] between lines in the log about one input
constexpr double HOLD = 120.0;      // [s] without a call after which a player has ended

}  // namespace

std::string InputHealth::take(double now, const std::function<void()>& handle) {
  watchdog_.heard();
  ++taken_;
  try {
    handle();
    last_refused_ = false;
    return {};
  } catch (const std::exception& error) {
    problem_ = error.what();
    ++refused_;
    last_refused_ = true;
    reported_ = false;
  }
  if (now - logged_ < LOG_PERIOD) return {};
  logged_ = now;
  return topic_ + ": " + problem_;
}

std::string InputHealth::takeProblem() {
  // Returned at least once, and as long as it persists.
  if (reported_ && !last_refused_) return {};
  reported_ = true;
  return problem_;
}

Inputs::Inputs(ros::NodeHandle nh, double timeout) : nh_(std::move(nh)), timeout_(timeout), any_(timeout) {
}

void Inputs::tick(double period) {
  if (hold_ > 0.0) {
    hold_ -= period;
    return;
  }
  any_.tick(period);
  for (InputHealth& input : inputs_) input.watchdog().tick(period);
}

InputHealth& Inputs::add(const std::string& topic) {
  inputs_.emplace_back(topic, timeout_);
  return inputs_.back();
}

void Inputs::take(InputHealth& health, const std::function<void()>& handle) {
  any_.heard();
  const std::string line = health.take(ros::WallTime::now().toSec(), handle);
  if (!line.empty()) ROS_ERROR_STREAM(line);
}

InputHealth& Inputs::find(const std::string& topic) {
  for (InputHealth& input : inputs_) {
    if (input.topic() == topic) return input;
  }
  throw std::out_of_range("no input " + topic);
}

Watchdog& Inputs::watchdog(const std::string& topic) {
  return find(topic).watchdog();
}

const InputHealth* Inputs::dead(std::initializer_list<const char*> topics) {
  for (const char* topic : topics) {
    const InputHealth& input = find(topic);
    if (input.watchdog().dead()) return &input;
  }
  return nullptr;
}

void Inputs::follow(const smartmill_msgs::Follow::Request& request,
                    smartmill_msgs::Follow::Response& response) {
  using Request = smartmill_msgs::Follow::Request;
  if (request.phase == Request::BEGIN || hold_ > 0.0) hold_ = HOLD;
  if (request.phase == Request::END || request.phase == Request::LEAVE) hold_ = 0.0;
  if (request.phase == Request::END) {
    any_.end();
    for (InputHealth& input : inputs_) input.watchdog().end();
  }
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    response.topics.push_back(subscribers_[i].getTopic());
    response.taken.push_back(inputs_[i].taken());
    response.publishers.push_back(subscribers_[i].getNumPublishers());
  }
}

void Inputs::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  status.summary(Level::OK, "inputs without errors");
  for (InputHealth& input : inputs_) {
    const std::string problem = input.takeProblem();
    if (!problem.empty()) status.mergeSummary(Level::ERROR, input.topic() + ": " + problem);
    if (input.watchdog().ever()) {
      status.addf(input.topic(), "%.2f s since the last message, %zu refused", input.watchdog().silent(),
                  input.refused());
    } else {
      status.add(input.topic(), "no message yet");
    }
  }
}

}  // namespace smartmill
