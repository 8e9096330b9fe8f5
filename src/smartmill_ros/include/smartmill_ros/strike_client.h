#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <ros/node_handle.h>

namespace smartmill {

/// Requests hammer hits from daq/strike in its own thread, since a service call blocks.
class StrikeClient {
 public:
  struct Answer {
    enum class Kind { failed, no_hammer, no_answer };
    Kind kind;
    std::string message;  ///< one line
  };

  /// @param point where the hammer strikes: tool or force_sensor
  StrikeClient(ros::NodeHandle& nh, std::string point);
  ~StrikeClient();
  StrikeClient(const StrikeClient&) = delete;
  StrikeClient& operator=(const StrikeClient&) = delete;

  void strike(const std::string& direction);

  /// Fault since the last call; a successful hit is detected in the samples of the hammer.
  std::optional<Answer> takeFault();

 private:
  void call(const std::string& direction);

  std::string point_;
  ros::ServiceClient client_;
  std::thread thread_;
  std::mutex mutex_;
  bool calling_ = false;  // guarded by mutex_, as fault_
  std::optional<Answer> fault_;
};

}  // namespace smartmill
