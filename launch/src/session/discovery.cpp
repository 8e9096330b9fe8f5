#include "session/discovery.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <filesystem>
#include <utility>

#include <smartmill_msgs/InstallModel.h>
#include <boost/function.hpp>

#include "session/child.h"
#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/model/cause_odds.h"
#include "smartmill_core/names.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/parameter_server.h"

namespace smartmill::session {
namespace {

namespace fs = std::filesystem;
using discovery::Explained;

}  // namespace

Discovery::Discovery(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
    : nh_(std::move(nh)),
      parameters_(parametersFromServer(private_nh).readAll<Parameters>()),
      model_(readMachineModel(parameters_.model)),
      planner_(model_, parameters_.paths),
      installed_model_(parameters_.folder, parameters_.model),
      driver_(nh_, [this] { return cancel_.load(); }),
      coefficients_(nh_.advertise<smartmill_msgs::CuttingCoefficients>(names::COEFFICIENTS, 10, true)),
      modes_(nh_, names::TOOL_MODES) {
  parameters_.initialCuts(planner_, "", 0);
  if (!parameters_.prior.empty()) readCauseOdds(parameters_.prior);
  states_ = nh_.subscribe<smartmill_msgs::DiscrepancyState>(
      names::DISCREPANCY_STATE, 100,
      boost::function<void(const smartmill_msgs::DiscrepancyState&)>([this](const auto& m) {
        const std::lock_guard<std::mutex> lock(mutex_);
        monitored_.insert(m.condition);
        last_monitored_ = ros::SteadyTime::now();
      }));
  server_ = std::make_unique<Server>(
      nh_, names::DISCOVER, boost::function<void(Handle)>([this](Handle handle) { onGoal(handle); }),
      boost::function<void(Handle)>([this](const Handle& handle) { onCancel(handle); }), false);
  server_->start();
}

void Discovery::stop() {
  std::thread thread;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = cancel_ = true;
    thread = std::move(thread_);
  }
  if (thread.joinable()) thread.join();
}

void Discovery::onGoal(Handle handle) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (active_ || stopping_) {
    Result busy;
    busy.code = Result::BUSY;
    busy.message = stopping_ ? "the node is ending" : "another discovery is running";
    busy.gap_before = busy.gap_after = NOT_A_NUMBER;
    handle.setRejected(busy, busy.message);
    return;
  }
  if (thread_.joinable()) thread_.join();  // it has finished its goal
  handle.setAccepted();
  active_ = handle;
  cancel_ = false;
  thread_ = std::thread([this, handle] { work(handle); });
}

void Discovery::onCancel(const Handle& handle) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (active_ && *active_ == handle) cancel_ = true;
}

void Discovery::stage(const std::string& text) {
  ROS_INFO("discover: %s", text.c_str());
  feedback_.stage = text;
  const std::lock_guard<std::mutex> lock(mutex_);
  if (active_) active_->publishFeedback(feedback_);
}

void Discovery::work(Handle handle) {
  Result result;
  result.gap_before = result.gap_after = NOT_A_NUMBER;
  moved_ = false;
  feedback_ = {};
  ++goals_;
  try {
    discover(*handle.getGoal(), result);
  } catch (const Interrupted&) {
    result.code = Result::CANCELLED;
    result.message = "cancelled; records and explanations up to now are kept";
  } catch (const Failure& failure) {
    result.code = failure.code;
    result.message = failure.message;
  } catch (const std::exception& error) {
    result.code = Result::CUT_FAILED;
    result.message = error.what();
  }
  if (result.code != Result::OK && moved_) makeSafe(result);
  finish(handle, result);
}

void Discovery::finish(Handle& handle, const Result& result) {
  const std::lock_guard<std::mutex> lock(mutex_);
  active_.reset();
  if (!ros::ok()) return;
  if (result.code == Result::OK) {
    ROS_INFO("discover: %s", result.message.c_str());
    handle.setSucceeded(result, result.message);
  } else if (result.code == Result::CANCELLED) {
    ROS_WARN("discover: %s", result.message.c_str());
    handle.setCanceled(result, result.message);
  } else {
    ROS_ERROR("discover: %s", result.message.c_str());
    handle.setAborted(result, result.message);
  }
}

void Discovery::makeSafe(Result& result) {
  try {
    driver_.makeSafe(stopping_);
    result.message += "; motion is disarmed";
  } catch (const Error& error) {
    result.message += std::string("; disarming failed: ") + error.what();
  }
}

// ---------------------------------------------------------------------------------------------- the steps

void Discovery::discover(const smartmill_msgs::DiscoverGoal& goal, Result& result) {
  waitUntilReady();
  makeInitialCuts();
  Explained explained = explain(result);
  while (explained.suggested_test && makeSuggestedTest(*explained.suggested_test, goal, result))
    explained = explain(result);
  std::vector<std::string> messages{explained.verdict};
  for (const std::string& effect : result.effects) messages.push_back(effect);
  for (const std::string& rivals : explained.rivals) messages.push_back("not distinguished: " + rivals);
  if (goal.install && explained.better) {
    install(result);
    messages.push_back("installed, the previous model is kept in " + installed_model_.replaced());
  }
  result.message = joined(messages, "; ");
}

void Discovery::waitUntilReady() {
  stage("waiting for nodes and controller");
  const ros::Time now = ros::Time::now();
  const auto missing = [&] {
    std::string text;
    if (!driver_.reachable()) text = std::string("action ") + names::RUN_PROGRAM;
    if (!driver_.state().connected || driver_.state().header.stamp < now)
      text += (text.empty() ? "" : ", ") + std::string("the controller");
    if (states_.getNumPublishers() == 0) text += (text.empty() ? "" : ", ") + std::string("the monitor");
    return text;
  };
  if (!driver_.waitUntil([&] { return missing().empty(); }, parameters_.ready_timeout)) {
    throw Failure{Result::NOT_READY,
                  "after " + numberText(parameters_.ready_timeout, 0) + " s still missing: " + missing()};
  }
  if (!driver_.state().armed) {
    throw Failure{Result::NOT_ARMED,
                  std::string("motion is not armed (service ") + names::ARM_MOTION + "); nothing has moved"};
  }
}

/// Of slots at all speeds of the spindle, by the chart of the model in use.
discovery::BelievedLimits Discovery::believedLimits() {
  const MachineModel model = readMachineModel(installed_model_.inUse());
  if (model.tool_tip.x.modes.empty() && model.tool_tip.y.modes.empty()) return {};
  constexpr double DEEPEST = 20.0;  // [mm]
  constexpr int SPEEDS = 400;
  const double lowest = *std::min_element(parameters_.watch_speeds.begin(), parameters_.watch_speeds.end());
  const double highest =
      model.spindle && model.spindle->max_speed
          ? *model.spindle->max_speed
          : 2.0 * *std::max_element(parameters_.watch_speeds.begin(), parameters_.watch_speeds.end());
  const std::string chart = parameters_.folder + "/stability_" + std::to_string(explained_) + ".csv",
                    log = chart + ".log";
  stage("computing the stability limits that the model in use predicts");
  std::error_code failed;
  fs::create_directories(parameters_.folder, failed);
  try {
    const int code = runTool({"lobes", "the stability limits of the cuts"},
                             {installed_model_.inUse(), "--entry-deg", "0", "--exit-deg", "180", "--speeds",
                              formatted("%.0f:%.0f:%d", 0.5 * units::rpmFromRadPerSec(lowest),
                                        units::rpmFromRadPerSec(highest), SPEEDS),
                              "--max-depth-mm", formatted("%g", DEEPEST), "-o", chart},
                             log, [&] { return cancel_.load(); });
    driver_.checkStop();
    if (code != 0) throw Error("lobes: no chart of " + installed_model_.inUse() + ", see " + log);
    return {chart, parameters_.stable_share};
  } catch (const Error& error) {
    throw Failure{Result::CUT_FAILED, error.what()};
  }
}

void Discovery::makeInitialCuts() {
  std::vector<PlannedCut> cuts;
  try {
    cuts = parameters_.initialCuts(planner_, goals_ == 1 ? "" : "again_" + std::to_string(goals_) + "_",
                                   lane_, believedLimits());
  } catch (const Error& error) {
    throw Failure{Result::CUT_FAILED, error.what()};
  }
  for (const PlannedCut& planned : cuts) cut(planned);
}

void Discovery::cut(const PlannedCut& planned) {
  const std::string& name = planned.condition.name;
  stage("cut " + name);
  moved_ = true;
  if (planned.feed > 0.0) ++lane_;
  try {
    driver_.run(planner_, planned, parameters_.program_timeout);
    const auto monitored = [&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      return monitored_.count(name) > 0;
    };
    if (!driver_.waitUntil(monitored, parameters_.judged_timeout))
      throw Error("no result of the monitor within " + numberText(parameters_.judged_timeout, 0) + " s");
  } catch (const Error& error) {
    throw Failure{Result::CUT_FAILED, "cut " + name + ": " + error.what()};
  }
  ++feedback_.cuts_done;
}

Explained Discovery::explain(Result& result) {
  const std::string out = parameters_.folder + "/explain_" + std::to_string(++explained_);
  // The monitor may still be processing the last segment.
  driver_.waitUntil(
      [&] {
        const std::lock_guard<std::mutex> lock(mutex_);
        return (ros::SteadyTime::now() - last_monitored_).toSec() > parameters_.quiet_time;
      },
      parameters_.judged_timeout + parameters_.quiet_time);
  stage("explaining " + std::to_string(feedback_.cuts_done) + " cuts");
  if (!fs::exists(parameters_.record_folder + "/campaign.yaml")) {
    throw Failure{Result::EXPLAIN_FAILED,
                  parameters_.record_folder +
                      ": no records of the monitor (its parameters record_folder and record_all)"};
  }
  std::error_code failed;
  fs::create_directories(out, failed);
  if (failed) throw Failure{Result::EXPLAIN_FAILED, out + ": " + failed.message()};
  const std::string log = out + "/explain.log";
  int code = 0;
  try {
    std::vector<std::string> arguments{parameters_.record_folder,
                                       "--model",
                                       installed_model_.inUse(),
                                       "-o",
                                       out,
                                       "--threads",
                                       std::to_string(parameters_.threads),
                                       "--budget",
                                       numberText(parameters_.explain_budget, 1)};
    if (!parameters_.prior.empty()) arguments.insert(arguments.end(), {"--prior", parameters_.prior});
    code =
        runTool({"explain", "the cause of the disagreement"}, arguments, log, [&] { return cancel_.load(); });
  } catch (const Error& error) {
    throw Failure{Result::EXPLAIN_FAILED, error.what()};
  }
  driver_.checkStop();
  if (code == 1)
    throw Failure{Result::EXPLAIN_FAILED, "explain: the records cannot be evaluated, see " + log};
  try {
    const Explained explained = discovery::readExplained(out + "/report.json");
    result.verdict = explained.verdict;
    result.effects.clear();
    for (const Explained::Effect& effect : explained.effects) result.effects.push_back(effect.text());
    result.gap_before = explained.gap_before;
    result.gap_after = explained.gap_after;
    result.report = out;
    return explained;
  } catch (const Error& error) {
    throw Failure{Result::EXPLAIN_FAILED, error.what()};
  }
}

bool Discovery::makeSuggestedTest(const Explained::SuggestedTest& suggested_test,
                                  const smartmill_msgs::DiscoverGoal& goal, Result& result) {
  if (feedback_.tests_done >= goal.most_tests) {
    result.tests.push_back("not made, maximum number of tests reached: " + suggested_test.text);
    return false;
  }
  const std::string name =
      "suggested_" + std::to_string(goals_) + "_" + std::to_string(feedback_.tests_done + 1);
  PlannedCut planned;
  try {
    planned = planSuggestedTest(planner_, suggested_test, parameters_.slotRequest(name, lane_),
                                parameters_.air_time,
                                suggested_test.cut ? believedLimits() : discovery::BelievedLimits());
  } catch (const Error& error) {
    result.tests.push_back("refused, " + std::string(error.what()) + ": " + suggested_test.text);
    stage(result.tests.back());
    return false;
  }
  const double depth = planned.condition.engagement.axial_depth;
  const std::string made =
      suggested_test.cut && depth < suggested_test.engagement.axial_depth
          ? formatted("made at a depth of %.3g mm, %.3g of the predicted stability limit: ",
                      depth / units::MM, parameters_.stable_share)
          : "made: ";
  stage("suggested test " + suggested_test.text);
  cut(planned);
  ++feedback_.tests_done;
  result.tests.push_back(made + suggested_test.text);
  return true;
}

void Discovery::install(Result& result) {
  stage("installing the improved model");
  try {
    installed_model_.install(result.report + "/model.yaml");
  } catch (const Error& error) {
    throw Failure{Result::NOT_INSTALLED, error.what()};
  }
  smartmill_msgs::InstallModel service;
  service.request.file = installed_model_.inUse();
  const bool answered = driver_.callService(names::INSTALL_MODEL, service, MachineDriver::SERVICE_WAIT);
  if (!answered || service.response.code != smartmill_msgs::InstallModel::Response::OK) {
    installed_model_.undo();
    throw Failure{Result::NOT_INSTALLED,
                  std::string(names::INSTALL_MODEL) + ": " +
                      (answered ? service.response.message : std::string("no answer"))};
  }
  result.model = installed_model_.inUse();
  // In the thread of the callbacks, which serves the latched topics.
  const MachineModel installed = readMachineModel(installed_model_.inUse());
  publish_timer_ = nh_.createSteadyTimer(
      ros::WallDuration(0.0), [this, installed](const ros::SteadyTimerEvent&) { publishModel(installed); },
      true);
}

// Publishes the inputs of the stability charts.
void Discovery::publishModel(const MachineModel& model) {
  CoefficientSet set;
  set.stamp = toSec(ros::Time::now());
  set.tool = parameters_.paths.tool;
  set.material = planner_.material();
  set.source = "force";
  set.value = model.needCutting("publish it for the stability charts");
  set.std_dev = NOT_IDENTIFIED;
  coefficients_.publish(toMsg(set));
  for (const char axis : {'x', 'y'}) {
    MeasuredModes modes;
    modes.stamp = set.stamp;
    modes.tool = set.tool;
    modes.point = POINT_TOOL_TIP;
    modes.direction = axis;
    modes.unit = "m/N";
    modes.model = axis == 'x' ? model.tool_tip.x : model.tool_tip.y;
    if (!modes.model.modes.empty()) modes_.publish(modes.direction, toMsg(modes));
  }
}

}  // namespace smartmill::session
