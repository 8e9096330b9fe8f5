#include "smartmill_ros/inputs.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <stdexcept>
#include <utility>

#include <ros/console.h>

#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_ros/steady_time.h"

namespace smartmill {
namespace {

constexpr double LOG_PERIOD = 5.0;  // [s] between lines in the log about one input
constexpr double HOLD = 120.0;      // [s] without a call after which a player has ended

}  // namespace

std::string InputHealth::take(double now, const std::function<void()>& handle) {
  const Watchdog before = watchdog_;
  watchdog_.heard();
  ++taken_;
  is_dropped_ = false;
  try {
    handle();
    last_refused_ = false;
    if (is_dropped_) {
      watchdog_ = before;
      ++dropped_;
    }
    return {};
  } catch (const std::exception& error) {
    return refuse(now, error.what());
  }
}

std::string InputHealth::refuse(double now, const std::string& problem) {
  problem_ = problem;
  ++refused_;
  last_refused_ = true;
  reported_ = false;
  if (now - logged_ < LOG_PERIOD) return {};
  logged_ = now;
  return topic_ + ": " + problem_;
}

void InputHealth::count(const std::string& publisher, std::uint32_t number) {
  const auto [last, is_first] = numbers_.try_emplace(publisher, number);
  if (!is_first && number > last->second) lost_ += number - last->second - 1;
  last->second = number;
}

smartmill_msgs::StreamHealth InputHealth::account(const std::string& topic) {
  smartmill_msgs::StreamHealth account;
  account.topic = topic;
  account.received = taken_;
  account.lost = lost_;
  account.waiting = waiting();
  account.dropped = dropped_;
  account.refused = refused_;
  const std::uint64_t unused = account.waiting + account.dropped + account.refused;
  account.processed = taken_ - std::min(taken_, unused);
  account.lost_samples = check_.lostSamples();
  account.silent = watchdog_.silent();
  account.latency = std::exchange(latency_, 0.0);
  account.fault = check_.present();
  return account;
}

std::string InputHealth::takeProblem() {
  // Returned at least once, and as long as it persists.
  if (reported_ && !last_refused_) return {};
  reported_ = true;
  return problem_;
}

Inputs::Inputs(const ros::NodeHandle& nh, double timeout) : nh_(nh), timeout_(timeout), any_(timeout) {
}

void Inputs::tick(double period) {
  if (hold_ > 0.0) {
    hold_ -= period;
    return;
  }
  any_.tick(period);
  for (InputHealth& input : inputs_) input.watchdog().tick(period);
  progress_.tick(period, toSec(ros::Time::now()));
  logBehind();
}

InputHealth& Inputs::add(const std::string& topic) {
  inputs_.emplace_back(topic, timeout_);
  return inputs_.back();
}

void Inputs::take(InputHealth& health, const std::function<void()>& handle) {
  any_.heard();
  const double now = steadyTime();
  std::string line, line_of_other;
  line = health.take(now, [&] {
    try {
      handle();
    } catch (const StreamError& error) {
      // Data of another input, which this one has released.
      const auto other = std::find_if(inputs_.begin(), inputs_.end(), [&](const InputHealth& input) {
        return input.topic() == error.stream() && &input != &health;
      });
      if (other == inputs_.end()) throw;
      line_of_other = other->refuse(now, error.what());
    }
  });
  if (!line.empty()) ROS_ERROR_STREAM(line);
  if (!line_of_other.empty()) ROS_ERROR_STREAM(line_of_other);
}

void Inputs::logLines(InputHealth& health) {
  for (const std::string& line : health.streamCheck().takeLines())
    ROS_ERROR_STREAM(health.topic() << ": " << line);
}

// Which of both is wrong is not known: the reading is not used.
bool Inputs::agreesWithController(InputHealth& health, const SpindleAngle& reading) {
  const std::string line = speeds_.check(reading);
  if (!line.empty()) ROS_ERROR_STREAM(health.topic() << ": " << line);
  return !speeds_.disagrees();
}

void Inputs::noteStamp(InputHealth& health, double stamp, double limit) {
  if (!health.progress) health.progress = progress_.add(limit);
  progress_.heard(*health.progress, stamp);
  health.noteLatency(toSec(ros::Time::now()) - stamp);
}

void Inputs::logBehind() {
  for (const auto& [stream, line] : progress_.takeLines()) {
    for (const InputHealth& input : inputs_) {
      if (input.progress == stream) ROS_WARN_STREAM(input.topic() << ": " << line);
    }
  }
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
  if (request.phase == Request::STEP) {
    progress_.step();
    logBehind();
  }
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

std::vector<smartmill_msgs::StreamHealth> Inputs::accounts() {
  std::vector<smartmill_msgs::StreamHealth> accounts;
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    accounts.push_back(inputs_[i].account(subscribers_[i].getTopic()));
    accounts.back().publishers = subscribers_[i].getNumPublishers();
  }
  return accounts;
}

void Inputs::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  status.summary(Level::OK, "inputs without errors");
  if (speeds_.disagrees())
    status.mergeSummary(Level::ERROR, "speeds of spindle/angle and of the controller differ");
  for (InputHealth& input : inputs_) {
    const std::string problem = input.takeProblem();
    if (!problem.empty()) status.mergeSummary(Level::ERROR, input.topic() + ": " + problem);
    const std::string fault = input.streamCheck().present();
    if (!fault.empty()) status.mergeSummary(Level::ERROR, input.topic() + ": " + fault);
    const double behind = input.progress ? progress_.behind(*input.progress) : 0.0;
    if (behind > 0.0)
      status.mergeSummary(Level::WARN, input.topic() + formatted(": %.2f s behind the other inputs", behind));
    if (input.watchdog().ever()) {
      status.addf(input.topic(), "%.2f s since the last message, %zu refused", input.watchdog().silent(),
                  input.refused());
    } else {
      status.add(input.topic(), "no message yet");
    }
  }
}

}  // namespace smartmill
