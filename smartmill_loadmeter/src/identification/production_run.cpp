#include "smartmill_loadmeter/identification/production_run.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/steady_path.h"
#include "smartmill_loadmeter/identification/force_coefficients.h"

namespace smartmill::loadmeter {

/// The coefficients of all cuts within the memory.
void ProductionRun::addForces(const LoadTest& cut, const Estimate& torque, const MeanForce& force,
                              CoefficientRecord* record) {
  constexpr std::size_t MOST = 500;  // [cuts]
  if (!force.any()) return;
  std::deque<ForceCut>& cuts = force_cuts_[of_];
  JointMeasurement measured;
  measured.tool = cut.condition.tool;
  measured.engagement = cut.condition.engagement;
  measured.heading = headingOf(cut.condition);
  measured.torque = torque;
  measured.axis_force = force.axis;
  cuts.push_back({measured, cut.duration});
  double time = 0.0;
  for (const ForceCut& one : cuts) time += one.time;
  while (cuts.size() > MOST || (cuts.size() > 1 && time - cuts.front().time > memory_)) {
    time -= cuts.front().time;
    cuts.pop_front();
  }
  std::vector<JointMeasurement> all;
  for (const ForceCut& one : cuts) all.push_back(one.measured);
  try {
    JointResult joint = identifyJointly(all, force.gain_error);
    // Those of one of the cuts, as of the torque.
    const auto alone = static_cast<double>(all.size());
    for (const CuttingKey& key : cuttingKeys()) joint.std_dev.*key.coefficient *= std::sqrt(alone);
    for (double& c : joint.covariance) c *= alone;
    addForceCoefficients(joint, record);
  } catch (const Error&) {
    // Nothing is observable from one cut.
  }
}

std::optional<CoefficientRecord> ProductionRun::add(const LoadTest& cut,
                                                    const std::optional<Estimate>& torque, double own_std,
                                                    const MeanForce& force) {
  if (!torque || !(own_std > 0.0)) return std::nullopt;
  const CuttingCondition& c = cut.condition;
  of_ = {c.tool_name, c.material};
  std::optional<RecursiveCoefficients>& estimate = estimates_[of_];
  if (!estimate) estimate.emplace(RecursiveCoefficients::Start(), memory_);
  const double friction_std = std::sqrt(std::max(0.0, torque->std_dev * torque->std_dev - own_std * own_std));
  estimate->update({c.tool, c.engagement, torque->value, own_std, cut.duration, friction_std});
  double& age = edge_age_[c.tool_name];
  age += cut.duration;
  if (!(estimate->ktc() > 0.0)) return std::nullopt;

  CoefficientRecord record;
  record.set.stamp = cut.stamp;
  record.set.tool = c.tool_name;
  record.set.material = c.material;
  record.set.source = SOURCE_PRODUCTION;
  record.set.tests = 1;
  record.set.value = record.set.std_dev = NOT_IDENTIFIED;
  const double alone = std::sqrt(static_cast<double>(estimate->readings()));
  record.set.value.ktc = estimate->ktc(), record.set.std_dev.ktc = alone * estimate->ktcStd();
  record.set.value.kte = estimate->kte(), record.set.std_dev.kte = alone * estimate->kteStd();
  record.covariance[CoefficientRecord::covarianceIndex(0, 0)] = std::pow(record.set.std_dev.ktc, 2);
  record.covariance[CoefficientRecord::covarianceIndex(3, 3)] = std::pow(record.set.std_dev.kte, 2);
  record.covariance[CoefficientRecord::covarianceIndex(0, 3)] = alone * alone * estimate->covariance();
  addForces(cut, *torque, force, &record);
  record.teeth = c.tool.teeth;
  record.diameter = c.tool.diameter;
  record.helix = c.tool.helix;
  record.cutting_speed = 0.5 * c.tool.diameter * cut.speed;
  record.feed_per_tooth = c.engagement.feed_per_tooth;
  record.axial_depth = c.engagement.axial_depth;
  record.entry = c.engagement.entry;
  record.exit = c.engagement.exit;
  record.edge_age = age;
  record.temperature = cut.temperature.value;
  return record;
}

}  // namespace smartmill::loadmeter
