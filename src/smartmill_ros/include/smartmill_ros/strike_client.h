#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <ros/node_handle.h>

namespace smartmill {

/// Asks daq/strike for blows in a thread of its own: a service call blocks, and the streams must go on
/// meanwhile.
class StrikeClient {
 public:
  struct Answer {
    enum class Kind { failed, no_hammer, nobody };
    Kind kind;
    std::string message;  ///< one line
  };

  /// @param point where the hammer strikes: tool or force_sensor
  StrikeClient(ros::NodeHandle& nh, std::string point);
  ~StrikeClient();
  StrikeClient(const StrikeClient&) = delete;
  StrikeClient& operator=(const StrikeClient&) = delete;

  void strike(const std::string& direction);

  /// What went wrong since it was asked for last; a blow that was struck shows in the hammer's samples.
  std::optional<Answer> takeFault();

 private:
  void call(const std::string& direction);

  std::string point_;
  ros::ServiceClient client_;
  std::thread thread_;
  std::mutex mutex_;
  bool calling_ = false;  // guarded, as the next
  std::optional<Answer> fault_;
};

}  // namespace smartmill
