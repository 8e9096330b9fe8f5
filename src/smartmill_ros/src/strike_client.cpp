#include "smartmill_ros/strike_client.h"

#include <utility>

#include <smartmill_msgs/Strike.h>

#include "smartmill_core/names.h"

namespace smartmill {

StrikeClient::StrikeClient(ros::NodeHandle& nh, std::string point)
    : point_(std::move(point)), client_(nh.serviceClient<smartmill_msgs::Strike>(names::STRIKE)) {
}

StrikeClient::~StrikeClient() {
  if (thread_.joinable()) thread_.join();
}

void StrikeClient::strike(const std::string& direction) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (calling_) {
      fault_ = Answer{Answer::Kind::failed,
                      std::string(names::STRIKE) + ": the previous call is not answered yet"};
      return;
    }
    calling_ = true;
  }
  if (thread_.joinable()) thread_.join();
  thread_ = std::thread([this, direction] { call(direction); });
}

void StrikeClient::call(const std::string& direction) {
  using Response = smartmill_msgs::Strike::Response;
  smartmill_msgs::Strike strike;
  strike.request.point = point_;
  strike.request.direction = direction;
  const bool answered = client_.call(strike);
  const std::lock_guard<std::mutex> lock(mutex_);
  calling_ = false;
  const std::string service = names::STRIKE;
  if (!answered) {
    fault_ = Answer{Answer::Kind::no_answer, service + ": no answer (is the driver of the sensors running?)"};
  } else if (strike.response.code != Response::OK) {
    const bool no_hammer = strike.response.code == Response::NO_HAMMER;
    fault_ = Answer{no_hammer ? Answer::Kind::no_hammer : Answer::Kind::failed,
                    service + ": " + strike.response.message};
  }
}

std::optional<StrikeClient::Answer> StrikeClient::takeFault() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(fault_, std::nullopt);
}

}  // namespace smartmill
