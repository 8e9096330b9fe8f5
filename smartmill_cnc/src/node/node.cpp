#include "node/node.h"

#include <geometry_msgs/TransformStamped.h>
#include <netdb.h>
#include <poll.h>
#include <ros/master.h>
#include <ros/network.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/names.h"
#include "smartmill_msgs/CncAlarms.h"
#include "smartmill_msgs/CncState.h"
#include "smartmill_msgs/CuttingCondition.h"
#include "smartmill_msgs/LoadSample.h"
#include "smartmill_msgs/MachineTemperature.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::cnc {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double HOLDER_PERIOD = 1.0;  // [s] between two checks of the client that armed motion

double steadySeconds() {
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

std::shared_ptr<linuxcnc::ServoStream> makeStream(const NodeParameters& parameters) {
  if (parameters.kind != "linuxcnc") return nullptr;
  linuxcnc::ServoStreamOptions options;
  if (!parameters.load_input.empty()) options.load_timeout = parameters.load_timeout;
  return std::make_shared<linuxcnc::ServoStream>(parameters.linuxcnc.folder, options);
}

std::unique_ptr<Controller> makeController(const NodeParameters& parameters,
                                           const std::shared_ptr<linuxcnc::ServoStream>& stream) {
  return stream ? linuxcnc::makeLinuxCncController(parameters.linuxcnc, stream, rosSeconds)
                : makeFocasController(parameters.controller);
}

// Of the shipped file, a missing folder does not stop the node.
MotionLog openMotionLog(const NodeParameters& parameters) {
  try {
    return MotionLog(parameters.motionLogFile());
  } catch (const Error& error) {
    if (parameters.motion_log != "auto") throw;
    ROS_ERROR("no motion log: %s", error.what());
    return MotionLog("");
  }
}

/// Whether a program listens on a port. @return also true when that cannot be found out within half a second
bool listens(const std::string& host, std::uint32_t port) {
  constexpr int LONGEST = 500;  // [ms]
  addrinfo hints{}, *found = nullptr;
  hints.ai_socktype = SOCK_STREAM;
  if (getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found) != 0) return true;
  const int connection = socket(found->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  int error = connect(connection, found->ai_addr, found->ai_addrlen) == 0 ? 0 : errno;
  freeaddrinfo(found);
  pollfd waiting{connection, POLLOUT, 0};
  if (error == EINPROGRESS && poll(&waiting, 1, LONGEST) == 1) {
    socklen_t size = sizeof error;
    getsockopt(connection, SOL_SOCKET, SO_ERROR, &error, &size);
  }
  close(connection);
  return error != ECONNREFUSED;
}

/// Whether a node of the graph has ended: it is not registered any more, or does not listen.
bool hasEnded(const std::string& node) {
  XmlRpc::XmlRpcValue request, response, uri;
  request[0] = ros::this_node::getName();
  request[1] = node;
  if (!ros::master::execute("lookupNode", request, response, uri, false)) return ros::master::check();
  std::string host;
  std::uint32_t port = 0;
  return ros::network::splitURI(static_cast<std::string>(uri), host, port) && !listens(host, port);
}

std::string textOf(const smartmill_msgs::RunProgramGoal& goal) {
  return "program " + goal.name + formatted(", %zu bytes", goal.program.size());
}
std::string textOf(const smartmill_msgs::JogGoal& goal) {
  return formatted("jog %s by %.6g m at %.4g m/s", goal.axis.c_str(), goal.distance, goal.feed);
}
std::string textOf(const smartmill_msgs::OrientSpindleGoal& goal) {
  return formatted("orient the spindle to %.4f rad", goal.angle);
}

/// Why a condition cannot be published; empty: it can.
std::string conditionFault(const smartmill_msgs::CuttingCondition& c) {
  if (c.kind > smartmill_msgs::CuttingCondition::CUT) {
    return "condition.kind " + std::to_string(c.kind) + ": expected NONE, AIR or CUT";
  }
  if (c.kind == smartmill_msgs::CuttingCondition::NONE) {
    return {};
  }
  if (!(c.spindle_speed > 0.0)) {
    return "condition.spindle_speed: expected a speed above 0";
  }
  if (c.kind == smartmill_msgs::CuttingCondition::CUT &&
      !(c.teeth > 0 && c.diameter > 0.0 && c.feed_per_tooth > 0.0 && c.axial_depth > 0.0 &&
        c.exit_angle > c.entry_angle)) {
    return "condition: expected teeth, diameter, feed_per_tooth, axial_depth above 0 and exit_angle above "
           "entry_angle";
  }
  return {};
}

}  // namespace

CncNode::CncNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_(parametersFromServer(private_nh).readAll<NodeParameters>().completed()),
      helpers_(parameters_.helpers()),
      motion_log_(openMotionLog(parameters_)),
      stream_(makeStream(parameters_)),
      bridge_(makeController(parameters_, stream_), parameters_.reconnect_period, parameters_.motion),
      shell_(nh, private_nh, bridge_.controllerName(), 1.0),
      servo_(stream_ ? std::make_unique<ServoPublisher>(nh, shell_, stream_, parameters_.load_input)
                     : nullptr) {
  state_publisher_ = nh.advertise<smartmill_msgs::CncState>(names::CNC_STATE, STREAM_QUEUE);
  alarms_publisher_ = nh.advertise<smartmill_msgs::CncAlarms>(names::CNC_ALARMS, 1, true);
  load_publisher_ = nh.advertise<smartmill_msgs::LoadSample>(names::CNC_LOAD, STREAM_QUEUE);
  if (parameters_.kind == "fanuc" && parameters_.controller.temperature_period > 0.0)
    temperature_publisher_ = nh.advertise<smartmill_msgs::MachineTemperature>(names::MACHINE_TEMPERATURE, 1);
  condition_publisher_ =
      nh.advertise<smartmill_msgs::CuttingCondition>(names::CUTTING_CONDITION, STREAM_QUEUE, true);
  CuttingCondition none;
  none.stamp = ros::Time::now().toSec();
  condition_publisher_.publish(toMsg(none));
  serveActions(nh);
  arm_service_ = nh.advertiseService(names::ARM_MOTION, &CncNode::armMotion, this);
  hold_service_ = nh.advertiseService(names::FEED_HOLD, &CncNode::feedHold, this);
  macro_service_ = nh.advertiseService(names::SET_MACRO, &CncNode::setMacro, this);
  override_service_ = nh.advertiseService(names::SET_OVERRIDES, &CncNode::setOverrides, this);
  shell_.diagnose("controller", [this](auto& status) { diagnose(status); });
  shell_.every(HOLDER_PERIOD, [this] { watchHolder(); });
  thread_ = std::thread([this] { run(); });
}

void CncNode::serveActions(ros::NodeHandle& nh) {
  run_program_ = serve<smartmill_msgs::RunProgramAction>(
      nh, names::RUN_PROGRAM,
      [this](const smartmill_msgs::RunProgramGoal& goal) -> std::optional<Outcome> {
        const std::string fault = conditionFault(goal.condition);
        if (!fault.empty()) {
          return Outcome{MotionCode::bad_goal, "program " + goal.name + ": " + fault};
        }
        try {
          return bridge_.runProgram(goal.name, goal.program, fromMsg(goal.condition));
        } catch (const Error& e) {
          return Outcome{MotionCode::bad_goal, "program " + goal.name + ": " + e.what()};
        }
      },
      [this] {
        smartmill_msgs::RunProgramFeedback feedback;
        const Progress progress = bridge_.progress();
        feedback.bytes_sent = static_cast<std::uint32_t>(progress.bytes_sent);
        feedback.bytes_total = static_cast<std::uint32_t>(progress.bytes_total);
        feedback.stage = progress.stage;
        return feedback;
      });
  jog_ = serve<smartmill_msgs::JogAction>(
      nh, names::JOG,
      [this](const smartmill_msgs::JogGoal& goal) {
        return bridge_.jog(goal.axis, goal.distance, goal.feed);
      },
      [this] {
        smartmill_msgs::JogFeedback feedback;
        feedback.distance_to_go = bridge_.progress().distance_to_go;
        return feedback;
      });
  orient_ = serve<smartmill_msgs::OrientSpindleAction>(
      nh, names::ORIENT_SPINDLE,
      [this](const smartmill_msgs::OrientSpindleGoal& goal) { return bridge_.orient(goal.angle); },
      [this] {
        smartmill_msgs::OrientSpindleFeedback feedback;
        feedback.spindle_speed = bridge_.state().spindle_speed;
        return feedback;
      });
}

CncNode::~CncNode() {
  stopping_ = true;
  thread_.join();
}

void CncNode::run() {
  const auto period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / parameters_.rate));
  // States before the first message of a simulated clock would have the stamp 0.
  while (!stopping_ && !ros::Time::isValid()) ros::WallDuration(0.01).sleep();
  Clock::time_point next = Clock::now();
  for (int count = 0; !stopping_; ++count) {
    std::vector<Job> jobs;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      jobs.swap(jobs_);
    }
    for (const Job& job : jobs) {
      job();
    }
    const double request_time = steadySeconds();
    bridge_.fetch(request_time);
    round_trip_ = std::max(0.999 * round_trip_, steadySeconds() - request_time);
    const ros::Time stamp = ros::Time::now();
    bridge_.step(stamp.toSec());
    publish(stamp);
    publishConditions();
    publishAlarms(stamp);
    if (!bridge_.holder() && !recorded_holder_.empty()) {
      record(recorded_holder_, "motion is disarmed by the controller or the connection");
      recorded_holder_.clear();
    }
    log();
    if (active_ && count % parameters_.feedback_every == 0) {
      active_->feedback();
    }
    if (const std::optional<Outcome> outcome = bridge_.takeOutcome()) {
      if (const std::optional<Active> ended = std::exchange(active_, std::nullopt)) {
        ended->finish(*outcome);
      }
    }
    next = std::max(next + period, Clock::now() - period);
    std::this_thread::sleep_until(next);
  }
  bridge_.shutdown();
  publishConditions();
  log();
}

void CncNode::post(Job job) {
  const std::lock_guard<std::mutex> lock(mutex_);
  jobs_.push_back(std::move(job));
}

template <class Result>
std::optional<Result> CncNode::callInThread(std::function<Result()> call) {
  const auto answer = std::make_shared<std::promise<Result>>();
  std::future<Result> future = answer->get_future();
  post([answer, call] { answer->set_value(call()); });
  if (future.wait_for(std::chrono::duration<double>(parameters_.longest_call)) != std::future_status::ready) {
    return std::nullopt;
  }
  return future.get();
}

template <class Action, class Start, class Feedback>
std::unique_ptr<CncNode::Server<Action>> CncNode::serve(ros::NodeHandle& nh, const std::string& name,
                                                        Start start, Feedback feedback) {
  using Handle = typename Server<Action>::GoalHandle;
  using Result = typename Server<Action>::Result;
  const auto goal = [this, start, feedback](Handle handle) {
    handle.setAccepted();
    post([this, handle, start, feedback]() mutable {
      const std::function<void(const Outcome&)> finish = [handle](const Outcome& outcome) mutable {
        Result result;
        result.code = static_cast<std::uint8_t>(outcome.code);
        result.message = outcome.message;
        if (outcome.code == MotionCode::ok) {
          handle.setSucceeded(result, outcome.message);
        } else if (handle.getGoalStatus().status == actionlib_msgs::GoalStatus::PREEMPTING) {
          handle.setCanceled(result, outcome.message);
        } else {
          handle.setAborted(result, outcome.message);
        }
      };
      const std::string client = clientOfGoal(handle.getGoalID().id), what = textOf(*handle.getGoal());
      const std::string foreign = motionRefusal(bridge_.holder(), client, helpers_);
      const std::optional<Outcome> refusal =
          foreign.empty() ? start(*handle.getGoal()) : Outcome{MotionCode::not_armed, what + ": " + foreign};
      record(client, refusal ? what + " REFUSED: " + refusal->message : what);
      if (refusal) {
        ROS_WARN_STREAM(refusal->message);
        finish(*refusal);
        return;
      }
      active_ = Active{handle.getGoalID().id, finish,
                       [handle, feedback]() mutable { handle.publishFeedback(feedback()); }};
    });
  };
  const auto cancel = [this](Handle handle) {
    const std::string id = handle.getGoalID().id;
    post([this, id] {
      if (active_ && active_->id == id) {
        bridge_.cancel();
      }
    });
  };
  auto server = std::make_unique<Server<Action>>(nh, name, boost::function<void(Handle)>(goal),
                                                 boost::function<void(Handle)>(cancel), false);
  server->start();
  return server;
}

void CncNode::publish(const ros::Time& stamp) {
  const CncState& state = bridge_.state();
  state_publisher_.publish(toMsg(state));
  if (const std::optional<LoadSample>& load = bridge_.load()) {
    load_publisher_.publish(toMsg(*load));
  }
  if (const std::optional<MachineTemperature>& temperature = bridge_.temperature()) {
    temperature_publisher_.publish(toMsg(*temperature));
  }
  // A simulated clock may stand still between two polls.
  if (state.connected && stamp != transform_stamp_) {
    transform_stamp_ = stamp;
    geometry_msgs::TransformStamped transform;
    transform.header.stamp = stamp;
    transform.header.frame_id = frames::MACHINE;
    transform.child_frame_id = frames::SPINDLE;
    transform.transform.rotation.w = 1.0;
    double* const components[] = {&transform.transform.translation.x, &transform.transform.translation.y,
                                  &transform.transform.translation.z};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::optional<std::size_t> axis = controllerAxis(state.axes, k);
      if (axis && *axis < state.position.size()) *components[k] = state.position[*axis];
    }
    broadcaster_.sendTransform(transform);
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  diagnosed_state_ = state;
  diagnosed_holder_ = bridge_.holder();
  diagnosed_connections_ = bridge_.connections();
}

void CncNode::publishConditions() {
  for (const CuttingCondition& condition : bridge_.takeConditions()) {
    condition_publisher_.publish(toMsg(condition));
  }
}

void CncNode::publishAlarms(const ros::Time& stamp) {
  if (published_alarms_ == bridge_.alarms()) {
    return;
  }
  published_alarms_ = bridge_.alarms();
  smartmill_msgs::CncAlarms message;
  message.header.stamp = stamp;
  for (const ControllerAlarm& alarm : *published_alarms_) {
    smartmill_msgs::CncAlarm entry;
    entry.number = alarm.number;
    entry.type = alarm.type;
    entry.axis = alarm.axis;
    entry.text = alarm.text;
    message.alarms.push_back(entry);
  }
  alarms_publisher_.publish(message);
}

void CncNode::log() {
  for (const LogEntry& entry : bridge_.takeLogEntries()) {
    switch (entry.level) {
      case LogEntry::Level::info:
        ROS_INFO_STREAM(entry.text);
        break;
      case LogEntry::Level::warning:
        ROS_WARN_STREAM(entry.text);
        break;
      case LogEntry::Level::error:
        ROS_ERROR_STREAM(entry.text);
        break;
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    diagnosed_line_ = entry.text;
  }
}

bool CncNode::armMotion(ArmEvent& event) {
  const bool on = event.getRequest().arm != 0;
  const std::string stated = event.getRequest().client;
  const std::string client = stated.empty() ? event.getCallerName() : stated;
  const std::string caller =
      client == event.getCallerName() ? "" : " (called by " + event.getCallerName() + ")";
  struct Given {
    Answer<ArmCode> answer;
    std::optional<ArmHolder> holder;
  };
  const auto given = callInThread<Given>([this, on, client, caller] {
    const Answer<ArmCode> answer = bridge_.arm(on, client);
    record(client, (on ? "arm: " : "disarm: ") + answer.message + caller);
    recorded_holder_ = bridge_.holder() ? bridge_.holder()->client : "";
    return Given{answer, bridge_.holder()};
  });
  smartmill_msgs::ArmMotion::Response& response = event.getResponse();
  response.code = static_cast<std::uint8_t>(given ? given->answer.code : ArmCode::not_connected);
  response.message = given ? given->answer.message : "the controller does not answer";
  if (given && given->holder) {
    response.holder = given->holder->client;
    response.since = fromSec(given->holder->since);
  }
  return true;
}

void CncNode::record(const std::string& client, const std::string& what) {
  writeLog([&] { motion_log_.write(ros::Time::now().toSec(), client, what); });
}

void CncNode::writeLog(const std::function<void()>& write) {
  std::string problem;
  try {
    write();
  } catch (const Error& error) {
    problem = std::string("motion log: ") + error.what();
    ROS_ERROR_STREAM_THROTTLE(60.0, problem);
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  log_problem_ = problem;
}

void CncNode::watchHolder() {
  writeLog([this] { motion_log_.writeKept(); });
  std::optional<ArmHolder> holder;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    holder = diagnosed_holder_;
  }
  if (!holder || holder->client.empty() || holder->client[0] != '/' || !hasEnded(holder->client)) return;
  post([this, holder] {
    if (!bridge_.holder() || bridge_.holder()->client != holder->client) return;
    ROS_WARN("motion is disarmed: its client %s has ended", holder->client.c_str());
    bridge_.arm(false);
    record(holder->client, "motion is disarmed: the client has ended");
    recorded_holder_.clear();
  });
}

bool CncNode::feedHold(smartmill_msgs::FeedHold::Request&, smartmill_msgs::FeedHold::Response& response) {
  const auto answer = callInThread<Answer<HoldCode>>([this] { return bridge_.hold(); });
  response.code = static_cast<std::uint8_t>(answer ? answer->code : HoldCode::not_connected);
  response.message = answer ? answer->message : "the controller does not answer";
  return true;
}

bool CncNode::setMacro(smartmill_msgs::SetMacro::Request& request,
                       smartmill_msgs::SetMacro::Response& response) {
  const int number = request.number;
  const double value = request.value;
  const auto answer =
      callInThread<Answer<MacroCode>>([this, number, value] { return bridge_.setMacro(number, value); });
  response.code = static_cast<std::uint8_t>(answer ? answer->code : MacroCode::not_connected);
  response.message = answer ? answer->message : "the controller does not answer";
  return true;
}

bool CncNode::setOverrides(OverrideEvent& event) {
  const smartmill_msgs::SetOverrides::Request& request = event.getRequest();
  smartmill_msgs::SetOverrides::Response& response = event.getResponse();
  const Overrides wanted{request.feed, request.spindle};
  const std::string reason = request.reason, client = event.getCallerName();
  const auto answer = callInThread<OverrideAnswer>([this, wanted, reason, client] {
    const std::string what =
        formatted("overrides feed %.3g, spindle %.3g: %s", wanted.feed, wanted.spindle, reason.c_str());
    OverrideAnswer given;
    if (const std::string foreign = motionRefusal(bridge_.holder(), client, helpers_); !foreign.empty()) {
      given.code = OverrideCode::not_armed;
      given.message = "overrides: " + foreign;
    } else {
      given = bridge_.setOverrides(wanted, reason);
    }
    record(client, given.code == OverrideCode::ok ? what : what + " REFUSED: " + given.message);
    return given;
  });
  response.code = static_cast<std::uint8_t>(answer ? answer->code : OverrideCode::not_connected);
  response.message = answer ? answer->message : "the controller does not answer";
  response.feed = answer ? answer->taken.feed : 1.0;
  response.spindle = answer ? answer->taken.spindle : 1.0;
  return true;
}

void CncNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!diagnosed_state_.connected) {
    status.summary(Level::ERROR, diagnosed_line_.empty() ? "not connected" : diagnosed_line_);
  } else if (diagnosed_state_.emergency || diagnosed_state_.alarm) {
    status.summary(Level::ERROR,
                   diagnosed_state_.emergency ? "emergency stop" : "alarm " + diagnosed_state_.alarm_text);
  } else if (diagnosed_state_.mode != CncMode::dnc) {
    status.summary(Level::WARN, "connected; not in DNC mode, nothing can be moved");
  } else if (!log_problem_.empty()) {
    status.summary(Level::WARN, log_problem_);
  } else {
    status.summary(Level::OK,
                   diagnosed_state_.armed ? "connected, motion armed" : "connected, motion disarmed");
  }
  status.add("mode", static_cast<int>(diagnosed_state_.mode));
  status.add("armed", diagnosed_state_.armed);
  if (diagnosed_holder_)
    status.add("armed by", diagnosed_holder_->client + " since " + utcText(diagnosed_holder_->since));
  status.add("motion log", motion_log_.file());
  status.add("read only", parameters_.motion.read_only);
  status.add("connections made", diagnosed_connections_.made);
  status.add("connections lost", diagnosed_connections_.lost);
  status.add("attempts to connect", diagnosed_connections_.attempts);
  status.addf("longest recent poll [s]", "%.4f", round_trip_.load());
  status.add("alarm", diagnosed_state_.alarm_text);
}

}  // namespace smartmill::cnc

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<cnc::CncNode>(argc, argv, "cnc");
}
