#include "node/node.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>
#include <utility>
#include <vector>

#include <ros/this_node.h>
#include <smartmill_msgs/ProgramPath.h>
#include <smartmill_msgs/ProgramProgress.h>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/is_ready.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/feed.h"
#include "smartmill_core/units.h"
#include "smartmill_program/nc/linuxcnc_program.h"
#include "smartmill_program/nc/program_reader.h"
#include "smartmill_program/stock/triangle_mesh.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::program {
namespace {

using units::MM;

constexpr double PREDICTION_PERIOD = 0.1;  // [s] between two looks for predictions

std::vector<std::string> wordsOf(const std::string& text) {
  std::istringstream words(text);
  return {std::istream_iterator<std::string>(words), {}};
}

/// Workpiece of the first model that states one.
const Workpiece& workpieceOf(const ToolModels& models, const std::string& key) {
  for (const auto& [number, model] : models.models())
    if (model.workpiece) return *model.workpiece;
  throw Error(key + ": not stated, expected a value here or a model with a workpiece");
}

StockShape stockOf(const NodeParameters& parameters, const ToolModels& models) {
  if (!parameters.stock_file.empty())
    return StockShape::mesh(std::make_shared<TriangleMesh>(readStl(parameters.stock_file, units::MM)));
  const std::array<double, 3>& size = parameters.stock_size;
  const bool own = std::any_of(size.begin(), size.end(), [](double s) { return s > 0.0; });
  if (!own) return stockBlock(workpieceOf(models, "stock_size"), parameters.program_zero);
  StockBlock block;
  for (std::size_t a = 0; a < 3; ++a) {
    block.low[a] = parameters.stock_corner[a];
    block.high[a] = block.low[a] + size[a];
  }
  return block;
}

smartmill_msgs::ProgramPath pathOf(const LiveProgram& program,
                                   const std::vector<PiecePrediction>& predictions,
                                   const std::array<double, 3>& zero) {
  smartmill_msgs::ProgramPath message;
  message.header.stamp = ros::Time::now();
  message.program = program.name;
  const auto add = [&](double place, const nc::PathSegment::Point& point) {
    message.place.push_back(place);
    message.x.push_back(point[0] + zero[0]);
    message.y.push_back(point[1] + zero[1]);
    message.z.push_back(point[2] + zero[2]);
  };
  if (!program.pieces.empty()) add(program.pieces.front().from, program.pieces.front().begin);
  for (std::size_t k = 0; k < program.pieces.size(); ++k) {
    const PathPiece& piece = program.pieces[k];
    add(piece.to, piece.end);
    message.line.push_back(static_cast<std::uint32_t>(piece.line));
    message.kind.push_back(static_cast<std::uint8_t>(piece.kind));
    message.peak_force.push_back(predictions[k].peak_force);
    message.stability_margin.push_back(predictions[k].margin);
  }
  return message;
}

}  // namespace

ProgramNode::Prepared ProgramNode::prepare(const NodeParameters& parameters) {
  if (parameters.program.empty()) throw Error("program: expected the path of an NC program");
  if (parameters.models.empty()) throw Error("models: expected the path of a smartmill-model/1 file");
  ToolModels models(wordsOf(parameters.models));
  ReaderOptions reader;
  reader.tool_radius = [&models](int tool) { return models.radius(tool); };
  std::vector<Move> moves =
      parameters.linuxcnc ? interpretWithLinuxcnc(readText(parameters.program), parameters.program, reader)
                          : readProgram(parameters.program, reader);
  for (const Move& move : moves) models.of(move.tool);
  Stock stock(stockOf(parameters, models), parameters.resolution);
  SimulationOptions simulation;
  simulation.step_share = parameters.step_share;
  simulation.rapid = models.rapid();
  const auto program = std::make_shared<const LiveProgram>(
      prepareProgram(parameters.program, std::move(moves), models, stock, simulation, parameters.stretches));
  const ConditionNames names{parameters.tool, parameters.material.empty()
                                                  ? workpieceOf(models, "material").material
                                                  : parameters.material};
  const auto cuts = std::count_if(program->stretches.begin(), program->stretches.end(),
                                  [](const SteadyStretch& stretch) { return stretch.cut; });
  ROS_INFO("%s: %zu moves, %td steady cuts, %td stretches in air", parameters.program.c_str(),
           program->path.moves().size(), cuts, static_cast<std::ptrdiff_t>(program->stretches.size()) - cuts);
  if (cuts == 0)
    ROS_WARN("%s: no cut is steady for %.3g s (least_time)", parameters.program.c_str(),
             parameters.stretches.least_time);
  return {program, std::move(models), names};
}

ProgramNode::ProgramNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
    : parameters_(parametersFromServer(private_nh).readAll<NodeParameters>()),
      prepared_(prepare(parameters_)),
      follower_(prepared_.program, parameters_.program_zero, prepared_.names, parameters_.follower),
      shell_(nh, private_nh, "NC program", parameters_.input_timeout),
      monitor_(prepared_.program, parameters_.progress_period, parameters_.hold_back,
               [this](const PartProgress& progress) { publish(progress); }),
      publisher_(
          nh.advertise<smartmill_msgs::CuttingCondition>(names::CUTTING_CONDITION, STREAM_QUEUE, true)),
      path_(nh.advertise<smartmill_msgs::ProgramPath>(names::PROGRAM_PATH, 1, true)),
      progress_(nh.advertise<smartmill_msgs::ProgramProgress>(names::PROGRAM_PROGRESS, STREAM_QUEUE)) {
  conditions_ = nh.subscribe<smartmill_msgs::CuttingCondition>(
      names::CUTTING_CONDITION, STREAM_QUEUE,
      boost::function<void(const ConditionEvent&)>([this](const ConditionEvent& event) { handle(event); }));
  listen();
  shell_.diagnose("NC program", [this](auto& status) { diagnose(status); });
  shell_.every(PREDICTION_PERIOD, [this] { readPredictions(); });
  predict(std::nullopt);
}

void ProgramNode::listen() {
  Inputs& inputs = shell_.inputs();
  inputs.on<CncState>(names::CNC_STATE, [this](const CncState& state, double) { handle(state); });
  feed<ForceBlock>(inputs, names::FORCE_COMPENSATED, monitor_);
  inputs.on<smartmill_msgs::ChatterState>(
      names::CHATTER_STATE, [this](const smartmill_msgs::ChatterState& message, double) {
        if (message.valid)
          monitor_.push(PartVerdict{toSec(message.header.stamp), message.chatter != 0, message.frequency});
      });
  inputs.on<CoefficientSet>(names::COEFFICIENTS, [this](const CoefficientSet& set, double) { handle(set); });
}

/// The first set of the pair that the program cuts, where the models state none.
void ProgramNode::handle(const CoefficientSet& set) {
  CuttingCoefficients k = set.value;
  if (!predicted_for_.empty() || set.material != prepared_.names.material || !std::isfinite(k.ktc + k.kte))
    return;
  if (predictions_.valid()) {
    early_ = set;
    return;
  }
  if (!std::isfinite(k.krc)) k.krc = parameters_.radial_ratio * k.ktc;
  if (!std::isfinite(k.kre)) k.kre = k.kte;
  for (double* axial : {&k.kac, &k.kae}) {  // no part of the force across the axis
    if (!std::isfinite(*axial)) *axial = 0.0;
  }
  predicted_for_ = set.tool + " in " + set.material;
  predict(k);
}

/// In a thread: stability limits take seconds.
void ProgramNode::predict(const std::optional<CuttingCoefficients>& coefficients) {
  predictions_ = std::async(std::launch::async,
                            [program = prepared_.program, models = prepared_.models, coefficients]() {
                              return predictPieces(program->pieces, models, coefficients);
                            });
}

void ProgramNode::readPredictions() {
  if (!isReady(predictions_)) return;
  std::vector<PiecePrediction> predictions = predictions_.get();
  const auto predicted =
      std::count_if(predictions.begin(), predictions.end(),
                    [](const PiecePrediction& one) { return std::isfinite(one.peak_force); });
  if (predicted > 0 && predicted_for_.empty()) predicted_for_ = "models";
  path_.publish(pathOf(*prepared_.program, predictions, parameters_.program_zero));
  monitor_.setPredictions(std::move(predictions));
  if (const std::optional<CoefficientSet> set = std::exchange(early_, std::nullopt)) handle(*set);
}

void ProgramNode::publish(const PartProgress& progress) {
  smartmill_msgs::ProgramProgress message;
  message.header.stamp = fromSec(progress.stamp);
  message.begin = fromSec(progress.begin);
  message.program = prepared_.program->name;
  message.part = static_cast<std::uint32_t>(progress.part);
  message.first_line = static_cast<std::uint32_t>(progress.first_line);
  message.last_line = static_cast<std::uint32_t>(progress.last_line);
  message.from_place = progress.from;
  message.to_place = progress.to;
  message.peak_force = progress.peak_force;
  message.compensated = progress.compensated;
  message.predicted_peak_force = progress.predicted.peak_force;
  message.stability_margin = progress.predicted.margin;
  message.judged = !progress.verdicts.empty();
  message.chatter_frequency = NOT_A_NUMBER;
  for (const PartVerdict& verdict : progress.verdicts) {
    if (!verdict.chatter) continue;
    message.chatter = true;
    message.chatter_frequency = verdict.frequency;
  }
  progress_.publish(message);
}

/// A node that was killed in a steady stretch has left its condition. The latched ones of other nodes come
/// first.
void ProgramNode::endPredecessor(double stamp) {
  constexpr double LATCHED = 1.0;  // [s] for their delivery
  if (ended_predecessor_) return;
  if (!first_state_) first_state_ = stamp;
  if (stamp - *first_state_ < LATCHED) return;
  ended_predecessor_ = true;
  if (!others_.empty() || follower_.states()) return;
  CuttingCondition none;
  none.stamp = stamp;
  publisher_.publish(toMsg(none));
}

void ProgramNode::handle(const CncState& state) {
  endPredecessor(state.stamp);
  if (const std::optional<CuttingCondition> condition = follower_.handle(state)) {
    condition_ = condition->name;
    publisher_.publish(toMsg(*condition));
  }
  const PathFollower::Status& status = follower_.status();
  const bool follows = status.follows == PathFollower::Follows::following;
  monitor_.push(PartPlace{state.stamp, follows ? std::optional<double>(status.place) : std::nullopt,
                          status.line, status.parts, state.feed});
  if (status.lost > losses_) ROS_WARN("the tool has left the path of the program after line %d", status.line);
  losses_ = status.lost;
}

void ProgramNode::handle(const ConditionEvent& event) {
  const std::string& from = event.getPublisherName();
  if (from == ros::this_node::getName()) return;
  const smartmill_msgs::CuttingCondition& condition = *event.getConstMessage();
  if (condition.kind == smartmill_msgs::CuttingCondition::NONE) {
    others_.erase(from);
  } else {
    if (follower_.states())
      ROS_WARN("'%s' of %s replaces '%s'", condition.name.c_str(), from.c_str(), condition_.c_str());
    others_[from] = condition.name;
    condition_.clear();
  }
  follower_.setOtherSource(!others_.empty());
}

void ProgramNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  using Follows = PathFollower::Follows;
  const PathFollower::Status& now = follower_.status();
  if (shell_.inputs().watchdog(names::CNC_STATE).dead()) {
    status.summary(Level::STALE, std::string("no states of the controller on ") + names::CNC_STATE);
  } else if (now.follows == Follows::lost) {
    status.summaryf(Level::WARN, "the tool is more than %.3g mm off the path, which it left after line %d",
                    parameters_.follower.path_tolerance / MM, now.line);
  } else if (!others_.empty()) {
    status.summary(Level::WARN, "condition '" + others_.begin()->second + "' is stated by " +
                                    others_.begin()->first + ", none by this node");
  } else if (now.follows == Follows::following && now.material_unknown) {
    status.summary(Level::WARN, "cuts before this place were skipped: the material is not known");
  } else if (now.follows == Follows::following && now.cut_before) {
    status.summary(Level::WARN, "the program cuts here a second time: the material is not known");
  } else if (now.follows == Follows::following) {
    status.summaryf(Level::OK, "line %d", now.line);
  } else if (now.follows == Follows::ambiguous) {
    status.summary(Level::OK, "the tool may be at several places of the path");
  } else {
    status.summary(Level::OK,
                   now.follows == Follows::idle ? "no program runs" : "the tool has not come to the path");
  }
  status.add("program", parameters_.program);
  status.add("condition", condition_);
  status.add("place on the path [m]", now.place);
  status.add("deviation from the path [m]", now.deviation);
  status.add("largest deviation [m]", now.largest_deviation);
  status.add("standard deviation of the engagement by the position [deg]", units::degFromRad(now.angle_std));
  status.add("parts begun", now.parts);
  status.add("conditions stated", now.conditions);
  status.add("losses of the path", now.lost);
  status.add("coefficients of the prediction", predicted_for_.empty() ? "not known" : predicted_for_);
}

}  // namespace smartmill::program

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<program::ProgramNode>(argc, argv, "program");
}
