// A topic of sample blocks as a device (docs/daq.md): samples of the simulated machine take the way of a real
// instrument. By TCP, or by a named pipe as rows of numbers or as raw float32 for a player of sound. Several
// topics with the same running index become the channels of one device, in the order of the topics (pipe
// only).
//
//   rosrun smartmill_studies daq_forwarder _input:=daq/dynamometer _port:=5045
//   rosrun smartmill_studies daq_forwarder _input:=daq/dynamometer _pipe:=/tmp/forces
//   rosrun smartmill_studies daq_forwarder _input:="daq/dynamometer daq/hammer" _pipe:=/tmp/front_end
//   _full_scale:=1.0e6
#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <deque>
#include <functional>
#include <iterator>
#include <mutex>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <ros/ros.h>
#include <smartmill_msgs/SampleBlock.h>
#include <sys/socket.h>
#include <unistd.h>

#include "smartmill_core/error.h"
#include "smartmill_daq/drivers/frame.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/inputs.h"

namespace {

using namespace smartmill;

/// Writes to one reader at a time; what comes without one is lost, as in a device.
class StreamWriter {
 public:
  /// @param open waits for a reader and returns its descriptor
  explicit StreamWriter(std::function<int()> open) : open_(std::move(open)) {
    std::signal(SIGPIPE, SIG_IGN);
    std::thread([this] { run(); }).detach();  // ends with the process
  }

  void send(std::string bytes) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (connected_) waiting_.push_back(std::move(bytes));
    changed_.notify_one();
  }

 private:
  void run() {
    while (true) {
      const int reader = open_();
      if (reader < 0) {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        continue;
      }
      setConnected(true);
      while (sendNext(reader)) {
      }
      setConnected(false);
      ::close(reader);
    }
  }
  bool sendNext(int reader) {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return !waiting_.empty(); });
    const std::string bytes = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    for (std::size_t at = 0; at < bytes.size();) {
      const ssize_t sent = ::write(reader, bytes.data() + at, bytes.size() - at);
      if (sent <= 0) return false;
      at += static_cast<std::size_t>(sent);
    }
    return true;
  }
  void setConnected(bool connected) {
    const std::lock_guard<std::mutex> lock(mutex_);
    connected_ = connected;
    waiting_.clear();
  }

  std::function<int()> open_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::string> waiting_;
  bool connected_ = false;
};

/// A server on the loopback interface.
std::function<int()> connectionsOf(int port) {
  const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const int on = 1;
  ::setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (::bind(listener, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(listener, 1) != 0)
    throw Error("cannot listen on port " + std::to_string(port));
  return [listener] {
    const int socket = ::accept(listener, nullptr, nullptr);
    const int at_once = 1;
    ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &at_once, sizeof at_once);
    return socket;
  };
}

std::function<int()> readersOf(const std::string& pipe) {
  return [pipe] { return ::open(pipe.c_str(), O_WRONLY | O_CLOEXEC); };
}

/// Rows of topics whose samples have the same running index. What one of them has lost is left out.
class RowJoiner {
 public:
  explicit RowJoiner(std::size_t topics) : waiting_(topics) {}

  /// @return the rows that are complete with this block
  std::vector<std::vector<double>> add(std::size_t topic, const smartmill_msgs::SampleBlock& message) {
    const std::size_t channels = message.channels.size();
    for (std::size_t i = 0; (i + 1) * channels <= message.samples.size(); ++i) {
      const auto row = message.samples.begin() + static_cast<std::ptrdiff_t>(i * channels);
      waiting_[topic].push_back(Row{message.first_index + i,
                                    std::vector<double>(row, row + static_cast<std::ptrdiff_t>(channels))});
    }
    std::vector<std::vector<double>> rows;
    while (std::none_of(waiting_.begin(), waiting_.end(), [](const auto& queue) { return queue.empty(); })) {
      std::uint64_t newest = 0;
      for (const auto& queue : waiting_) newest = std::max(newest, queue.front().index);
      bool same = true;
      for (auto& queue : waiting_) {
        if (queue.front().index == newest) continue;
        queue.pop_front();
        same = false;
      }
      if (!same) continue;
      rows.emplace_back();
      for (auto& queue : waiting_) {
        rows.back().insert(rows.back().end(), queue.front().values.begin(), queue.front().values.end());
        queue.pop_front();
      }
    }
    return rows;
  }

 private:
  struct Row {
    std::uint64_t index;
    std::vector<double> values;
  };
  std::vector<std::deque<Row>> waiting_;
};

/// @param full_scale [unit] of float32 samples; 0: rows of numbers
std::string streamOf(const std::vector<std::vector<double>>& rows, double full_scale) {
  std::string bytes;
  for (const std::vector<double>& row : rows) {
    for (const double value : row) {
      if (full_scale > 0.0) {
        const auto share = static_cast<float>(value / full_scale);
        bytes.append(reinterpret_cast<const char*>(&share), sizeof share);
      } else {
        std::array<char, 32> text;  // NOLINT(cppcoreguidelines-pro-type-member-init): to_chars fills it
        const auto end = std::to_chars(text.data(), text.data() + text.size(), value);
        bytes.append(text.data(), end.ptr).push_back(' ');
      }
    }
    if (full_scale <= 0.0) bytes.back() = '\n';
  }
  return bytes;
}

std::string frameOf(const smartmill_msgs::SampleBlock& message) {
  daq::Frame frame;
  frame.format = daq::SampleFormat::float64;
  frame.channels = message.channels.size();
  frame.first_index = message.first_index;
  frame.time = static_cast<std::int64_t>(message.header.stamp.toNSec());
  frame.sample_rate = message.sample_rate;
  frame.values = message.samples;
  return daq::encode(frame);
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "forwarder");
  ros::NodeHandle nh, private_nh("~");
  try {
    const auto pipe = private_nh.param<std::string>("pipe", "");
    const double full_scale = private_nh.param("full_scale", 0.0);
    StreamWriter writer(pipe.empty() ? connectionsOf(private_nh.param("port", 5045)) : readersOf(pipe));
    std::istringstream names(private_nh.param<std::string>("input", "daq/dynamometer"));
    const std::vector<std::string> topics(std::istream_iterator<std::string>(names), {});
    if (topics.empty() || (pipe.empty() && topics.size() > 1))
      throw Error("input: " + std::to_string(topics.size()) + " topics, expected one (several with a pipe)");
    RowJoiner joiner(topics.size());
    std::vector<ros::Subscriber> inputs;
    for (std::size_t topic = 0; topic < topics.size(); ++topic) {
      const boost::function<void(const smartmill_msgs::SampleBlock::ConstPtr&)> forward =
          [&, topic](const smartmill_msgs::SampleBlock::ConstPtr& message) {
            writer.send(pipe.empty() ? frameOf(*message) : streamOf(joiner.add(topic, *message), full_scale));
          };
      inputs.push_back(nh.subscribe<smartmill_msgs::SampleBlock>(topics[topic], STREAM_QUEUE, forward));
    }
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL("forwarder: %s", error.what());
    return 1;
  }
  return 0;
}
