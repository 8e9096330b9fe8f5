#include "node/node.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include <smartmill_msgs/CuttingCoefficients.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/LoadSample.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include "smartmill_core/error.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/model/tool_files.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"
#include "smartmill_ros/steady_time.h"

namespace smartmill::sim {
namespace {

constexpr double BLOCK_TIME = World::BLOCK / World::SAMPLE_RATE;

WorldOptions optionsOf(const NodeParameters& parameters) {
  WorldOptions options = parameters.world;
  options.magazine = readToolModels(parameters.magazine, "magazine");
  return options;
}

NodeParameters read(const ros::NodeHandle& private_nh) {
  NodeParameters parameters = parametersFromServer(private_nh).readAll<NodeParameters>();
  if (parameters.model.empty()) throw Error("model: empty, expected the path of a smartmill-model/1 file");
  if (ros::Time::isSimTime() && !parameters.axes_input.empty())
    throw Error(
        "/use_sim_time: true, expected false with axes_input: an external controller runs in wall time");
  return parameters;
}

}  // namespace

Node::Node(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
    : nh_(std::move(nh)),
      parameters_(read(private_nh)),
      model_(readMachineModel(parameters_.model)),
      world_(std::make_unique<World>(model_, optionsOf(parameters_))),
      hammer_(nh_.advertise<smartmill_msgs::SampleBlock>(names::HAMMER, STREAM_QUEUE)),
      dynamometer_(nh_.advertise<smartmill_msgs::SampleBlock>(names::DYNAMOMETER, STREAM_QUEUE)),
      spindle_force_(nh_.advertise<smartmill_msgs::SampleBlock>(names::SPINDLE_FORCE, STREAM_QUEUE)),
      force_(nh_.advertise<smartmill_msgs::ForceBlock>(names::TRUE_FORCE, STREAM_QUEUE)),
      vibration_(nh_.advertise<smartmill_msgs::SampleBlock>(names::TRUE_VIBRATION, STREAM_QUEUE)),
      servo_(nh_.advertise<smartmill_msgs::SampleBlock>(names::SERVO_RECORD, STREAM_QUEUE)),
      coefficients_(nh_.advertise<smartmill_msgs::CuttingCoefficients>(names::TRUE_COEFFICIENTS, 1, true)),
      frf_(nh_, names::TRUE_FRF),
      modes_(nh_, names::TRUE_MODES),
      clock_(nh_),
      panel_(nh_),
      shell_(nh_, private_nh, "simulated mill", 1.0),
      pacer_(steadyTime(), BLOCK_TIME, static_cast<bool>(clock_), parameters_.pace) {
  if (parameters_.world.microphone)
    sound_ = nh_.advertise<smartmill_msgs::SampleBlock>(names::SOUND, STREAM_QUEUE);
  if (parameters_.world.motor.currents)
    motor_current_ = nh_.advertise<smartmill_msgs::SampleBlock>(names::MOTOR_CURRENT, STREAM_QUEUE);
  if (parameters_.axes_input.empty()) {
    serve();
  } else {
    listen();
  }

  publishTruth();
  panel_.advertiseManualActions(*world_, parameters_.world);
  strike_server_ = nh_.advertiseService(names::STRIKE, &Node::strike, this);
  break_server_ = nh_.advertiseService("sim/break_tooth", &Node::breakTooth, this);
  shell_.diagnose("simulated machine", [this](auto& status) { diagnose(status); });
  thread_ = std::thread([this] { run(); });
}

void Node::serve() {
  focas::ServerOptions options;
  options.port = static_cast<std::uint16_t>(parameters_.port);
  options.bind_address = parameters_.bind;
  server_ = std::make_unique<focas::Server>(options, world_->controller().calls());
  panel_.advertiseKeys(world_->controller());
  if (parameters_.world.pulse_train) {
    tachometer_ = nh_.advertise<smartmill_msgs::SampleBlock>(names::TACHOMETER, STREAM_QUEUE);
  } else {
    angle_ = nh_.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, STREAM_QUEUE);
  }
  ROS_INFO("sim: controller listens on %s:%d", parameters_.bind.c_str(), server_->port());
}

void Node::listen() {
  load_meter_ = nh_.advertise<smartmill_msgs::LoadSample>(names::daq("spindle_load"), STREAM_QUEUE);
  shell_.inputs().on<smartmill_msgs::SampleBlock>(parameters_.axes_input,
                                                  [this](const smartmill_msgs::SampleBlock& block, double) {
                                                    const std::lock_guard<std::mutex> lock(axes_mutex_);
                                                    axes_.push(fromMsg(block));
                                                  });
  ROS_INFO("sim: axes and spindle follow %s", parameters_.axes_input.c_str());
}

Node::~Node() {
  stopping_ = true;
  thread_.join();
}

void Node::addTruth(const std::string& point, const std::string& direction, const ModalModel& modes) {
  MeasuredModes m;
  m.stamp = pacer_.start();
  m.point = point;
  m.direction = direction;
  m.unit = point == POINT_TOOL_TIP ? "m/N" : "1";
  m.model = modes;
  modes_.publish(point + direction, toMsg(m));
  MeasuredFrf f;
  f.stamp = pacer_.start();
  f.point = point;
  f.direction = direction;
  f.frf.unit = m.unit;
  for (double line = parameters_.truth_step; line <= parameters_.truth_end; line += parameters_.truth_step) {
    f.frf.frequency.push_back(line);
    f.frf.value.push_back(modes.response(line));
  }
  frf_.publish(point + direction, toMsg(f));
}

void Node::publishTruth() {
  addTruth(POINT_TOOL_TIP, "x", world_->toolTip().x);
  addTruth(POINT_TOOL_TIP, "y", world_->toolTip().y);
  for (std::size_t axis = 0; axis < 3; ++axis)
    addTruth(POINT_FORCE_SENSOR, std::string(1, "xyz"[axis]), model_.force_sensor.axis[axis]);
  CoefficientSet set;
  set.stamp = pacer_.start();
  set.material = model_.workpiece ? model_.workpiece->material : "";
  set.source = "model";
  set.value = *model_.cutting;
  set.std_dev = NOT_IDENTIFIED;
  set.friction_viscous = model_.spindle->viscous;
  set.friction_coulomb = model_.spindle->coulomb;
  coefficients_.publish(toMsg(set));
}

void Node::publish(const World::Block& block) {
  const auto shifted = [this](auto part) {
    part.stamp += pacer_.start();
    return part;
  };
  hammer_.publish(toMsg(shifted(block.hammer)));
  dynamometer_.publish(toMsg(shifted(block.dynamometer), frames::DYNAMOMETER));
  // The ring in the flange is fixed to the spindle housing.
  if (!block.spindle_force.channels.empty())
    spindle_force_.publish(toMsg(shifted(block.spindle_force), frames::MACHINE));
  if (server_ && parameters_.world.pulse_train) {
    tachometer_.publish(toMsg(shifted(block.tachometer)));
  } else if (server_) {
    for (const SpindleAngle& angle : block.angle) angle_.publish(toMsg(shifted(angle)));
  } else {
    LoadSample load;
    load.stamp = pacer_.start() + block.dynamometer.timeOf(World::BLOCK);
    load.spindle_load = block.spindle_load;
    load.spindle_speed = std::abs(states_.back().spindle_speed);
    load_meter_.publish(toMsg(load));
  }
  force_.publish(toMsg(shifted(block.force), frames::MACHINE));
  vibration_.publish(toMsg(shifted(block.vibration)));
  servo_.publish(toMsg(shifted(block.servo)));
  if (!block.sound.channels.empty()) sound_.publish(toMsg(shifted(block.sound)));
  if (!block.motor_current.channels.empty()) motor_current_.publish(toMsg(shifted(block.motor_current)));
}

void Node::run() {
  World::Block block;
  while (!stopping_) {
    const double wall = steadyTime(), behind = pacer_.behind(wall);
    if (!clock_ && behind > parameters_.most_behind) {
      const auto blocks = static_cast<std::uint64_t>(behind / BLOCK_TIME);
      world_->skipSamples(blocks * World::BLOCK);
      pacer_.proceed(static_cast<double>(blocks));
      lost_ += blocks * World::BLOCK;
      ROS_WARN("sim: the simulation fell behind the clock, %.2f s of samples lost",
               static_cast<double>(blocks) * BLOCK_TIME);
    }
    const double wait = pacer_.wait(wall);
    if (wait > 0.0) {
      std::this_thread::sleep_for(std::chrono::duration<double>(wait));
      continue;
    }
    if (!server_ && !updateStates(pacer_.behind(wall))) {
      std::this_thread::sleep_for(std::chrono::duration<double>(parameters_.poll_period));
      continue;
    }
    const auto before = std::chrono::steady_clock::now();
    if (server_) {
      world_->advance(block);
    } else {
      world_->advance(block, states_);
      logAlarms();
    }
    const std::chrono::duration<double> duration = std::chrono::steady_clock::now() - before;
    load_ = 0.98 * load_ + 0.02 * duration.count() / BLOCK_TIME;
    publish(block);
    pacer_.proceed();
    clock_.publish(pacer_.now());
  }
}

/// States of the next block under the external controller. @return whether they are available
bool Node::updateStates(double behind) {
  const std::lock_guard<std::mutex> lock(axes_mutex_);
  const double end = pacer_.now() + BLOCK_TIME;
  if (!(axes_.newest() >= end)) {
    // No samples: without commands the axes are at rest.
    if (behind < parameters_.wait_share * parameters_.most_behind) return false;
    axes_.holdUntil(end);
  }
  states_.resize(World::BLOCK);
  for (std::size_t i = 0; i < World::BLOCK; ++i) {
    states_[i] = axes_.at(pacer_.now() + (static_cast<double>(i) + 0.5) / World::SAMPLE_RATE);
  }
  return true;
}

/// Under an external controller collisions raise alarms in the machine's own controller, which is idle then.
void Node::logAlarms() {
  std::string text;
  for (const focas::AlarmMessage& alarm : world_->controller().calls().state.alarmMessages())
    text += " " + alarm.text;
  if (text != logged_alarm_ && !text.empty()) ROS_ERROR_STREAM("sim:" << text);
  logged_alarm_ = text;
}

bool Node::strike(smartmill_msgs::Strike::Request& request, smartmill_msgs::Strike::Response& response) {
  switch (world_->strike(request.point, request.direction, response.message)) {
    case World::StrikeAnswer::ok:
      response.code = smartmill_msgs::Strike::Response::OK;
      break;
    case World::StrikeAnswer::by_hand:
      response.code = smartmill_msgs::Strike::Response::NO_HAMMER;
      break;
    case World::StrikeAnswer::failed:
      response.code = smartmill_msgs::Strike::Response::FAILED;
      break;
  }
  return true;
}

bool Node::breakTooth(smartmill_msgs::BreakTooth::Request& request,
                      smartmill_msgs::BreakTooth::Response& response) {
  try {
    constexpr std::uint32_t MOST = 1000000;
    const int tooth = static_cast<int>(std::min(request.tooth, MOST));
    response.stamp = fromSec(pacer_.start() + world_->breakTooth(tooth, request.length));
    response.message = tooth == 0 ? "a new tool" : "tooth " + std::to_string(tooth) + " is broken";
    ROS_INFO_STREAM("sim: " << response.message);
  } catch (const Error& e) {
    response.code = smartmill_msgs::BreakTooth::Response::REFUSED;
    response.message = e.what();
  }
  return true;
}

void Node::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  if (lost_ > 0) {
    status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "samples lost: the computer is too slow");
  } else {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, "running");
  }
  status.addf("processor time per real time [1]", "%.3f", load_.load());
  status.addf("clock held back [s]", "%.3f", pacer_.heldBack());
  status.addf("samples lost [1]", "%llu", static_cast<unsigned long long>(lost_.load()));
}

}  // namespace smartmill::sim

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<sim::Node>(argc, argv, "sim");
}
