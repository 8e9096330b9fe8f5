#include "session.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <smartmill_msgs/ChooseProbingCut.h>
#include <smartmill_msgs/CoefficientPrior.h>
#include <smartmill_msgs/FindCoefficients.h>
#include <smartmill_msgs/ForceCurve.h>
#include <smartmill_msgs/NodeHealth.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <smartmill_msgs/WhatIf.h>
#include <boost/function.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/names.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/follower.h"
#include "smartmill_ros/parameter_server.h"

namespace smartmill::session {
namespace {

constexpr double FRESH = 0.5;         // [s] since the last message of a sensor
constexpr double CURVE_WAIT = 5.0;    // [s] after the last cut, for the force curve that contains it
constexpr double CHART_WAIT = 20.0;   // [s] for the stability limit of another immersion
constexpr double CHOICE_WAIT = 60.0;  // [s] for the choice of a probing cut, which takes seconds

constexpr const char *LOADMETER = "loadmeter", *KALMAN = "kalman";  // nodes that hold results in memory
constexpr const char* TEST_PLAN = "test plan";  // the step with which the coefficients are complete
constexpr const char* PROGRESS = "session";     // key of the kept text

std::string modesText(const smartmill_msgs::ModalModel& model) {
  std::string text;
  for (const smartmill_msgs::Mode& mode : model.modes) {
    text += text.empty() ? "" : ", ";
    text += formatted("%.2f +- %.2f Hz", mode.frequency, mode.frequency_std);
    text += model.unit == "m/N" ? formatted(" %.2f N/um", 1.0 / mode.gain / units::N_PER_UM)
                                : formatted(" gain %.3f", mode.gain);
    text += formatted(" damping %.2f %%", 100.0 * mode.damping_ratio);
  }
  return text;
}

std::vector<Point> pointsOf(const std::vector<smartmill_msgs::StabilityPoint>& messages) {
  std::vector<Point> points;
  for (const smartmill_msgs::StabilityPoint& m : messages) {
    points.push_back({m.spindle_speed, m.axial_depth, m.depth_limit, m.chatter_frequency});
  }
  return points;
}

/// Of the cuts of a session: the others have half immersion.
bool isSlot(const CuttingCondition& condition) {
  return condition.engagement.exit - condition.engagement.entry > 0.75 * units::PI;
}

std::string pointText(const Point& point) {
  return formatted("%.0f rpm %.2f mm (limit %.2f mm)", units::rpmFromRadPerSec(point.spindle_speed),
                   point.axial_depth / units::MM, point.depth_limit / units::MM);
}

}  // namespace

Session::Session(ros::NodeHandle nh, const ros::NodeHandle& private_nh, std::function<bool()> stopped)
    : nh_(std::move(nh)),
      stopped_(std::move(stopped)),
      parameters_(parametersFromServer(private_nh).readAll<SessionParameters>()),
      model_(readMachineModel(parameters_.model)),
      plan_(model_, parameters_.cuts()),
      log_(nh_, parameters_.plan.tool, plan_.material()),
      tool_frf_(nh_, names::MEASURE_TOOL_FRF, false),
      sensor_frf_(nh_, names::MEASURE_SENSOR_FRF, false),
      identify_(nh_, names::IDENTIFY_COEFFICIENTS, false),
      drive_(nh_, names::IDENTIFY_AXIS_DRIVE, false),
      driver_(nh_, stopped_),
      sensor_(nh_, parameters_.calibration, driver_, sensor_frf_,
              [this](const std::string& request) { log_.request(request); }),
      kept_(nh_, "progress") {
  prior_ = nh_.advertise<smartmill_msgs::CoefficientPrior>(names::COEFFICIENT_PRIOR, 1, true);
  const auto subscribe = [this](const char* topic, auto example, auto use) {
    using Message = decltype(example);
    const boost::function<void(const Message&)> callback = [this, topic, use](const Message& message) {
      const std::lock_guard<std::mutex> lock(mutex_);
      last_received_[topic] = ros::SteadyTime::now();
      use(message);
    };
    last_received_[topic] = ros::SteadyTime(0);
    subscribers_.push_back(nh_.subscribe<Message>(topic, 200, callback));
  };
  subscribe(names::CNC_STATE, smartmill_msgs::CncState(), [this](const smartmill_msgs::CncState& m) {
    if (under_control_ && m.feed > 0.0) states_.push_back({toSec(m.header.stamp), m.spindle_speed, m.feed});
  });
  if (parameters_.plan.hammer) subscribe(names::HAMMER, smartmill_msgs::SampleBlock(), [](const auto&) {});
  subscribe(
      parameters_.calibration.kind() == ForceSensorKind::spindle ? names::SPINDLE_FORCE : names::DYNAMOMETER,
      smartmill_msgs::SampleBlock(), [](const auto&) {});
  subscribe(names::SPINDLE_ANGLE, smartmill_msgs::SpindleAngle(), [](const auto&) {});
  chart_subscriber_ = nh_.subscribe<smartmill_msgs::StabilityChart>(
      names::STABILITY_CHART, 10,
      boost::function<void(const smartmill_msgs::StabilityChart&)>([this](const auto& m) {
        const std::lock_guard<std::mutex> lock(mutex_);
        chart_ = m;
      }));
  subscribers_.push_back(nh_.subscribe<smartmill_msgs::ForceCurve>(
      names::FORCE_CURVE, 10, boost::function<void(const smartmill_msgs::ForceCurve&)>([this](const auto& m) {
        const std::lock_guard<std::mutex> lock(mutex_);
        curve_stamp_ = m.header.stamp;
      })));
  subscribers_.push_back(nh_.subscribe<smartmill_msgs::ChatterState>(
      names::CHATTER_STATE, 1000,
      boost::function<void(const smartmill_msgs::ChatterState&)>([this](const auto& m) {
        const std::lock_guard<std::mutex> lock(mutex_);
        verdict_ = m;
        if (!m.valid) return;
        windows_[m.condition].push_back({m.chatter != 0, m.frequency, m.severity, toSec(m.header.stamp)});
      })));
  subscribers_.push_back(nh_.subscribe<smartmill_msgs::NodeHealth>(
      names::NODE_HEALTH, 100,
      boost::function<void(const smartmill_msgs::NodeHealth&)>([this](const auto& m) {
        const std::lock_guard<std::mutex> lock(mutex_);
        starts_[m.node] = m.starts;
      })));
  spinner_ = std::make_unique<ros::AsyncSpinner>(2);
  spinner_->start();
}

Session::~Session() {
  spinner_->stop();
}

// ---------------------------------------------------------------------------------------------- all steps

int Session::run() {
  int code = 1;
  try {
    runSteps();
    log_.summary.completed = true;
    kept_.forget();
    code = 0;
  } catch (const Interrupted&) {
    log_.record("stop", "interrupted",
                armed_ ? "goals cancelled, motion is being disarmed" : "goals cancelled");
  } catch (const std::exception& error) {
    log_.record("FAIL", "session", error.what());
  }
  if (code != 0) makeSafe();
  log_.publish("", true);
  log_.summary.sensor = sensor_.state();
  if (!parameters_.summary.empty()) {
    try {
      log_.summary.write(parameters_.summary);
    } catch (const Error& error) {
      log_.record("FAIL", "summary", error.what());
      code = 1;
    }
  }
  return code;
}

void Session::runSteps() {
  using smartmill_msgs::MeasureFrfAction;
  step("connect", [&] { return waitReady(); });
  step(parameters_.resume ? "resume" : "begin", [&] { return beginProgress(); });
  step("arm motion", [&] { return arm(true); });
  for (char direction : parameters_.plan.hammer ? parameters_.tool_directions : "") {
    action(std::string("FRF of the tool in ") + direction, "", [&] {
      return measure(tool_frf_, names::MEASURE_TOOL_FRF, POINT_TOOL_TIP, {direction}, parameters_.hits,
                     parameters_.modes);
    });
  }
  calibrateSensor();
  const bool identified = doneBefore(TEST_PLAN);
  if (!identified) {
    action("discard earlier tests", LOADMETER, [&] { return identify(true); });
    step("stored coefficients", [&] { return useStored(); });
  }
  moveInAir();
  if (!identified) identifyFromTests();
  tuneFilter();  // chosen test cuts have moved the lanes before
  if (parameters_.verify && !parameters_.plan.hammer) {
    learnFromCuts();
  } else if (parameters_.verify) {
    step("stability chart", [&] { return waitChart(); });
    step("points to verify", [&] { return choosePoints(); });
    const double feed = used_chart_.feed_per_tooth;
    action(
        "cut at the recommended point", "",
        [&] { return verify("stable", plan_.stable(stable_, feed), CutVerdict::Kind::stable); }, true);
    action(
        "cut at the unstable point", "",
        [&] { return verify("unstable", plan_.unstable(unstable_, feed), CutVerdict::Kind::chatter); }, true);
    if (const auto cut = plan_.controlled(unstable_, feed))
      action(
          "cut at the unstable point under chatter control", "", [&] { return cutUnderControl(*cut); }, true);
  }
  if (plan_.resonance()) {
    action(
        "cut at the sensor's resonance", "", [&] { return runCut(*plan_.resonance()); }, true);
  }
  step("disarm motion", [&] {
    waitVerdict();
    return arm(false);
  });
  waitCurve();
}

void Session::calibrateSensor() {
  const double began = log_.elapsed();
  const ForceSensorKind kind = parameters_.calibration.kind();
  for (const CalibrationStage& stage : calibrationPlan(parameters_.calibration))
    action(stage.name, KALMAN, [&] { return sensor_.run(stage, parameters_.frf_timeout); });
  // The taps on a plate are those of its calibration.
  if (kind != ForceSensorKind::plate && parameters_.plan.hammer) {
    for (char direction : parameters_.sensor_directions) {
      // With a sensor in the spindle they are part of its calibration, which ends with the node.
      const char* holder = kind == ForceSensorKind::spindle ? KALMAN : "";
      action(std::string("taps on the force sensor in ") + direction, holder, [&] {
        return measure(sensor_frf_, names::MEASURE_SENSOR_FRF, POINT_FORCE_SENSOR, {direction},
                       parameters_.sensor_hits, parameters_.sensor_modes);
      });
    }
  }
  if (kind == ForceSensorKind::spindle) {
    CalibrationStage dynamics{"cross-talk of the spindle sensor", {CalibrationStep(), CalibrationStep()}};
    dynamics.steps.front().kind = CalibrationStep::Kind::fit;
    dynamics.steps.back().kind = CalibrationStep::Kind::verify;  // of what is in use from now on
    action(dynamics.name, KALMAN, [&] { return sensor_.run(dynamics, parameters_.frf_timeout); });
  }
  sensor_.requireCalibrated();
  const auto verdict = [this] {
    const std::lock_guard<std::mutex> lock(mutex_);
    return verdict_.has_value();
  };
  if (!waitUntil(verdict, parameters_.ready_timeout))
    throw Error(std::string("force sensor: calibrated, but no verdict on ") + names::CHATTER_STATE);
  log_.summary.calibration_time = log_.elapsed() - began;
}

void Session::tuneFilter() {
  if (plan_.tuning().empty()) return;
  for (const PlannedCut& cut : plan_.tuning()) {
    action(
        "cut for the tuning " + cut.condition.name, KALMAN, [&] { return runCut(cut); }, cut.feed > 0.0);
  }
  CalibrationStage tuning{"process noise of the force filter", {CalibrationStep()}};
  tuning.steps.front().kind = CalibrationStep::Kind::fit;
  action(tuning.name, KALMAN, [&] { return sensor_.run(tuning, parameters_.frf_timeout); });
}

// With a record of Servo Guide the moves identify the drive as well.
void Session::moveInAir() {
  using smartmill_msgs::IdentifyAxisDriveGoal;
  const bool has_record = parameters_.plan.feed_block > 0 && !plan_.airMoves().empty();
  const auto identifyDrive = [this](bool reset) {
    IdentifyAxisDriveGoal goal;
    goal.header.stamp = ros::Time::now();
    goal.axis = "x";
    goal.reset = reset;
    return driver_.call(drive_, names::IDENTIFY_AXIS_DRIVE, goal, parameters_.identify_timeout).message;
  };
  if (has_record) action("discard earlier moves", LOADMETER, [&] { return identifyDrive(true); });
  for (const PlannedCut& air : plan_.airMoves())
    action("move in air " + air.condition.name, LOADMETER, [&] { return runCut(air); });
  if (has_record) step("drive of the x axis", [&] { return identifyDrive(false); });
}

void Session::step(const std::string& name, const std::function<std::string()>& work) {
  driver_.checkStop();
  log_.publish(name);
  try {
    const std::string detail = work();
    log_.record("ok", name, detail);
  } catch (const Error& error) {
    throw Error(name + ": " + error.what());
  }
}

// ---------------------------------------------------------------------------------------------- resuming

std::uint32_t Session::startsOf(const std::string& node) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = starts_.find(nh_.resolveName(node));
  return found == starts_.end() ? 0 : found->second;
}

void Session::keepProgress() {
  progress_.summary = log_.summary.text();
  kept_.keep(PROGRESS, progress_.text());
}

bool Session::doneBefore(const std::string& name) {
  const std::optional<SessionProgress::Action> before = progress_.take(name);
  if (before) log_.record("ok", name, "done before: " + before->detail);
  return before.has_value();
}

void Session::action(const std::string& name, const std::string& holder,
                     const std::function<std::string()>& work, bool lane) {
  driver_.checkStop();
  if (doneBefore(name)) return;
  step(name, [&] {
    progress_.begin(name, holder, holder.empty() ? 0 : startsOf(holder), lane);
    keepProgress();
    const std::string detail = work();
    progress_.end(detail);
    keepProgress();
    return detail;
  });
}

std::string Session::beginProgress() {
  const std::map<std::string, std::string> before = kept_.all();
  const std::string subject =
      parameters_.plan.tool + " in " + plan_.material() + ", force sensor " + parameters_.calibration.sensor;
  std::string text = subject;
  if (parameters_.resume) {
    if (before.count(PROGRESS) == 0)
      throw Error("no interrupted session in this launch, expected one; start without resume");
    progress_ = SessionProgress::of(before.at(PROGRESS));
    if (progress_.subject != subject)
      throw Error("the interrupted session is of " + progress_.subject + ", this one of " + subject);
    text = continueProgress(text);
  }
  progress_.subject = subject;
  keepProgress();  // in place of an earlier one
  tests_ = plan_.airCuts();
  if (!parameters_.plan.isInformative())
    tests_.insert(tests_.end(), plan_.slots().begin(), plan_.slots().end());
  return text;
}

// Cuts that were interrupted, or whose results a node has lost, are repeated in other lanes.
std::string Session::continueProgress(const std::string& text) {
  std::string lost;
  for (const std::string& holder : progress_.holders()) {
    const std::size_t lanes = progress_.lostLanes();
    progress_.restarted(holder, startsOf(holder));
    if (progress_.lostLanes() > lanes) lost += "; " + holder + " was restarted, its tests are repeated";
  }
  if (!parameters_.plan.hammer && progress_.cutLanes())
    throw Error("without a hammer a session is continued only before its first cut; start without resume");
  if (parameters_.plan.isInformative() && progress_.cutLanes())
    throw Error(
        "with test_cuts informative a session is continued only before its first cut; start without resume");
  log_.summary.before = progress_.summary;
  PlanParameters cuts = parameters_.cuts();
  cuts.lost_lanes = progress_.lostLanes();
  plan_ = SessionPlan(model_, cuts);
  return text + lost +
         formatted("; %zu lane%s of the stock lost", cuts.lost_lanes, cuts.lost_lanes == 1 ? "" : "s");
}

// ---------------------------------------------------------------------------------------------- waiting

void Session::pause(double seconds) const {
  driver_.waitUntil([] { return false; }, seconds);
}

bool Session::waitUntil(const std::function<bool()>& ready, double seconds) const {
  return driver_.waitUntil(ready, seconds);
}

std::string Session::missing() {
  std::string text;
  const auto add = [&](const std::string& what) { text += (text.empty() ? "" : ", ") + what; };
  const auto server = [&](bool there, const char* name) {
    if (!there) add(std::string("action ") + name);
  };
  server(driver_.reachable(), names::RUN_PROGRAM);
  if (parameters_.plan.hammer) server(tool_frf_.isServerConnected(), names::MEASURE_TOOL_FRF);
  server(sensor_frf_.isServerConnected(), names::MEASURE_SENSOR_FRF);
  server(identify_.isServerConnected(), names::IDENTIFY_COEFFICIENTS);
  if (chart_subscriber_.getNumPublishers() == 0) add(std::string("a publisher of ") + names::STABILITY_CHART);
  if (const std::string what = sensor_.missing(); !what.empty()) add(what);
  for (const char* node : {LOADMETER, KALMAN}) {
    if (startsOf(node) == 0) add(std::string("health of ") + nh_.resolveName(node));
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const auto& [topic, time] : last_received_) {
    if ((ros::SteadyTime::now() - time).toSec() > FRESH) add("data on " + topic);
  }
  if (!driver_.state().connected) add("the controller's connection");
  // The detector needs forces, which a sensor that is not calibrated yet does not give.
  if (!verdict_ && parameters_.calibration.kind() == ForceSensorKind::table)
    add(std::string("a verdict on ") + names::CHATTER_STATE);
  return text;
}

std::string Session::recorderMissing() const {
  if (parameters_.recorder.empty()) return {};
  smartmill_msgs::Follow service;
  if (!driver_.callService(parameters_.recorder + "/" + FOLLOW, service, MachineDriver::SERVICE_WAIT))
    return "the recorder";
  const std::string topics = unconnected(service.response);
  return topics.empty() ? "" : "the recorder's subscription to " + topics;
}

// ---------------------------------------------------------------------------------------------- the steps

std::string Session::waitReady() {
  if (!waitUntil([&] { return missing().empty(); }, parameters_.ready_timeout)) {
    throw Error(formatted("after %.0f s still missing: ", parameters_.ready_timeout) + missing());
  }
  requireNodes();
  // An incomplete recording does not prevent the session.
  std::string recorder;
  waitUntil([&] { return (recorder = recorderMissing()).empty(); }, parameters_.ready_timeout);
  pause(parameters_.start_delay);
  return formatted("nodes, sensors and controller are available; the stock has space for %.0f lanes",
                   static_cast<double>(plan_.planner().lanes())) +
         (recorder.empty() ? "" : "; missing: " + recorder);
}

// Steps use what earlier ones have measured, so that a node which is restarted lacks it.
void Session::requireNodes() {
  const auto has = [](const auto& client) { return [&client] { return client.isServerConnected(); }; };
  std::map<std::string, std::function<bool()>> nodes{
      {"cnc", [this] { return driver_.reachable(); }},
      {KALMAN, has(sensor_frf_)},
      {LOADMETER, has(identify_)},
      {"stability", [this] { return chart_subscriber_.getNumPublishers() > 0; }}};
  if (parameters_.plan.hammer) nodes["hammer"] = has(tool_frf_);
  driver_.require(std::move(nodes));
}

std::string Session::arm(bool on) {
  const std::string answer = driver_.arm(on);
  armed_ = on;
  return answer;
}

std::string Session::measure(Client<smartmill_msgs::MeasureFrfAction>& client, const std::string& name,
                             const std::string& point, const std::string& direction, int hits, int modes) {
  smartmill_msgs::MeasureFrfGoal goal;
  const bool tool = point == POINT_TOOL_TIP;
  goal.tool = tool ? parameters_.plan.tool : "";
  goal.point = point;
  goal.direction = direction;
  goal.hits = static_cast<std::uint32_t>(hits);
  goal.modes = static_cast<std::uint32_t>(modes);
  goal.stickout = tool ? model_.stickout.value_or(0.0) : 0.0;
  goal.teeth = tool ? static_cast<std::uint32_t>(model_.tool->teeth) : 0;
  const auto result = driver_.call(client, name, goal, parameters_.frf_timeout);
  log_.summary.modes.push_back(fromMsg(result.modes));
  return modesText(result.modes);
}

std::string Session::runCut(const PlannedCut& cut) {
  cut_from_ = ros::Time::now();
  return driver_.run(plan_.planner(), cut, parameters_.program_timeout);
}

// The coefficients of the database become the prior of the identification, which makes tests unnecessary.
std::string Session::useStored() {
  SessionSummary::TestPlan& plan = log_.summary.test_plan;
  smartmill_msgs::FindCoefficients service;
  service.request.tool = parameters_.plan.tool;
  service.request.material = plan_.material();
  for (const PlannedCut& test : tests_) service.request.tests.push_back(toMsg(test.condition));
  for (std::size_t i = 0; i < tests_.size(); ++i) needed_.insert(i);
  if (!parameters_.use_stored) {
    plan.stored = "not used (use_stored)";
  } else if (!driver_.callService(names::FIND_COEFFICIENTS, service, MachineDriver::SERVICE_WAIT)) {
    plan.stored = std::string(names::FIND_COEFFICIENTS) + ": no answer";
  } else {
    plan.stored = service.response.message;
    has_prior_ = service.response.of_pair && service.response.identifications > 0;
  }
  if (!has_prior_) return plan.stored + (parameters_.plan.isInformative() ? "" : "; all tests are made");
  smartmill_msgs::CoefficientPrior prior;
  prior.header.stamp = ros::Time::now();
  prior.coefficients = service.response.coefficients;
  prior.ktc_kte_covariance = service.response.ktc_kte_covariance;
  prior_.publish(prior);
  plan.known = {fromMsg(prior.coefficients)};
  const CoefficientSet& k = plan.known.front();
  const std::string text = formatted("%s: Ktc %.1f +- %.1f N/mm2, Kte %.2f +- %.2f N/mm", plan.stored.c_str(),
                                     k.value.ktc / units::N_PER_MM2, k.std_dev.ktc / units::N_PER_MM2,
                                     k.value.kte / units::N_PER_MM, k.std_dev.kte / units::N_PER_MM);
  if (parameters_.plan.isInformative()) return text;  // the cuts are chosen after the air cuts
  needed_ = {service.response.needed.begin(), service.response.needed.end()};
  return text + formatted("; %zu of %zu tests are needed", needed_.size(), tests_.size());
}

// Stability limits of the candidates by the chart of this tool and material, at their immersion; 0: unknown.
std::vector<double> Session::depthLimits(const std::vector<std::size_t>& candidates) const {
  std::vector<double> limits(candidates.size(), 0.0);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!chart_ || chart_->tool != parameters_.plan.tool || chart_->material != plan_.material())
      return limits;
  }
  std::map<double, smartmill_msgs::WhatIf> charts;  // by the middle of the immersion
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    const CuttingCondition& cut = plan_.candidates()[candidates[k]].condition;
    const double middle = 0.5 * (cut.engagement.entry + cut.engagement.exit);
    if (charts.count(middle) == 0) {
      smartmill_msgs::WhatIf service;
      service.request.helix = service.request.overhang = service.request.axial_depth = NOT_A_NUMBER;
      service.request.entry_angle = cut.engagement.entry;
      service.request.exit_angle = cut.engagement.exit;
      service.request.feed_per_tooth = cut.engagement.feed_per_tooth;
      if (!driver_.callService(names::WHAT_IF, service, CHART_WAIT) ||
          service.response.code != smartmill_msgs::WhatIf::Response::OK)
        return std::vector<double>(candidates.size(), 0.0);
      charts[middle] = service;
    }
    // The smaller of the two neighbours.
    const auto& speed = charts[middle].response.spindle_speed;
    const auto& depth = charts[middle].response.depth_limit;
    const auto above = std::lower_bound(speed.begin(), speed.end(), cut.spindle_speed) - speed.begin();
    if (above == 0 || above == static_cast<std::ptrdiff_t>(speed.size())) continue;
    const auto at = static_cast<std::size_t>(above);
    limits[k] = std::min(depth[at - 1], depth[at]);
  }
  return limits;
}

// Queries the load meter node which of the candidates to make, and lays them into the stock.
std::string Session::chooseCuts(bool without_stored) {
  const std::vector<std::size_t> available = plan_.available();
  smartmill_msgs::FindCoefficients service;
  service.request.tool = parameters_.plan.tool;
  service.request.material = plan_.material();
  for (const std::size_t i : made_) service.request.tests.push_back(toMsg(tests_[i].condition));
  for (const std::size_t i : available) {
    const PlannedCut& cut = plan_.candidates()[i];
    service.request.candidates.push_back(toMsg(cut.condition));
    service.request.cutting_time.push_back(cut.cuttingTime());
    service.request.stock.push_back(plan_.stockOf(i));
  }
  service.request.depth_limit = depthLimits(available);
  service.request.stock_available = plan_.freeStock();
  service.request.target_std[0] = parameters_.plan.target_ktc_std;
  service.request.target_std[1] = parameters_.plan.target_kte_std;
  service.request.without_stored = without_stored;
  if (!driver_.callService(names::FIND_COEFFICIENTS, service, MachineDriver::SERVICE_WAIT))
    throw Error(std::string(names::FIND_COEFFICIENTS) + ": no answer");
  const auto& answer = service.response;
  std::vector<std::size_t> chosen;
  for (const std::uint32_t k : answer.chosen) chosen.push_back(available.at(k));
  if (chosen.empty() && !answer.target_reached) {
    std::string reasons;
    for (const std::string& one : answer.excluded) reasons += "; " + one;
    throw Error("no cut within the limits: " + answer.message + reasons);
  }
  SessionSummary::TestPlan& plan = log_.summary.test_plan;
  const std::vector<PlannedCut> cuts = plan_.place(chosen);
  std::string text;
  needed_.clear();
  for (std::size_t k = 0; k < cuts.size(); ++k) {
    needed_.insert(tests_.size());
    tests_.push_back(cuts[k]);
    plan.chosen.push_back(
        {cuts[k].condition.name, answer.chosen_gain[k], answer.chosen_ktc_std[k], answer.chosen_kte_std[k]});
    text += formatted("%s %s (%.2f /s)", text.empty() ? "" : ",", cuts[k].condition.name.c_str(),
                      answer.chosen_gain[k]);
  }
  for (const std::string& one : answer.excluded) plan.excluded.push_back(one);
  plan.target_reached = answer.target_reached;
  if (cuts.empty()) return "none is needed";
  return formatted("information per second of cutting:%s; expected Ktc +- %.1f N/mm2, Kte +- %.2f N/mm",
                   text.c_str(), answer.chosen_ktc_std.back() / units::N_PER_MM2,
                   answer.chosen_kte_std.back() / units::N_PER_MM) +
         (answer.target_reached ? "" : ", which is above the target") +
         (answer.excluded.empty() ? ""
                                  : formatted("; %zu candidates beyond a limit", answer.excluded.size()));
}

void Session::runTests(const std::set<std::size_t>& selected) {
  SessionSummary::TestPlan& plan = log_.summary.test_plan;
  for (const std::size_t i : selected) {
    const PlannedCut& test = tests_.at(i);
    const bool is_cut = test.condition.kind == CuttingCondition::Kind::cut;
    action((!is_cut                  ? "air cut "
            : isSlot(test.condition) ? "slot test "
                                     : "half immersion test ") +
               test.condition.name,
           LOADMETER, [&] { return runCut(test); }, is_cut);
    made_.insert(i);
    ++plan.made;
    plan.made_cuts += is_cut ? 1 : 0;
    plan.made_time += test.duration();
  }
}

std::string Session::identifyAndCompare() {
  const std::string detail = identify(false);
  const std::string& source = log_.summary.coefficients.front().source;
  log_.summary.test_plan.used = source.find(names::WITH_STORED) != std::string::npos;
  return detail;
}

void Session::identifyFromTests() {
  const bool informative = parameters_.plan.isInformative();
  SessionSummary::TestPlan& plan = log_.summary.test_plan;
  for (const std::vector<PlannedCut>* tests : {&plan_.airCuts(), &plan_.slots()}) {
    for (const PlannedCut& test : *tests) {
      ++plan.planned;
      plan.planned_cuts += test.condition.kind == CuttingCondition::Kind::cut ? 1 : 0;
      plan.planned_time += test.duration();
    }
  }
  runTests(needed_);
  if (informative) {
    step("choice of cuts", [&] { return chooseCuts(!has_prior_); });
    runTests(needed_);
  }
  step("cutting coefficients", [&] { return identifyAndCompare(); });
  if (has_prior_ && !plan.used && (informative || made_.size() < tests_.size())) {
    step("stored coefficients disagree", [&] {
      if (informative) return chooseCuts(true);
      needed_.clear();
      for (std::size_t i = 0; i < tests_.size(); ++i) {
        if (made_.count(i) == 0) needed_.insert(i);
      }
      return std::string("the other tests are made");
    });
    runTests(needed_);
    step("cutting coefficients from all tests", [&] { return identifyAndCompare(); });
  }
  action(TEST_PLAN, "", [&] { return plan.text(); });
}

// The detector reports the end of a condition after it has processed all data before it.
void Session::waitVerdict() {
  const auto passed = [&] {
    const std::lock_guard<std::mutex> lock(mutex_);
    return verdict_ && verdict_->condition.empty() && verdict_->header.stamp > cut_from_;
  };
  if (!waitUntil(passed, parameters_.program_timeout)) {
    throw Error(formatted("chatter/state: no verdict on the end of the cut within %.0f s",
                          parameters_.program_timeout));
  }
}

// The end of the session ends the recording, which must contain the last result. A cut that the curve does
// not use, for example one with chatter, is not waited for beyond the limit.
void Session::waitCurve() const {
  const ros::Time limit = ros::Time::now() + ros::Duration(CURVE_WAIT);
  const auto passed = [&] {
    const std::lock_guard<std::mutex> lock(mutex_);
    return curve_stamp_.isZero() || curve_stamp_ > cut_from_ || ros::Time::now() > limit;
  };
  waitUntil(passed, parameters_.program_timeout);
}

std::string Session::identify(bool reset) {
  smartmill_msgs::IdentifyCoefficientsGoal goal;
  goal.tool = parameters_.plan.tool;
  goal.material = plan_.material();
  goal.reset = reset;
  const auto result =
      driver_.call(identify_, names::IDENTIFY_COEFFICIENTS, goal, parameters_.identify_timeout);
  if (!reset) {
    coefficients_stamp_ = result.coefficients.header.stamp;
    log_.summary.coefficients = {fromMsg(result.coefficients)};
  }
  return result.message;
}

std::string Session::waitChart() {
  const auto there = [&] {
    const std::lock_guard<std::mutex> lock(mutex_);
    return chart_ && chart_->header.stamp >= coefficients_stamp_ && chart_->material == plan_.material();
  };
  if (!waitUntil(there, parameters_.chart_timeout)) {
    throw Error(
        formatted("stability/chart: none for these coefficients within %.0f s", parameters_.chart_timeout));
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  used_chart_ = *chart_;
  return formatted("stable below %.3f mm at any speed, %.0f points recommended",
                   used_chart_.absolute_depth_limit / units::MM,
                   static_cast<double>(used_chart_.recommended.size()));
}

std::string Session::choosePoints() {
  std::string reasons;
  const double feed = used_chart_.feed_per_tooth;
  const auto stable = plan_.firstStable(pointsOf(used_chart_.recommended), feed, reasons);
  if (!stable)
    throw Error("no recommended point fits machine and stock" + (reasons.empty() ? "" : ": " + reasons));
  reasons.clear();
  const auto unstable = plan_.firstUnstable(pointsOf(used_chart_.unstable), feed, reasons);
  if (!unstable)
    throw Error("no unstable point fits machine and stock" + (reasons.empty() ? "" : ": " + reasons));
  stable_ = *stable;
  unstable_ = *unstable;
  return "recommended " + pointText(stable_) + ", unstable " + pointText(unstable_);
}

std::string Session::verify(const char* role, const PlannedCut& cut, CutVerdict::Kind predicted) {
  const std::string detail = runCut(cut);
  waitVerdict();
  SessionSummary::Verified verified;
  verified.verdict = verdictOn(cut.condition.name);
  const Point& point = predicted == CutVerdict::Kind::stable ? stable_ : unstable_;
  verified.role = role;
  verified.spindle_speed = cut.condition.spindle_speed;
  verified.axial_depth = point.axial_depth;
  verified.depth_limit = point.depth_limit;
  verified.as_predicted = verified.verdict.kind == predicted;
  log_.summary.verified.push_back(verified);
  const bool hammer = parameters_.plan.hammer;
  const std::string source = hammer ? "the chart" : "the probing cuts", ending = hammer ? "s " : " ";
  return detail + "; " + verified.verdict.text() +
         (verified.as_predicted ? ", as predicted by " + source : ", " + source + " predict" + ending + role);
}

CutVerdict Session::verdictOn(const std::string& condition) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = windows_.find(condition);
  return cutVerdict(found == windows_.end() ? std::vector<ChatterWindow>{} : found->second);
}

// ---------------------------------------------------------------------------------------------- no hammer

// Stability from cuts: each is chosen by what those before have shown.
void Session::learnFromCuts() {
  judgeSlotTests();
  const std::size_t cuts = plan_.probingCuts();
  for (std::size_t k = 0; k < cuts; ++k) {
    const std::string number = std::to_string(k + 1);
    step("choice of probing cut " + number, [&] { return chooseProbingCut(cuts - k); });
    if (std::isnan(next_.spindle_speed)) break;
    action(
        "probing cut " + number, "", [&] { return probe(k); }, true);
  }
  step("recommended cut", [&] { return chooseProbingCut(0); });
  action(
      "cut at the recommended point", "",
      [&] { return verify("stable", plan_.stable(stable_, probing_feed_), CutVerdict::Kind::stable); }, true);
}

// The slot tests have one speed and one depth: they are one judged cut, which chatters if one of them does.
void Session::judgeSlotTests() {
  SessionSummary::Probing all;
  for (const std::size_t i : made_) {
    const CuttingCondition& condition = tests_[i].condition;
    if (condition.kind != CuttingCondition::Kind::cut || !isSlot(condition)) continue;
    const CutVerdict verdict = verdictOn(condition.name);
    const bool worse = verdict.chattering > all.verdict.chattering;
    if (verdict.kind == CutVerdict::Kind::unknown || (!all.name.empty() && !worse)) continue;
    all.name = condition.name;
    all.spindle_speed = condition.spindle_speed;
    all.axial_depth = condition.engagement.axial_depth;
    all.verdict = verdict;
  }
  if (!all.name.empty()) log_.summary.probing.push_back(all);
}

// @param cuts_left 0: only the recommended cut
std::string Session::chooseProbingCut(std::size_t cuts_left) {
  smartmill_msgs::ChooseProbingCut service;
  auto& request = service.request;
  for (const SessionSummary::Probing& cut : log_.summary.probing) {
    if (cut.verdict.kind == CutVerdict::Kind::unknown) continue;
    // An undecided cut is near the limit: no cut to recommend.
    request.spindle_speed.push_back(cut.spindle_speed);
    request.axial_depth.push_back(cut.axial_depth);
    request.chatter.push_back(cut.verdict.kind != CutVerdict::Kind::stable);
    request.chatter_frequency.push_back(cut.verdict.frequency);
  }
  const CoefficientSet& found = log_.summary.coefficients.front();
  request.ktc = found.value.ktc;
  request.ktc_std = found.std_dev.ktc;
  request.kte = found.value.kte;
  request.exit_angle = units::PI;
  request.max_depth = plan_.largestDepth();
  request.cuts_left = static_cast<std::uint32_t>(cuts_left);
  if (!driver_.callService(names::CHOOSE_PROBING_CUT, service, CHOICE_WAIT))
    throw Error(std::string(names::CHOOSE_PROBING_CUT) + ": no answer");
  const auto& answer = service.response;
  if (answer.code != smartmill_msgs::ChooseProbingCut::Response::OK) throw Error(answer.message);
  probing_feed_ = answer.feed_per_tooth;
  const auto text = [](const Point& point, double probability) {
    return formatted("%.0f rpm %.2f mm, stable with a probability of %.0f %%",
                     units::rpmFromRadPerSec(point.spindle_speed), point.axial_depth / units::MM,
                     100.0 * probability);
  };
  if (cuts_left > 0) {
    next_ = {answer.next_speed, answer.next_depth, NOT_A_NUMBER, NOT_A_NUMBER};
    next_probability_ = answer.next_probability;
    if (std::isnan(next_.spindle_speed))
      return std::string("none: no further cut within machine and spindle removes 5 % more");
    return text(next_, next_probability_) + formatted("; chosen in %.1f s", answer.seconds);
  }
  if (std::isnan(answer.recommended_speed))
    throw Error(formatted("no cut is probably stable after %zu cuts", log_.summary.probing.size()));
  stable_ = {answer.recommended_speed, answer.recommended_depth, NOT_A_NUMBER, NOT_A_NUMBER};
  log_.summary.recommended =
      SessionSummary::RecommendedCut{answer.recommended_speed, answer.recommended_depth,
                                     answer.recommended_probability, answer.recommended_probability_std};
  return text(stable_, answer.recommended_probability) + formatted("; chosen in %.1f s", answer.seconds);
}

std::string Session::probe(std::size_t index) {
  const PlannedCut cut = plan_.probing(index, next_, probing_feed_);
  const std::string detail = runCut(cut);
  waitVerdict();
  SessionSummary::Probing made;
  made.name = cut.condition.name;
  made.spindle_speed = cut.condition.spindle_speed;
  made.axial_depth = next_.axial_depth;
  made.probability = next_probability_;
  made.verdict = verdictOn(made.name);
  log_.summary.probing.push_back(made);
  return detail + "; " + made.verdict.text();
}

// ---------------------------------------------------------------------------------------------- control

std::string Session::cutUnderControl(const PlannedCut& cut) {
  const auto follow = [this](bool on) {
    const std::lock_guard<std::mutex> lock(mutex_);
    under_control_ = on;
  };
  follow(true);
  const std::string detail = runCut(cut);
  follow(false);
  waitVerdict();
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::vector<ChatterWindow>& windows = windows_[cut.condition.name];
  // Approach and retraction have other feeds; the windows begin and end with the steady cut.
  std::vector<CutState> states;
  for (const CutState& state : states_) {
    if (!windows.empty() && state.stamp >= windows.front().stamp && state.stamp <= windows.back().stamp)
      states.push_back(state);
  }
  log_.summary.control = controlVerdict(windows, states, cut.condition.spindle_speed, cut.feed);
  return detail + "; " + log_.summary.control->text();
}

// ---------------------------------------------------------------------------------------------- the end

void Session::makeSafe() {
  if (!armed_ || !ros::ok()) return;
  try {
    log_.record("stop", "disarm motion", driver_.makeSafe(stopped_()));
    armed_ = false;
  } catch (const Error& error) {
    log_.record("FAIL", "disarm motion", error.what());
  }
}

}  // namespace smartmill::session
