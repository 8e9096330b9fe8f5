#include "node/node.h"

#include <geometry_msgs/WrenchStamped.h>
#include <smartmill_msgs/ForceEstimate.h>

#include <cmath>
#include <utility>

#include "node/find_message.h"
#include "node/fleet_message.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/names.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/database/recommend.h"
#include "smartmill_loadmeter/inspection/inspection_evidence.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::loadmeter {

namespace {

constexpr double WATCH_PERIOD = 0.2;  // [s]

MachineModel modelOf(const NodeParameters& parameters) {
  if (parameters.model.empty()) throw Error("model: expected the path of a smartmill-model/1 file");
  return readMachineModel(parameters.model);
}

}  // namespace

LoadMeterNode::LoadMeterNode(ros::NodeHandle nh, ros::NodeHandle private_nh)
    : parameters_(parametersFromServer(private_nh).readAll<NodeParameters>()),
      shell_(nh, private_nh, "spindle load meter", parameters_.input_timeout),
      model_(modelOf(parameters_)),
      identification_(model_, parameters_.identification, parameters_.hold_back),
      curves_(parameters_.curve, parameters_.hold_back),
      opened_(openDatabase(parameters_.database, parameters_.machine, parameters_.model,
                           DataFolders::ofEnvironment())),
      database_(*opened_.database),
      server_(
          nh, names::IDENTIFY_COEFFICIENTS, [this](Server::GoalHandle handle) { goal(handle); },
          [this](Server::GoalHandle handle) { cancel(handle); }, false),
      axis_drives_(nh, parameters_.input_timeout) {
  reportDatabase(private_nh);
  IdentificationOutputs& outputs = identification_.identification().outputs();
  outputs.result = [this](const IdentifyResult& result) { finish(result); };
  outputs.test = [this](const LoadTest& test) {
    ROS_INFO("test '%s': %.4f +- %.4f V at %.1f rad/s from %d readings", test.condition.name.c_str(),
             test.voltage.mean, test.voltage.std_dev, test.speed, test.readings);
    feedback();
  };
  if (parameters_.keep_cuts) outputs.cut = [this](const CoefficientRecord& cut) { store(cut); };
  coefficients_ =
      std::make_unique<LatchedTopic<smartmill_msgs::CuttingCoefficients>>(nh, names::COEFFICIENTS);
  useMotors(parameters_, identification_.identification().forces());
  if (parameters_.usesMotors()) {
    outputs.motor_force = [this](const MotorForce& force) { publish(force); };
    force_publisher_ = nh.advertise<geometry_msgs::WrenchStamped>(names::FORCE_OF_MOTORS, 10, true);
  }
  outputs.force = [this](const ForceEstimate& force) { report(force); };
  outputs.force_window = [this](const ForceEstimate& force) { publish(force); };
  estimate_publisher_ = nh.advertise<smartmill_msgs::ForceEstimate>(names::FORCE_ESTIMATE, 10, true);
  if (parameters_.force_curve) {
    curve_publisher_ = nh.advertise<smartmill_msgs::ForceCurve>(names::FORCE_CURVE, 1, true);
    curves_.identification().onCurves([this](const IdentifiedForceCurves& found) { publish(found); });
    curves_.identification().onRejected(
        [](const std::string& why) { ROS_WARN("force curve: %s", why.c_str()); });
  }
  outputs.inspected = [this](const InspectionResult& inspected) { store(inspected); };
  connect(shell_.inputs(), parameters_, streams_);
  connectInspection(shell_.inputs(), identification_);
  connectCurves(shell_.inputs(), parameters_, streams_);
  find_service_ = nh.advertiseService(names::FIND_COEFFICIENTS, &LoadMeterNode::find, this);
  recommend_service_ = nh.advertiseService(names::RECOMMEND_CUT, &LoadMeterNode::recommend, this);
  prior_subscriber_ = nh.subscribe<smartmill_msgs::CoefficientPrior>(
      names::COEFFICIENT_PRIOR, 1, [this](const smartmill_msgs::CoefficientPrior::ConstPtr& prior) {
        prior_.set(toSec(prior->header.stamp), fromMsg(prior->coefficients), prior->ktc_kte_covariance);
      });
  discovered_ = nh.subscribe<smartmill_msgs::DiscoverActionResult>(
      std::string(names::DISCOVER) + "/result", 10,
      [this](const smartmill_msgs::DiscoverActionResult::ConstPtr& result) { store(*result); });
  health_ = nh.subscribe<smartmill_msgs::SpindleHealth>(
      names::SPINDLE_HEALTH, 100,
      [this](const smartmill_msgs::SpindleHealth::ConstPtr& health) { store(*health); });
  shell_.diagnose("load meter", [this](auto& status) { diagnose(status); });
  shell_.every(WATCH_PERIOD, [this] { watch(); });
  if (!parameters_.fleet.empty()) {
    if (!opened_.problem.empty()) throw Error("fleet: requires a database to push; " + opened_.problem);
    fleet_publisher_ = nh.advertise<smartmill_msgs::FleetState>(names::FLEET_STATE, 1, true);
    pusher_ = std::make_unique<FleetPusher>(opened_.file, parameters_.fleet, parameters_.fleet_period);
  }
  server_.start();
}

// The parameter `database` becomes the file in use, so that `rosparam get` says where the records are.
void LoadMeterNode::reportDatabase(const ros::NodeHandle& private_nh) const {
  if (opened_.problem.empty())
    private_nh.setParam("database", opened_.file.empty() ? DATABASE_NONE : opened_.file);
  if (!opened_.problem.empty()) {
    ROS_WARN("database: %s", opened_.problem.c_str());
  } else if (opened_.file.empty()) {
    ROS_INFO("database: none, records of this run only");
  } else {
    ROS_INFO("database: %s (%zu records)", opened_.file.c_str(), database_.size());
  }
}

// Mean force of a cut on the tool; NaN: not observable.
void LoadMeterNode::publish(const MotorForce& force) {
  geometry_msgs::WrenchStamped message;
  message.header.stamp = fromSec(force.stamp);
  message.header.frame_id = frames::MACHINE;
  const auto valueOf = [](const std::optional<Estimate>& e) { return e ? e->value : NOT_A_NUMBER; };
  message.wrench.force.x = valueOf(force.force[0]);
  message.wrench.force.y = valueOf(force.force[1]);
  message.wrench.force.z = valueOf(force.force[2]);
  message.wrench.torque.x = message.wrench.torque.y = NOT_A_NUMBER;
  message.wrench.torque.z = valueOf(force.torque);
  force_publisher_.publish(message);
  last_force_ = "'" + force.name + "': " + force.text();
  if (!force.by_other_method.empty()) last_force_ += "; " + force.by_other_method;
  ROS_INFO("motors, test %s", last_force_.c_str());
}

void LoadMeterNode::publish(const ForceEstimate& force) {
  smartmill_msgs::ForceEstimate message;
  message.header.stamp = fromSec(force.stamp);
  message.header.frame_id = frames::MACHINE;
  message.cut = force.name;
  message.duration = force.duration;
  const auto fill = [](const std::array<Estimate, 3>& from, auto& value, auto& std_dev) {
    value.x = from[0].value, value.y = from[1].value, value.z = from[2].value;
    std_dev.x = from[0].std_dev, std_dev.y = from[1].std_dev, std_dev.z = from[2].std_dev;
  };
  fill(force.mean, message.mean, message.mean_std);
  fill(force.rms, message.rms, message.rms_std);
  for (const ForceLine& line : force.lines) {
    message.line_frequency.push_back(line.frequency);
    fill(line.amplitude, message.line_amplitude.emplace_back(), message.line_std.emplace_back());
  }
  message.torque = force.torque.value;
  message.torque_std = force.torque.std_dev;
  message.surprise = force.chi_square;
  message.sources = force.sources;
  estimate_publisher_.publish(message);
}

void LoadMeterNode::report(const ForceEstimate& force) {
  publish(force);
  ROS_INFO("force, test '%s': %s", force.name.c_str(), force.text().c_str());
}

void LoadMeterNode::publish(const IdentifiedForceCurves& found) {
  curve_publisher_.publish(toMsg(found));
  const ForceCurve& curve = found.curves.tangential;
  const double chip = 0.5 * curve.knots.back();
  last_curve_ =
      formatted("%s in %s, %zu cuts: %.2f +- %.2f N/mm tangential at a chip of %.4f mm", found.tool.c_str(),
                found.material.c_str(), found.cuts.size(), curve.at(chip) / units::N_PER_MM,
                curve.stdAt(chip) / units::N_PER_MM, chip / units::MM);
  ROS_INFO("force curve, %s", last_curve_.c_str());
}

void LoadMeterNode::goal(Server::GoalHandle handle) {
  const auto request = handle.getGoal();
  IdentifyGoal goal;
  // Without a stamp the goal has the time at which the client sent it.
  const ros::Time stamp = request->header.stamp.isZero() ? handle.getGoalID().stamp : request->header.stamp;
  goal.stamp = toSec(stamp);
  goal.tool = request->tool;
  goal.material = request->material;
  goal.reset = request->reset;
  goal.id = next_id_++;
  prior_.use(&goal);
  handle.setAccepted();
  waiting_[goal.id] = handle;
  feedback();
  identification_.push(goal);
}

void LoadMeterNode::cancel(Server::GoalHandle handle) {
  for (auto waiting = waiting_.begin(); waiting != waiting_.end(); ++waiting) {
    if (!(waiting->second == handle)) continue;
    smartmill_msgs::IdentifyCoefficientsResult result;
    result.code = smartmill_msgs::IdentifyCoefficientsResult::CANCELLED;
    result.message = "cancelled";
    handle.setCanceled(result, result.message);
    waiting_.erase(waiting);
    return;
  }
}

void LoadMeterNode::finish(const IdentifyResult& result) {
  const bool found = result.code == IdentifyResult::Code::ok && !result.reset;
  smartmill_msgs::IdentifyCoefficientsResult message;
  message.code = static_cast<std::uint8_t>(result.code);
  message.message = result.message;
  message.coefficients = toMsg(result.coefficients);
  last_message_ = result.message;
  if (result.code == IdentifyResult::Code::ok) {
    ROS_INFO("%s", result.message.c_str());
  } else {
    ROS_WARN("%s", result.message.c_str());
  }
  if (found) {
    coefficients_->publish("last", message.coefficients);
    CoefficientRecord record = result.record;
    record.machine = parameters_.machine;
    if (!keep("coefficients", [this, record] { database_.add(record); }))
      message.message += "; not stored yet: " + records_.problem();
  }
  const auto waiting = waiting_.find(result.id);
  if (waiting == waiting_.end()) return;
  if (result.code == IdentifyResult::Code::ok) {
    waiting->second.setSucceeded(message, message.message);
  } else {
    waiting->second.setAborted(message, message.message);
  }
  waiting_.erase(waiting);
}

void LoadMeterNode::feedback() {
  smartmill_msgs::IdentifyCoefficientsFeedback message;
  message.stage = "collecting";
  message.air_cuts = static_cast<std::uint32_t>(identification_.identification().airCuts().size());
  message.cuts = static_cast<std::uint32_t>(identification_.identification().cuts().size());
  for (auto& [id, handle] : waiting_) handle.publishFeedback(message);
}

bool LoadMeterNode::find(smartmill_msgs::FindCoefficients::Request& request,
                         smartmill_msgs::FindCoefficients::Response& response) {
  std::vector<CuttingCondition> tests;
  for (const smartmill_msgs::CuttingCondition& test : request.tests) tests.push_back(fromMsg(test));
  try {
    const FoundCoefficients found =
        findCoefficients(database_, request.tool, request.material, tests, model_);
    response = toMsg(found);
    if (!request.candidates.empty()) {
      fill(chooseCuts(found, choiceOf(request, std::move(tests)), identification_.identification().airCuts(),
                      parameters_.identification.timeWithoutReadings(*model_.spindle), model_),
           &response);
    }
  } catch (const Error& error) {
    response = toMsg(FoundCoefficients());
    response.message = error.what();
  }
  response.database = opened_.file;
  return true;
}

bool LoadMeterNode::recommend(smartmill_msgs::RecommendCut::Request& request,
                              smartmill_msgs::RecommendCut::Response& response) {
  using Response = smartmill_msgs::RecommendCut::Response;
  CoefficientSet unknown;
  unknown.value = unknown.std_dev = NOT_IDENTIFIED;
  response.coefficients = toMsg(unknown);
  response.code = Response::NOT_FOUND;
  response.ktc_lower = response.ktc_upper = response.surprise = NOT_A_NUMBER;
  CoefficientQuery query;
  query.tool = request.tool;
  query.material = request.material;
  query.rake = request.rake;
  query.helix = request.helix;
  query.diameter = request.diameter;
  query.cutting_speed = request.cutting_speed;
  query.feed_per_tooth = request.feed_per_tooth;
  try {
    const std::optional<CutRecommendation> answer = recommendCut(database_, query);
    if (!answer) {
      response.message = "no records in '" + request.material + "'; known: " + database_.contents();
      return true;
    }
    response.code = Response::OK;
    response.message = answer->message;
    response.way = static_cast<std::uint8_t>(answer->method);
    response.coefficients = toMsg(answer->set);
    response.ktc_lower = answer->ktc_lower;
    response.ktc_upper = answer->ktc_upper;
    response.surprise = answer->disagreement;
  } catch (const Error& error) {
    response.message = error.what();
  }
  return true;
}

LoadMeterNode::~LoadMeterNode() {
  records_.retry();
  if (records_.size() > 0)
    ROS_ERROR("database: %s lost, as the node ends: %s", countOf(records_.size(), "record").c_str(),
              records_.problem().c_str());
}

// @return whether it is stored; otherwise it waits until the database takes it
bool LoadMeterNode::keep(const char* what, WaitingRecords::Store store) {
  const std::size_t lost = records_.lost();
  if (records_.add(std::move(store))) return true;
  ROS_ERROR("database: %s not stored yet, in all %s: %s", what, countOf(records_.size(), "record").c_str(),
            records_.problem().c_str());
  if (records_.lost() > lost) ROS_ERROR("database: the oldest record is lost, %zu in all", records_.lost());
  return false;
}

void LoadMeterNode::retryStoring() {
  const std::size_t stored = records_.retry();
  if (stored > 0) ROS_INFO("database: %s stored after waiting", countOf(stored, "record").c_str());
}

void LoadMeterNode::store(CoefficientRecord cut) {
  cut.machine = parameters_.machine;
  keep("cut", [this, cut] { stored_cuts_ += database_.add(cut); });
}

// The report contains the evidence, whichever node explained.
void LoadMeterNode::store(const smartmill_msgs::DiscoverActionResult& discovered) {
  if (discovered.result.verdict.empty()) return;
  try {
    ModelImprovement improvement = readImprovement(discovered.result.report);
    improvement.machine = parameters_.machine;
    improvement.stamp = discovered.header.stamp.toSec();
    keep("explanation", [this, improvement] {
      stored_explanations_ += database_.evidence().add(std::vector<ModelImprovement>{improvement});
    });
  } catch (const Error& error) {
    ROS_ERROR("database: explanation not stored: %s", error.what());
  }
}

void LoadMeterNode::store(const smartmill_msgs::SpindleHealth& health) {
  std::vector<HealthRecord> records;
  for (const smartmill_msgs::HealthChange& c : health.changes) {
    HealthRecord r;
    r.machine = parameters_.machine;
    r.measured = health.measured;
    r.quantity = c.quantity;
    r.stamp = health.header.stamp.toSec();
    r.days = health.days;
    r.first = c.first;
    r.now = c.now;
    r.deviations = c.deviations;
    r.drifted = c.drifted ? 1.0 : 0.0;
    records.push_back(r);
  }
  keep("spindle health", [this, records] { stored_health_ += database_.evidence().add(records); });
}

void LoadMeterNode::store(InspectionResult inspected) {
  refused_inspection_ = inspected.refusal;
  if (!refused_inspection_.empty()) {
    ROS_WARN("inspection refused: %s", refused_inspection_.c_str());
    return;
  }
  InspectionRecord& record = inspected.record;
  record.machine = parameters_.machine;
  try {
    const std::string why = setDeflection(inspected.condition, model_, database_, &record);
    if (!why.empty())
      ROS_INFO("inspection, '%s': not corrected for deflection: %s", record.condition.c_str(), why.c_str());
    if (!inspected.note.empty())
      ROS_WARN("inspection, '%s': %s", record.condition.c_str(), inspected.note.c_str());
    const EvidenceRecords evidence = database_.evidence();
    keep("inspection", [this, record] {
      stored_inspections_ += database_.evidence().add(std::vector<InspectionRecord>{record});
    });
    last_inspection_.clear();
    for (const std::string& line :
         inspectionEvidence(evidence.inspections(record.tool), parameters_.identification.inspection)
             .lines()) {
      ROS_INFO("inspection, %s", line.c_str());
      last_inspection_ += (last_inspection_.empty() ? "" : "; ") + line;
    }
  } catch (const Error& error) {
    refused_inspection_ = "'" + record.condition + "': not stored: " + error.what();
    ROS_ERROR("inspection: %s", refused_inspection_.c_str());
  }
}

// Publishes the state after every push.
void LoadMeterNode::publishFleetState() {
  if (!pusher_) return;
  const FleetPusher::State state = pusher_->state();
  if (state.tries == published_fleet_state_) return;
  published_fleet_state_ = state.tries;
  smartmill_msgs::FleetState message = toMsg(state, parameters_.fleet);
  message.header.stamp = ros::Time::now();
  fleet_publisher_.publish(message);
}

// Liveness: when all inputs have stopped, nothing can precede the waiting ones.
void LoadMeterNode::watch() {
  retryStoring();
  publishFleetState();
  axis_drives_.watch();
  if (!shell_.inputs().any().dead()) return;
  if (!waiting_.empty())
    ROS_WARN_THROTTLE(5.0, "controller state and load have stopped: using the data received");
  identification_.flush();
  curves_.flush();
}

void LoadMeterNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  const Watchdog& inputs = shell_.inputs().any();
  if (!inputs.ever()) {
    status.summary(Level::WARN, "waiting for cnc/state and cnc/load");
  } else if (inputs.dead()) {
    status.summaryf(Level::ERROR, "no input for %.1f s", inputs.silent());
  } else {
    status.summary(Level::OK, "listening");
  }
  LoadMeterIdentification& identification = identification_.identification();
  status.add("air cuts", identification.airCuts().size());
  status.add("cuts", identification.cuts().size());
  if (const auto& production = identification.production()) {
    status.add("production tool", identification.productionTool());
    status.addf("production Ktc [N/mm2]", "%.1f +- %.1f", production->ktc() / units::N_PER_MM2,
                production->ktcStd() / units::N_PER_MM2);
    status.addf("production Kte [N/mm]", "%.2f +- %.2f", production->kte() / units::N_PER_MM,
                production->kteStd() / units::N_PER_MM);
    status.addf("last cut's normalised innovation", "%.1f sigma", production->normalisedInnovation());
    status.addf("scatter of the cuts over that stated", "%.1f", production->misfit());
    if (!(production->ktc() > 0.0))
      status.mergeSummaryf(Level::WARN,
                           "production with %s: Ktc %.0f N/mm2, expected > 0; its cuts are not stored",
                           identification.productionTool().c_str(), production->ktc() / units::N_PER_MM2);
  }
  const TemperatureWatch& temperature = identification.temperature();
  const std::string temperature_fault = temperature.fault(identification_.newest());
  if (!temperature_fault.empty()) {
    status.add("spindle motor temperature [K]", temperature_fault);
    status.mergeSummary(Level::WARN, temperature_fault);
  } else if (temperature.ever() && std::isfinite(temperature.newest())) {
    status.addf("spindle motor temperature [K]", "%.1f", temperature.newest());
  } else {
    status.add("spindle motor temperature [K]", "not reported");
  }
  if (!last_force_.empty()) status.add("force by motor currents", last_force_);
  if (!last_curve_.empty()) status.add("force curve", last_curve_);
  status.add("database", opened_.file.empty() ? "records of this run only" : opened_.file);
  if (!opened_.problem.empty()) status.mergeSummary(Level::WARN, "database: " + opened_.problem);
  if (records_.size() > 0) {
    status.add("records that wait for the database", records_.size());
    status.mergeSummary(Level::ERROR, "database: " + records_.problem());
  }
  if (records_.lost() > 0) status.add("records lost", records_.lost());
  status.add("cuts stored", stored_cuts_);
  status.add("explanations stored", stored_explanations_);
  status.add("spindle-health quantities stored", stored_health_);
  status.add("inspected dimensions stored", stored_inspections_);
  if (!last_inspection_.empty()) status.add("inspection", last_inspection_);
  if (!refused_inspection_.empty()) {
    status.add("inspection refused", refused_inspection_);
    status.mergeSummary(Level::WARN, "inspection refused: " + refused_inspection_);
  }
  if (pusher_) {
    const FleetPusher::State fleet = pusher_->state();
    status.add("not sent to the fleet [records]", fleet.behind);
    status.add("fleet", fleet.message);
    if (fleet.failing && fleet.behind > 0) status.mergeSummary(Level::WARN, "fleet: " + fleet.message);
  }
  status.add("late inputs", identification_.late());
  status.add("waiting for", identification_.waitingFor());
  status.add("last result", last_message_);
}

}  // namespace smartmill::loadmeter

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<loadmeter::LoadMeterNode>(argc, argv, "loadmeter");
}
