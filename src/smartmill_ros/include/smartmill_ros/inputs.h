#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <smartmill_msgs/Follow.h>
#include <smartmill_msgs/StreamHealth.h>
#include <boost/function.hpp>

#include "smartmill_core/names.h"
#include "smartmill_core/signal/stream_check.h"
#include "smartmill_core/signal/stream_progress.h"
#include "smartmill_core/signal/watchdog.h"
#include "smartmill_ros/conversions.h"

namespace smartmill {

/// Queue size of sampled streams, in publishers and subscribers: 1000 s of blocks, so that a delayed node
/// loses no messages.
constexpr std::uint32_t STREAM_QUEUE = 100000;

/// [s] of stamps by which a silent stream may be behind the others: a sensor, whose fault is to be announced
/// within 0.5 s, and results of a node that may compute for a while.
constexpr double SENSOR_BEHIND = 0.4, RESULT_BEHIND = 2.0;

/// State of one input of a node: time since the last message and last error of its handler.
class InputHealth {
 public:
  InputHealth(std::string topic, double timeout)
      : topic_(std::move(topic)),
        watchdog_(timeout),
        check_(topic_ == names::SERVO_RECORD ? StreamCheck::Source::controller
                                             : StreamCheck::Source::sensor) {}

  /// Calls the handler of a message and catches its exceptions. @param now [s] wall time
  /// @return error for the log; empty: none, or logged recently
  std::string take(double now, const std::function<void()>& handle);
  /// Within a handler: the message is dropped as if it had not come, so that an input of which every message
  /// is dropped is dead.
  void drop() { is_dropped_ = true; }
  /// Counts the messages that were lost between a publisher and this node. roscpp numbers the messages of a
  /// publisher; a publisher that is restarted begins anew. @param number of the header
  void count(const std::string& publisher, std::uint32_t number);
  /// A message of this input cannot be used. @return as take()
  std::string refuse(double now, const std::string& problem);

  const std::string& topic() const { return topic_; }
  const Watchdog& watchdog() const { return watchdog_; }
  Watchdog& watchdog() { return watchdog_; }
  /// Error since the last call, or the present one; empty: none.
  std::string takeProblem();
  std::size_t refused() const { return refused_; }  ///< [1] messages since the start
  /// [1] messages since the start that wait for data of other topics
  std::uint64_t waiting() const { return waiting_ ? std::min<std::uint64_t>(taken_, waiting_()) : 0; }
  /// [1] messages since the start that the node has processed
  std::uint64_t taken() const { return taken_ - waiting(); }
  /// Account since the start. @param topic full name; longest latency since the previous call
  smartmill_msgs::StreamHealth account(const std::string& topic);
  void setWaiting(std::function<std::size_t()> waiting) { waiting_ = std::move(waiting); }

  /// Of sample blocks and spindle angles.
  StreamCheck& streamCheck() { return check_; }
  const StreamCheck& streamCheck() const { return check_; }

  /// @param latency [s] of a message with a stamp
  void noteLatency(double latency) { latency_ = std::max(latency_, latency); }
  /// Number in the comparison of the stamps; set with the first stamp.
  std::optional<StreamProgress::Stream> progress;

 private:
  std::string topic_, problem_;
  Watchdog watchdog_;
  bool reported_ = false;      // the problem, by takeProblem()
  bool last_refused_ = false;  // the last message
  bool is_dropped_ = false;    // the present message
  double logged_ = -1e9;       // [s] time of the last line for the log
  std::size_t refused_ = 0;
  std::uint64_t taken_ = 0, dropped_ = 0, lost_ = 0;
  std::map<std::string, std::uint32_t> numbers_;  // of the last message, by publisher
  std::function<std::size_t()> waiting_;
  StreamCheck check_;
  double latency_ = 0.0;  // [s] longest since the last account
};

/// Subscriptions of a node. on() has the signature of RecordingReader::on(), so that one function can connect
/// an estimator to either. An exception of a handler is logged and reported in the diagnostics; the node
/// continues. Sample blocks and spindle angles pass a StreamCheck, whose findings are logged and reported,
/// too, as is a stream whose stamps fall behind those of the others.
class Inputs {
 public:
  /// @param timeout [s] of ticks without a message after which an input is dead
  Inputs(const ros::NodeHandle& nh, double timeout);

  /// @param Data a core type, converted from its message (an inconsistent message is refused), or a message.
  /// The handler gets the data and the time of their reception [s].
  template <class Data>
  void on(const std::string& topic, std::function<void(const Data&, double)> handler) {
    using Message = typename MessageOf<Data>::Type;
    InputHealth& health = add(topic);
    using Event = ros::MessageEvent<Message const>;
    const boost::function<void(const Event&)> callback = [this, &health, handler](const Event& event) {
      const Message& message = *event.getConstMessage();
      if constexpr (ros::message_traits::HasHeader<Message>::value)
        health.count(event.getPublisherName(), message.header.seq);
      take(health, [&] {
        if constexpr (std::is_same_v<Message, Data>) {
          handler(message, toSec(ros::Time::now()));
        } else {
          Data data = dataOf<Data>(message);
          if (isUsable(health, data)) {
            handler(data, toSec(ros::Time::now()));
          } else {
            health.drop();
          }
        }
      });
    };
    subscribers_.push_back(nh_.subscribe<Message>(topic, STREAM_QUEUE, callback, ros::VoidConstPtr(),
                                                  ros::TransportHints().tcpNoDelay()));
  }

  /// Of one topic. @throws std::out_of_range if it is no input.
  Watchdog& watchdog(const std::string& topic);
  /// The first of these that is dead; nullptr: none. @throws std::out_of_range as watchdog().
  const InputHealth* dead(std::initializer_list<const char*> topics);
  /// Of all inputs together. ended() is the end of data: delayed results are to be released.
  Watchdog& any() { return any_; }

  /// @param waiting [1] received messages of a topic that the node has not processed yet; a player waits for
  /// them.
  /// @throws std::out_of_range if the topic is no input.
  void setWaiting(const std::string& topic, std::function<std::size_t()> waiting) {
    find(topic).setWaiting(std::move(waiting));
  }

  /// To be called by a wall timer in the thread of the inputs. @param period [s] of that timer
  void tick(double period);

  /// Service of a player of recorded data: receives its phase and returns the processed messages. While a
  /// player calls it, pauses of the player are no end of data.
  void follow(const smartmill_msgs::Follow::Request& request, smartmill_msgs::Follow::Response& response);

  /// Of an input of sample blocks. @throws std::out_of_range as watchdog().
  StreamCheck::Unchanged unchanged(const std::string& topic) {
    return find(topic).streamCheck().longestUnchanged();
  }

  /// Accounts of all inputs; the largest latencies since the previous call.
  std::vector<smartmill_msgs::StreamHealth> accounts();

  /// Diagnostics: time since the last message and errors of each input.
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

 private:
  InputHealth& add(const std::string& topic);
  InputHealth& find(const std::string& topic);
  void take(InputHealth& health, const std::function<void()>& handle);

  template <class Data>
  bool isUsable(InputHealth& health, Data& data) {
    if constexpr (std::is_same_v<Data, FramedBlock>) {
      return isUsable(health, data.block);
    } else if constexpr (std::is_same_v<Data, SampleBlock> || std::is_same_v<Data, SpindleAngle>) {
      bool usable = health.streamCheck().check(data);
      logLines(health);
      if constexpr (std::is_same_v<Data, SpindleAngle>) usable = agreesWithController(health, data) && usable;
      noteStamp(health, data.stamp, SENSOR_BEHIND);
      return usable;
    } else if constexpr (std::is_same_v<Data, ForceBlock>) {
      noteStamp(health, data.stamp, RESULT_BEHIND);
    } else if constexpr (std::is_same_v<Data, CncState>) {
      speeds_.setController(data.stamp, data.connected ? data.spindle_speed : NOT_A_NUMBER);
      noteStamp(health, data.stamp, std::numeric_limits<double>::infinity());  // polled, may pause
    }
    return true;
  }
  void logLines(InputHealth& health);
  bool agreesWithController(InputHealth& health, const SpindleAngle& reading);
  /// @param limit [s] beyond which the stream is behind the others
  void noteStamp(InputHealth& health, double stamp, double limit);
  void logBehind();

  ros::NodeHandle nh_;
  double timeout_;
  double hold_ = 0.0;               // [s] remaining ticks without timeouts
  std::deque<InputHealth> inputs_;  // with stable addresses
  Watchdog any_;
  SpeedAgreement speeds_;
  StreamProgress progress_;
  std::deque<ros::Subscriber> subscribers_;
};

}  // namespace smartmill
