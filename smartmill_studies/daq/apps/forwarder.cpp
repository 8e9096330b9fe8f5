// A topic of sample blocks as a device that streams them by TCP (docs/daq.md): samples of the simulated
// machine take the way of a real instrument.
//
//   rosrun smartmill_studies daq_forwarder _input:=daq/dynamometer _port:=5045
#include <condition_variable>
#include <deque>
#include <mutex>
#include <string>
#include <thread>

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
    FrameServer server(private_nh.param("port", 5045));
    const auto input = nh.subscribe<smartmill_msgs::SampleBlock>(
        private_nh.param<std::string>("input", "daq/dynamometer"), STREAM_QUEUE,
        [&server](const smartmill_msgs::SampleBlock::ConstPtr& message) { server.send(frameOf(*message)); });
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL("forwarder: %s", error.what());
    return 1;
  }
  return 0;
}
