// A topic of sample blocks as a device (docs/daq.md): samples of the simulated machine take the way of a real
// instrument. By TCP, or by a named pipe as rows of numbers or as raw float32 for a player of sound.
//
//   rosrun smartmill_studies daq_forwarder _input:=daq/dynamometer _port:=5045
//   rosrun smartmill_studies daq_forwarder _input:=daq/dynamometer _pipe:=/tmp/forces
//   rosrun smartmill_studies daq_forwarder _input:=daq/dynamometer _pipe:=/tmp/forces _full_scale:=1.0e6
#include <array>
#include <charconv>
#include <condition_variable>
#include <csignal>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

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

/// Serves one connection at a time on the loopback interface; what comes without one is lost, as in a device.
class FrameServer {
 public:
  explicit FrameServer(int port) : listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const int on = 1;
    ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        ::listen(listener_, 1) != 0)
      throw Error("cannot listen on port " + std::to_string(port));
    std::thread([this] { run(); }).detach();  // ends with the process
  }

  void send(std::string bytes) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (connected_) waiting_.push_back(std::move(bytes));
    changed_.notify_one();
  }
  bool connected() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return connected_;
  }

 private:
  void run() {
    while (true) {
      const int socket = ::accept(listener_, nullptr, nullptr);
      if (socket < 0) continue;
      const int on = 1;
      ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
      setConnected(true);
      while (sendNext(socket)) {
      }
      setConnected(false);
      ::close(socket);
    }
  }
  bool sendNext(int socket) {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return !waiting_.empty(); });
    const std::string bytes = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    for (std::size_t at = 0; at < bytes.size();) {
      const ssize_t sent = ::send(socket, bytes.data() + at, bytes.size() - at, MSG_NOSIGNAL);
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

  int listener_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::string> waiting_;
  bool connected_ = false;
};

/// Writes into a named pipe once a reader has opened it; what comes without one is lost, as in a device.
class PipeWriter {
 public:
  explicit PipeWriter(std::string path) : path_(std::move(path)) {
    ::signal(SIGPIPE, SIG_IGN);
    std::thread([this] { run(); }).detach();  // ends with the process
  }
  void send(std::string bytes) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (open_) waiting_.push_back(std::move(bytes));
    changed_.notify_one();
  }

 private:
  void run() {
    while (true) {
      const int pipe = ::open(path_.c_str(), O_WRONLY | O_CLOEXEC);  // waits for a reader
      if (pipe < 0) throw Error(path_ + ": cannot be opened");
      setOpen(true);
      while (writeNext(pipe)) {
      }
      setOpen(false);
      ::close(pipe);
    }
  }
  bool writeNext(int pipe) {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return !waiting_.empty(); });
    const std::string bytes = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    for (std::size_t at = 0; at < bytes.size();) {
      const ssize_t written = ::write(pipe, bytes.data() + at, bytes.size() - at);
      if (written <= 0) return false;
      at += static_cast<std::size_t>(written);
    }
    return true;
  }
  void setOpen(bool open) {
    const std::lock_guard<std::mutex> lock(mutex_);
    open_ = open;
    waiting_.clear();
  }

  std::string path_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::string> waiting_;
  bool open_ = false;
};

/// @param full_scale [unit] of float32 samples; 0: rows of numbers
std::string streamOf(const smartmill_msgs::SampleBlock& message, double full_scale) {
  std::string bytes;
  const std::size_t channels = message.channels.size();
  for (std::size_t i = 0; i < message.samples.size(); ++i) {
    if (full_scale > 0.0) {
      const auto share = static_cast<float>(message.samples[i] / full_scale);
      bytes.append(reinterpret_cast<const char*>(&share), sizeof share);
    } else {
      std::array<char, 32> text;  // NOLINT(cppcoreguidelines-pro-type-member-init): to_chars fills it
      const auto end = std::to_chars(text.data(), text.data() + text.size(), message.samples[i]);
      bytes.append(text.data(), end.ptr).push_back((i + 1) % channels == 0 ? '\n' : ' ');
    }
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
    std::unique_ptr<PipeWriter> writer;
    std::unique_ptr<FrameServer> server;
    if (pipe.empty()) {
      server = std::make_unique<FrameServer>(private_nh.param("port", 5045));
    } else {
      writer = std::make_unique<PipeWriter>(pipe);
    }
    const auto input = nh.subscribe<smartmill_msgs::SampleBlock>(
        private_nh.param<std::string>("input", "daq/dynamometer"), STREAM_QUEUE,
        [&](const smartmill_msgs::SampleBlock::ConstPtr& message) {
          if (writer) {
            writer->send(streamOf(*message, full_scale));
          } else {
            server->send(frameOf(*message));
          }
        });
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL("forwarder: %s", error.what());
    return 1;
  }
  return 0;
}
