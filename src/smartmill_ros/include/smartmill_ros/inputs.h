#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <type_traits>
#include <utility>

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <ros/node_handle.h>
#include <smartmill_msgs/Follow.h>
#include <boost/function.hpp>

#include "smartmill_core/signal/watchdog.h"
#include "smartmill_ros/conversions.h"

namespace smartmill {

/// Messages of sampled streams that wait, in publishers and subscribers: 1000 s of blocks, so that a node
/// that was starved catches up instead of losing.
constexpr std::uint32_t STREAM_QUEUE = 100000;

/// One input of a node: whether it is alive, and what its handler refused last.
class InputHealth {
 public:
  InputHealth(std::string topic, double timeout) : topic_(std::move(topic)), watchdog_(timeout) {}

  /// Hands on what came; whatever that throws stays here. @param now [s] wall time
  /// @return a line for the log, empty when there is nothing to say (again).
  std::string take(double now, const std::function<void()>& handle);

  const std::string& topic() const { return topic_; }
  const Watchdog& watchdog() const { return watchdog_; }
  Watchdog& watchdog() { return watchdog_; }
  /// What was refused since it was asked for last; empty: nothing.
  std::string takeProblem();
  std::size_t refused() const { return refused_; }  ///< [1] since the start
  /// [1] messages since the start that the node is done with
  std::uint64_t taken() const {
    return taken_ - (waiting_ ? std::min<std::uint64_t>(taken_, waiting_()) : 0);
  }
  void setWaiting(std::function<std::size_t()> waiting) { waiting_ = std::move(waiting); }

 private:
  std::string topic_, problem_;
  Watchdog watchdog_;
  bool told_ = false, standing_ = false;  // the problem was asked for; the newest message was refused
  double said_ = -1e9;                    // [s] last line for the log
  std::size_t refused_ = 0;
  std::uint64_t taken_ = 0;
  std::function<std::size_t()> waiting_;
};

/// What a node listens to. on() has the signature of RecordingReader's, so that one function can connect
/// either to the class that thinks. A handler that throws leaves one line in the log and in the diagnostics,
/// and the node goes on.
class Inputs {
 public:
  /// @param timeout [s] of ticks without a message after which an input counts as dead
  Inputs(ros::NodeHandle nh, double timeout);

  /// @param Data a core type, converted from its message (a message that contradicts itself counts as
  /// refused), or a message. The handler gets the data and the time of their reception [s].
  template <class Data>
  void on(const std::string& topic, std::function<void(const Data&, double)> handler) {
    using Message = typename MessageOf<Data>::Type;
    InputHealth& health = add(topic);
    const boost::function<void(const Message&)> callback = [this, &health, handler](const Message& message) {
      take(health, [&] {
        if constexpr (std::is_same_v<Message, Data>) {
          handler(message, toSec(ros::Time::now()));
        } else {
          handler(fromMsg(message), toSec(ros::Time::now()));
        }
      });
    };
    subscribers_.push_back(nh_.subscribe<Message>(topic, STREAM_QUEUE, callback, ros::VoidConstPtr(),
                                                  ros::TransportHints().tcpNoDelay()));
  }

  /// Of one topic. @throws std::out_of_range when nobody listens to it.
  Watchdog& watchdog(const std::string& topic);
  /// The first of these that is dead; nullptr: none. @throws std::out_of_range as watchdog().
  const InputHealth* dead(std::initializer_list<const char*> topics);
  /// Of all inputs together. ended() is the end of data: nothing more will come to release what waits.
  Watchdog& any() { return any_; }

  /// @param waiting [1] messages of a topic that the node has put aside; who plays to it waits for them too.
  /// @throws std::out_of_range when nobody listens to it.
  void setWaiting(const std::string& topic, std::function<std::size_t()> waiting) {
    find(topic).setWaiting(std::move(waiting));
  }

  /// From a wall timer of the thread that reads the inputs. @param period [s] of that timer
  void tick(double period);

  /// A player of recorded data says how it stands and asks what was taken. While it asks, its own pauses are
  /// no silence.
  void follow(const smartmill_msgs::Follow::Request& request, smartmill_msgs::Follow::Response& response);

  /// What is silent and what was refused.
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

 private:
  InputHealth& add(const std::string& topic);
  InputHealth& find(const std::string& topic);
  void take(InputHealth& health, const std::function<void()>& handle);

  ros::NodeHandle nh_;
  double timeout_;
  double held_ = 0.0;               // [s] of ticks that are no silence
  std::deque<InputHealth> inputs_;  // their places stay
  Watchdog any_;
  std::deque<ros::Subscriber> subscribers_;
};

}  // namespace smartmill
