#include "smartmill_loadmeter/identification/session_identification.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "load_estimator.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/steady_path.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/database/knowledge.h"
#include "smartmill_loadmeter/identification/cut_forces.h"
#include "smartmill_loadmeter/identification/force_coefficients.h"
#include "smartmill_loadmeter/identification/idle_torque.h"
#include "smartmill_loadmeter/motor/joint.h"

namespace smartmill::loadmeter {

namespace {

// One resolution for all tests, because a test whose readings are on few steps does not show it.
void computeMeans(std::vector<LoadTest>* air_cuts, std::vector<LoadTest>* cuts, const Spindle& spindle) {
  std::vector<double> voltages;
  for (const auto* tests : {air_cuts, cuts}) {
    for (const LoadTest& t : *tests) voltages.insert(voltages.end(), t.voltages.begin(), t.voltages.end());
  }
  const double step = resolutionOf(voltages, spindle.load_meter_resolution);
  for (auto* tests : {air_cuts, cuts}) {
    for (LoadTest& t : *tests) {
      if (t.voltages.size() >= 2) t.computeMean(spindle, step);
    }
  }
}

// Mean conditions of the cuts, from which the database measures distances.
void addConditions(const std::vector<LoadTest>& cuts, CoefficientRecord* record) {
  const CuttingCondition& first = cuts.front().condition;
  record->teeth = first.tool.teeth;
  record->diameter = first.tool.diameter;
  record->helix = first.tool.helix;
  record->cutting_speed = record->feed_per_tooth = record->axial_depth = record->entry = record->exit = 0.0;
  const double share = 1.0 / static_cast<double>(cuts.size());
  for (const LoadTest& test : cuts) {
    const Engagement& e = test.condition.engagement;
    record->cutting_speed += share * test.speed * test.condition.tool.radius();
    record->feed_per_tooth += share * e.feed_per_tooth;
    record->axial_depth += share * e.axial_depth;
    record->entry += share * e.entry;
    record->exit += share * e.exit;
    record->set.stamp = std::max(record->set.stamp, test.stamp);
    record->set.tool = test.condition.tool_name;
    record->set.material = test.condition.material;
  }
}

// Air cuts and cuts as records in the order of time; the edge ages with each cut.
std::vector<LoadRecord> recordsOf(const std::vector<LoadTest>& air_cuts, const std::vector<LoadTest>& cuts,
                                  const Spindle& spindle, double noise) {
  struct Entry {
    const LoadTest* test;
    bool cut;
  };
  std::vector<Entry> entries;
  for (const LoadTest& test : air_cuts) entries.push_back({&test, false});
  for (const LoadTest& test : cuts) entries.push_back({&test, true});
  std::stable_sort(entries.begin(), entries.end(),
                   [](const Entry& a, const Entry& b) { return a.test->stamp < b.test->stamp; });
  std::vector<LoadRecord> records;
  std::map<std::string, double> age;
  for (const auto& [test, cut] : entries) {
    double& edge = age[test->condition.tool_name];
    records.push_back(
        loadRecord(*test, cut, spindle, noise, entries.front().test->stamp, edge + 0.5 * test->duration));
    if (cut) edge += test->duration;
  }
  return records;
}

std::string descriptionOf(const LoadRecordResult& found) {
  std::string text;
  for (const std::string& term : found.terms) text += "; with " + term;
  if (found.runout > 0.0) {
    text += formatted("; runout of %.1f um", found.runout / units::UM);
  }
  for (const std::string& note : found.notes) text += "; " + note;
  return text;
}

// Adds radial and axial coefficients; Ktc and Kte remain those of the torque, which account for the common
// friction. @return text for the message.
std::string addMotorCoefficients(const std::vector<LoadTest>& cuts, const IdleTorque& idle,
                                 const Spindle& spindle, CoefficientRecord* record) {
  std::vector<JointMeasurement> readings;
  bool any = false;
  for (const LoadTest& cut : cuts) {
    if (feedTurns(cut.condition)) continue;
    JointMeasurement r;
    r.tool = cut.condition.tool;
    r.engagement = cut.condition.engagement;
    r.heading = headingOf(cut.condition);
    const double watt = spindle.load_meter_gain * cut.speed;
    const Estimate torque{cut.voltage.mean / watt - idle.torque(cut), cut.torqueStdAsVoltage() / watt};
    if (torque.std_dev > 0.0) r.torque = torque;
    if (cut.force) r.axis_force = cut.force->force;
    for (const auto& force : r.axis_force) any = any || force;
    readings.push_back(r);
  }
  if (!any) return "";
  JointResult joint;
  try {
    joint = identifyJointly(readings);
  } catch (const Error& error) {
    return std::string("; motor currents: ") + error.what();
  }
  std::string text;
  addForceCoefficients(joint, record);
  for (const std::string& name : joint.not_observable) text += (text.empty() ? "" : ", ") + name;
  record->set.source = "load_meter and motor_current";
  return text.empty() ? "; all six coefficients observable with motor currents"
                      : "; not observable from the axes that moved: " + text;
}

/// Mean temperature of the spindle motor in tests; the first fault, if any.
TemperatureReading meanTemperature(const std::vector<LoadTest>& tests) {
  TemperatureReading mean;
  double sum = 0.0;
  for (const LoadTest& test : tests) {
    sum += test.temperature.value;  // NaN: unknown
    if (mean.fault.empty() && !test.temperature.fault.empty())
      mean.fault = "test '" + test.condition.name + "': " + test.temperature.fault;
  }
  if (!tests.empty()) mean.value = sum / static_cast<double>(tests.size());
  return mean;
}

/// Temperature of the cuts, to which the coefficients and the friction of the air cuts belong.
/// @return for the message; empty when the controller reports none.
std::string addTemperature(const std::vector<LoadTest>& air_cuts, const std::vector<LoadTest>& cuts,
                           CoefficientRecord* record) {
  const TemperatureReading cut = meanTemperature(cuts), air = meanTemperature(air_cuts);
  record->temperature = cut.value;
  std::string text;
  if (cut.known()) text += formatted("; spindle motor at %.1f K", cut.value);
  if (cut.known() && air.known()) text += formatted(", at %.1f K in the air cuts (friction)", air.value);
  const std::string& fault = cut.fault.empty() ? air.fault : cut.fault;
  if (!fault.empty()) text += "; temperature not recorded: " + fault;
  return text;
}

void addPrior(const CoefficientRecord& prior, IdentifyResult* result) {
  const CombinedRecord both = combine(result->record, prior);
  const double deviation = both.deviation;
  if (!both.agree) {
    result->message += formatted(
        "; stored coefficients (Ktc %.1f +- %.1f N/mm2) not used: the tests deviate by %.1f standard "
        "deviations",
        prior.set.value.ktc / units::N_PER_MM2, prior.set.std_dev.ktc / units::N_PER_MM2, deviation);
    return;
  }
  const double stamp = result->coefficients.stamp;
  result->coefficients = both.record.set;
  result->coefficients.stamp = stamp;
  result->coefficients.source += names::WITH_STORED;
  const CoefficientSet& k = result->coefficients;
  result->message += formatted(
      "; with the stored coefficients, which deviate by %.1f standard deviations: Ktc %.1f +- %.1f N/mm2, "
      "Kte %.2f +- %.2f N/mm",
      deviation, k.value.ktc / units::N_PER_MM2, k.std_dev.ktc / units::N_PER_MM2,
      k.value.kte / units::N_PER_MM, k.std_dev.kte / units::N_PER_MM);
}

}  // namespace

void PriorKnowledge::set(double stamp, const CoefficientSet& set, double ktc_kte_covariance) {
  stamp_ = stamp;
  prior_ = CoefficientRecord();
  prior_.set = set;
  prior_.covariance[CoefficientRecord::covarianceIndex(0, 3)] = ktc_kte_covariance;
}

void PriorKnowledge::use(IdentifyGoal* goal) {
  if (goal->reset) reset_ = goal->stamp;
  const bool same_pair =
      !goal->tool.empty() && prior_.set.tool == goal->tool && prior_.set.material == goal->material;
  if (same_pair && stamp_ > reset_) goal->prior = prior_;
}

std::string countOf(std::size_t n, const char* what) {
  return std::to_string(n) + " " + what + (n == 1 ? "" : "s");
}

SessionResult identifyFromTests(std::vector<LoadTest> air_cuts, std::vector<LoadTest> cuts,
                                const Spindle& spindle, double spindle_uncertainty_percent,
                                double largest_runout, std::size_t least_feeds) {
  computeMeans(&air_cuts, &cuts, spindle);
  double noise2 = 0.0;
  for (const auto* tests : {&air_cuts, &cuts}) {
    for (const LoadTest& t : *tests) noise2 += std::pow(t.torqueStdAsVoltage(), 2);
  }
  const double noise = std::sqrt(noise2 / std::max(1.0, static_cast<double>(air_cuts.size() + cuts.size())));
  LoadRecordOptions options;
  options.runout_uncertainty = largest_runout / std::sqrt(3.0);
  options.least_feeds = least_feeds;
  LoadEstimator estimator(recordsOf(air_cuts, cuts, spindle, noise), spindle, spindle_uncertainty_percent,
                          options, noise, true, "");
  const LoadRecordResult found = estimator.estimate();
  SessionResult result;
  result.record.set = found.set;
  addConditions(cuts, &result.record);
  for (const auto* tests : {&air_cuts, &cuts}) {
    for (const LoadTest& t : *tests)
      result.record.first_stamp = std::fmin(result.record.first_stamp, t.stamp - t.duration);
  }
  const auto index = CoefficientRecord::covarianceIndex;
  result.record.covariance[index(0, 0)] = found.set.std_dev.ktc * found.set.std_dev.ktc;
  result.record.covariance[index(0, 3)] = found.covariance_tc_te;
  result.record.covariance[index(3, 3)] = found.set.std_dev.kte * found.set.std_dev.kte;
  result.found = descriptionOf(found);
  return result;
}

void SessionTests::add(const LoadTest& test) {
  std::vector<LoadTest>& tests = test.isCut() ? cuts : air_cuts;
  if (tests.size() == MOST) {
    tests.erase(tests.begin());
    ++dropped;
  }
  tests.push_back(test);
}

void SessionTests::reject(const std::string& reason) {
  if (rejected.size() == MOST) rejected.erase(rejected.begin());
  rejected.push_back(reason);
}

IdentifyResult identifySession(const SessionTests& session, const IdentifyGoal& goal, const Spindle& spindle,
                               double spindle_uncertainty_percent, double largest_runout) {
  IdentifyResult result;
  result.id = goal.id;
  result.coefficients.value = result.coefficients.std_dev = NOT_IDENTIFIED;
  result.coefficients.stamp = goal.stamp;
  std::vector<LoadTest> cuts;
  for (const LoadTest& test : session.cuts) {
    if ((goal.tool.empty() || test.condition.tool_name == goal.tool) &&
        (goal.material.empty() || test.condition.material == goal.material)) {
      cuts.push_back(test);
    }
  }
  SessionResult found;
  std::string aside;
  if (cuts.size() < session.cuts.size()) {
    aside +=
        "; " + countOf(session.cuts.size() - cuts.size(), "cut") + " with another tool or material ignored";
  }
  if (session.dropped > 0) aside += "; " + countOf(session.dropped, "older test") + " not kept";
  for (const std::string& reason : session.rejected) aside += "; " + reason;
  try {
    found = identifyFromTests(session.air_cuts, cuts, spindle, spindle_uncertainty_percent, largest_runout,
                              goal.prior ? 2 : 3);
  } catch (const Error& error) {
    result.code =
        session.unknown_loads > 0 ? IdentifyResult::Code::bad_data : IdentifyResult::Code::too_few_tests;
    result.message = error.what() + aside;
    return result;
  }
  result.record = found.record;
  const IdleTorque idle = idleTorque(session.air_cuts, spindle, spindle_uncertainty_percent);
  aside = found.found + addMotorCoefficients(cuts, idle, spindle, &result.record) + aside;
  aside += addTemperature(session.air_cuts, cuts, &result.record);
  CoefficientSet& k = result.record.set;
  if (!goal.tool.empty()) k.tool = goal.tool;
  if (!goal.material.empty()) k.material = goal.material;
  result.coefficients = k;
  result.message = formatted("Ktc %.1f +- %.1f N/mm2, Kte %.2f +- %.2f N/mm from %zu air cuts and %zu cuts",
                             k.value.ktc / units::N_PER_MM2, k.std_dev.ktc / units::N_PER_MM2,
                             k.value.kte / units::N_PER_MM, k.std_dev.kte / units::N_PER_MM,
                             session.air_cuts.size(), cuts.size()) +
                   aside;
  if (goal.prior) addPrior(*goal.prior, &result);
  return result;
}

}  // namespace smartmill::loadmeter
