#include "hammer_server.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <smartmill_msgs/Strike.h>
#include <boost/bind/bind.hpp>
#include <boost/function.hpp>

#include "parameters_ros.h"
#include "smartmill_core/error.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/goals.h"
#include "smartmill_ros/parameter_reader.h"

namespace smartmill {
namespace hammer {
namespace {

constexpr double NEVER = -std::numeric_limits<double>::infinity();
/// A stamp this much older than the newest: a bag was restarted.
constexpr double RESTART_STEP = 1.0;  // [s]
/// Wall time without any input after which a replay counts as ended.
constexpr double END_OF_DATA = 0.5;  // [s]

}  // namespace

HammerServer::HammerServer(ros::NodeHandle nh, const ros::NodeHandle& private_nh) : nh_(std::move(nh)) {
  ParameterReader reader = ParameterReader::fromServer(private_nh);
  HammerParameters parameters;
  readParameters(reader, parameters, node_parameters_);
  reader.require("model", node_parameters_.model);
  reader.read("command_machine", node_parameters_.command_machine);
  reader.finish();
  sequence_ = std::make_unique<HammerSequence>(parameters, readMachineModel(node_parameters_.model));
  sorter_ = std::make_unique<StreamSorter>(node_parameters_.hold_back);
  events_ = sorter_->addEvents("hammer/measure_frf");
  const auto input = [this](const char* name) {
    return Input{name, sorter_->addRegular(name), NEVER, ros::WallTime::now()};
  };
  hammer_ = input("daq/hammer");
  state_ = input("cnc/state");
  angle_ = input("spindle/angle");

  // Not in a replay: an action client's constructor waits for the clock, and rosbag play waits for this
  // node's subscribers before it publishes one.
  if (node_parameters_.command_machine) {
    jog_ = std::make_unique<JogClient>(nh_, "cnc/jog", false);
    orient_ = std::make_unique<OrientClient>(nh_, "cnc/orient_spindle", false);
    program_ = std::make_unique<ProgramClient>(nh_, "cnc/run_program", false);
    strike_client_ = nh_.serviceClient<smartmill_msgs::Strike>("daq/strike");
  }

  // Late subscribers get every direction; a latched topic would keep the last message only.
  frf_publisher_ = nh_.advertise<smartmill_msgs::Frf>(
      "tool/frf", 10, ros::SubscriberStatusCallback([this](const ros::SingleSubscriberPublisher& to) {
        for (const auto& entry : known_) to.publish(entry.second.first);
      }));
  modes_publisher_ = nh_.advertise<smartmill_msgs::ModalModel>(
      "tool/modes", 10, ros::SubscriberStatusCallback([this](const ros::SingleSubscriberPublisher& to) {
        for (const auto& entry : known_) to.publish(entry.second.second);
      }));

  const auto subscribe = [this](auto example, Input& in, std::uint32_t queue) {
    using Message = decltype(example);
    boost::function<void(const boost::shared_ptr<const Message>&)> callback =
        [this, &in](const boost::shared_ptr<const Message>& m) {
          try {
            take(in, toSec(m->header.stamp), [this, input = fromMsg(*m)] {
              sequence_->handle(input);
              drain();
            });
          } catch (const Error& error) {
            ROS_ERROR_THROTTLE(1.0, "hammer: %s: %s", in.name.c_str(), error.what());
          }
        };
    subscribers_.push_back(nh_.subscribe<Message>(in.name, queue, callback));
  };
  subscribe(smartmill_msgs::SampleBlock(), hammer_, 1000);
  subscribe(smartmill_msgs::CncState(), state_, 1000);
  subscribe(smartmill_msgs::SpindleAngle(), angle_, 2000);

  server_ = std::make_unique<Server>(
      nh_, "hammer/measure_frf", boost::bind(&HammerServer::onGoal, this, boost::placeholders::_1),
      boost::bind(&HammerServer::onCancel, this, boost::placeholders::_1), false);
  updater_ = std::make_unique<diagnostic_updater::Updater>(nh_, private_nh);
  updater_->setHardwareID("hammer");
  updater_->add("automatic hammer", this, &HammerServer::diagnose);
  watch_timer_ =
      nh_.createWallTimer(ros::WallDuration(0.01), [this](const ros::WallTimerEvent&) { watch(); });
  diagnostics_timer_ = nh_.createWallTimer(ros::WallDuration(1.0),
                                           [this](const ros::WallTimerEvent&) { updater_->force_update(); });
  server_->start();
}

HammerServer::~HammerServer() {
  if (strike_thread_.joinable()) strike_thread_.join();
}

double HammerServer::newest() const {
  return std::max({hammer_.newest, state_.newest, angle_.newest});
}

void HammerServer::take(Input& input, double stamp, const StreamSorter::Deliver& deliver) {
  if (stamp < input.newest - RESTART_STEP) restart();
  input.newest = std::max(input.newest, stamp);
  input.heard = ros::WallTime::now();
  sorter_->push(input.stream, stamp, deliver);
}

void HammerServer::event(const StreamSorter::Deliver& deliver) {
  const double stamp = newest();
  if (std::isfinite(stamp)) {
    sorter_->push(events_, stamp, deliver);
  } else {
    deliver();
  }
}

void HammerServer::restart() {
  ROS_WARN("hammer: time went back, starting afresh");
  sorter_->reset();
  sequence_->reset();
  commands_.clear();
  known_.clear();
  for (Input* input : {&hammer_, &state_, &angle_}) input->newest = NEVER;
  smartmill_msgs::MeasureFrfResult result;
  result.code = smartmill_msgs::MeasureFrfResult::CANCELLED;
  result.message = "time went back: the bag was restarted";
  if (active_goal_) active_goal_->setAborted(result, result.message);
  active_goal_.reset();
  for (const auto& pending : waiting_goals_) {
    if (!pending->answered) pending->handle.setRejected(result, result.message);
    pending->answered = true;
  }
  waiting_goals_.clear();
}

// ---------------------------------------------------------------------------------------------- goals

void HammerServer::onGoal(Server::GoalHandle handle) {
  const MeasureFrfGoal goal = goalFromMsg(*handle.getGoal(), toSec(ros::Time::now()));
  auto pending = std::make_shared<PendingGoal>();
  pending->handle = handle;
  pending->since = ros::WallTime::now();
  waiting_goals_.push_back(pending);
  sorter_->push(events_, goal.stamp, [this, pending, goal] { startGoal(pending, goal); });
}

void HammerServer::startGoal(const std::shared_ptr<PendingGoal>& pending, const MeasureFrfGoal& goal) {
  waiting_goals_.erase(std::remove(waiting_goals_.begin(), waiting_goals_.end(), pending),
                       waiting_goals_.end());
  if (pending->answered) return;
  pending->answered = true;
  smartmill_msgs::MeasureFrfResult refused;
  if (pending->handle.getGoalStatus().status == actionlib_msgs::GoalStatus::RECALLING) {
    refused.code = smartmill_msgs::MeasureFrfResult::CANCELLED;
    refused.message = "cancelled before it began";
    return pending->handle.setCanceled(refused, refused.message);
  }
  if (sequence_->active()) {
    refused.code = smartmill_msgs::MeasureFrfResult::BAD_GOAL;
    refused.message = "another measurement is running";
    return pending->handle.setRejected(refused, refused.message);
  }
  pending->handle.setAccepted();
  active_goal_ = pending->handle;
  sequence_->handle(goal);
  drain();
}

void HammerServer::onCancel(Server::GoalHandle handle) {
  event([this, handle] {
    if (active_goal_ && *active_goal_ == handle) sequence_->cancel(newest());
    drain();
  });
}

// ---------------------------------------------------------------------------------------------- results

void HammerServer::drain() {
  for (const Command& command : sequence_->takeCommands()) execute(command);
  if (const auto feedback = sequence_->takeFeedback()) {
    ROS_INFO("hammer: %s", feedback->stage.c_str());
    if (active_goal_) {
      smartmill_msgs::MeasureFrfFeedback message;
      message.stage = feedback->stage;
      message.progress = feedback->progress;
      message.hits_done = static_cast<std::uint32_t>(feedback->hits_done);
      active_goal_->publishFeedback(message);
    }
  }
  if (const auto result = sequence_->takeResult()) finish(*result);
}

void HammerServer::finish(const MeasureFrfResult& result) {
  smartmill_msgs::MeasureFrfResult message;
  message.code = static_cast<std::uint8_t>(result.code);
  message.message = result.message;
  message.sensitivity = result.sensitivity;
  last_message_ = result.message;
  if (result.frf.frf.size() > 0) message.frf = toMsg(result.frf);
  if (!result.modes.model.modes.empty()) message.modes = toMsg(result.modes);
  if (result.code == FrfCode::ok) {
    ROS_INFO("hammer: done: %s", result.message.c_str());
    known_[result.frf.direction] = {message.frf, message.modes};
    frf_publisher_.publish(message.frf);
    modes_publisher_.publish(message.modes);
  } else {
    ROS_ERROR("hammer: %s", result.message.c_str());
  }
  if (!active_goal_) return;
  if (result.code == FrfCode::ok) {
    active_goal_->setSucceeded(message, result.message);
  } else if (result.code == FrfCode::cancelled) {
    active_goal_->setCanceled(message, result.message);
  } else {
    active_goal_->setAborted(message, result.message);
  }
  active_goal_.reset();
}

// ---------------------------------------------------------------------------------------------- commands

void HammerServer::execute(const Command& command) {
  if (!node_parameters_.command_machine) return;
  switch (command.kind) {
    case Command::Kind::strike:
      return strike(command.direction);
    case Command::Kind::stop:
      commands_.clear();
      if (busy_with_.empty()) return;
      stopping_ = true;
      if (busy_with_ == "cnc/jog") jog_->cancelGoal();
      if (busy_with_ == "cnc/orient_spindle") orient_->cancelGoal();
      if (busy_with_ == "cnc/run_program") program_->cancelGoal();
      return;
    default:
      commands_.push_back(command);
      return pump();
  }
}

template <class Result, class Client, class Goal>
void HammerServer::sendGoal(Client& client, const char* name, const Goal& goal) {
  if (!client.isServerConnected())
    return failed(std::string(name) + ": no server (is the CNC bridge running?)");
  busy_with_ = name;
  client.sendGoal(goal, [this, name = std::string(name)](const actionlib::SimpleClientGoalState& state,
                                                         const boost::shared_ptr<const Result>& result) {
    const bool good = state == actionlib::SimpleClientGoalState::SUCCEEDED && result && result->code == 0;
    motionDone(name, good, result && !result->message.empty() ? result->message : state.toString());
  });
}

// One motion at a time: the streams may show a motion done before its action says so.
void HammerServer::pump() {
  if (!busy_with_.empty() || commands_.empty()) return;
  const Command command = std::move(commands_.front());
  commands_.pop_front();
  stopping_ = false;
  if (command.kind == Command::Kind::orient) {
    smartmill_msgs::OrientSpindleGoal goal;
    goal.angle = command.angle;
    sendGoal<smartmill_msgs::OrientSpindleResult>(*orient_, "cnc/orient_spindle", goal);
  } else if (command.kind == Command::Kind::jog) {
    smartmill_msgs::JogGoal goal;
    goal.axis = command.axis;
    goal.distance = command.distance;
    goal.feed = command.feed;
    sendGoal<smartmill_msgs::JogResult>(*jog_, "cnc/jog", goal);
  } else {
    smartmill_msgs::RunProgramGoal goal;
    goal.header.stamp = fromSec(command.stamp);
    goal.name = "hammer station";
    goal.program = moveProgram(command.from, command.path);
    goal.condition.kind = smartmill_msgs::CuttingCondition::NONE;
    sendGoal<smartmill_msgs::RunProgramResult>(*program_, "cnc/run_program", goal);
  }
}

void HammerServer::motionDone(const std::string& name, bool good, const std::string& message) {
  busy_with_.clear();  // the next command goes out from the timer: not from inside the client's own callback
  if (!good && !stopping_) failed(name + ": " + message);
  stopping_ = false;
}

void HammerServer::failed(const std::string& text) {
  event([this, text] {
    sequence_->commandFailed(newest(), text);
    drain();
  });
}

void HammerServer::strike(const std::string& direction) {
  {
    const std::lock_guard<std::mutex> lock(strike_mutex_);
    if (strike_running_) return failed("daq/strike: the last call has not been answered");
    strike_running_ = true;
  }
  if (strike_thread_.joinable()) strike_thread_.join();
  // A service call blocks; the streams must go on meanwhile.
  strike_thread_ = std::thread([this, direction] {
    smartmill_msgs::Strike call;
    call.request.point = "tool";
    call.request.direction = direction;
    std::string fault;
    if (!strike_client_.call(call)) {
      fault = "daq/strike: no answer (is the driver of the sensors running?)";
    } else if (call.response.code != smartmill_msgs::Strike::Response::OK) {
      fault = "daq/strike: " + call.response.message;
    }
    const std::lock_guard<std::mutex> lock(strike_mutex_);
    strike_fault_ = fault;
    strike_running_ = false;
  });
}

// ---------------------------------------------------------------------------------------------- liveness

void HammerServer::watch() {
  std::string fault;
  {
    const std::lock_guard<std::mutex> lock(strike_mutex_);
    fault.swap(strike_fault_);
  }
  if (!fault.empty()) failed(fault);
  pump();
  const ros::WallTime now = ros::WallTime::now();
  if (!node_parameters_.command_machine) {
    const ros::WallTime last = std::max({hammer_.heard, state_.heard, angle_.heard});
    if ((now - last).toSec() > END_OF_DATA) sorter_->flush();
    return;
  }
  for (const Input* input : {&hammer_, &state_, &angle_}) {
    const double silent = (now - input->heard).toSec();
    if (silent < node_parameters_.stale_timeout) continue;
    char text[120];
    std::snprintf(text, sizeof text, "%s is silent for %.1f s", input->name.c_str(), silent);
    if (sequence_->active()) {
      sequence_->lost(newest(), text);
      drain();
    }
    // Goals that wait for a dead stream would wait for ever.
    for (const auto& pending : waiting_goals_) {
      if ((now - pending->since).toSec() < node_parameters_.stale_timeout || pending->answered) continue;
      smartmill_msgs::MeasureFrfResult result;
      result.code = smartmill_msgs::MeasureFrfResult::BAD_DATA;
      result.message = text;
      pending->handle.setRejected(result, result.message);
      pending->answered = true;
    }
  }
}

void HammerServer::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  status.summary(diagnostic_msgs::DiagnosticStatus::OK, sequence_->active() ? "measuring" : "ready");
  const ros::WallTime now = ros::WallTime::now();
  for (const Input* input : {&hammer_, &state_, &angle_}) {
    const double silent = (now - input->heard).toSec();
    status.addf(input->name, "%.2f s since the last message", silent);
    if (silent > node_parameters_.stale_timeout) {
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, input->name + " is silent");
    }
  }
  status.add("late messages", sorter_->late());
  status.add("last measurement", last_message_);
}

}  // namespace hammer
}  // namespace smartmill
