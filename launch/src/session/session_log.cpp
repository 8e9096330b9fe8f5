#include "session/session_log.h"

#include <cstdio>

#include <smartmill_msgs/SessionState.h>

#include "smartmill_core/names.h"

namespace smartmill::session {

SessionLog::SessionLog(ros::NodeHandle& nh, const std::string& tool, const std::string& material)
    : state_(nh.advertise<smartmill_msgs::SessionState>(names::SESSION_STATE, 100, true)) {
  summary.tool = tool;
  summary.material = material;
}

void SessionLog::record(const char* mark, const std::string& name, const std::string& detail) {
  const double time = elapsed();
  std::printf("session [%6.1f s] %-4s %s%s%s\n", time, mark, name.c_str(), detail.empty() ? "" : ": ",
              detail.c_str());
  std::fflush(stdout);
  summary.steps.push_back({name, detail, time, std::string(mark) == "ok"});
  using Step = smartmill_msgs::SessionStep;
  outcomes_.push_back(summary.steps.back().done ? Step::DONE : *mark == 's' ? Step::STOPPED : Step::FAILED);
}

void SessionLog::request(const std::string& text) {
  std::printf("session [%6.1f s] todo %s\n", elapsed(), text.c_str());
  std::fflush(stdout);
  publish(text);
}

void SessionLog::publish(const std::string& running, bool ended) {
  constexpr double SENDING = 0.2;  // [s] for the transmission of the last message before the program ends
  smartmill_msgs::SessionState message;
  message.header.stamp = ros::Time::now();
  message.tool = summary.tool;
  message.material = summary.material;
  message.running = !ended;
  message.completed = summary.completed;
  for (std::size_t k = 0; k < summary.steps.size(); ++k) {
    smartmill_msgs::SessionStep step;
    step.name = summary.steps[k].name;
    step.detail = summary.steps[k].detail;
    step.elapsed = summary.steps[k].elapsed;
    step.state = outcomes_[k];
    message.steps.push_back(step);
  }
  if (!running.empty()) {
    smartmill_msgs::SessionStep step;
    step.name = running;
    step.elapsed = elapsed();
    message.steps.push_back(step);
  }
  state_.publish(message);
  if (ended) ros::WallDuration(SENDING).sleep();
}

}  // namespace smartmill::session
