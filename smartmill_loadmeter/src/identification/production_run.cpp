#include "smartmill_loadmeter/identification/production_run.h"

#include <algorithm>
#include <cmath>

namespace smartmill::loadmeter {

std::optional<CoefficientRecord> ProductionRun::add(const LoadTest& cut,
                                                    const std::optional<Estimate>& torque, double own_std) {
  if (!torque || !(own_std > 0.0)) return std::nullopt;
  const CuttingCondition& c = cut.condition;
  const std::string of = c.tool_name + "\n" + c.material;
  if (!estimate_ || of != of_) {
    estimate_.emplace(RecursiveCoefficients::Start(), memory_);
    of_ = of;
  }
  const double friction_std = std::sqrt(std::max(0.0, torque->std_dev * torque->std_dev - own_std * own_std));
  estimate_->update({c.tool, c.engagement, torque->value, own_std, cut.duration, friction_std});
  double& age = edge_age_[c.tool_name];
  age += cut.duration;

  CoefficientRecord record;
  record.set.stamp = cut.stamp;
  record.set.tool = c.tool_name;
  record.set.material = c.material;
  record.set.source = SOURCE_PRODUCTION;
  record.set.tests = 1;
  record.set.value = record.set.std_dev = NOT_IDENTIFIED;
  const double alone = std::sqrt(static_cast<double>(estimate_->readings()));
  record.set.value.ktc = estimate_->ktc(), record.set.std_dev.ktc = alone * estimate_->ktcStd();
  record.set.value.kte = estimate_->kte(), record.set.std_dev.kte = alone * estimate_->kteStd();
  record.covariance[CoefficientRecord::covarianceIndex(0, 0)] = std::pow(record.set.std_dev.ktc, 2);
  record.covariance[CoefficientRecord::covarianceIndex(3, 3)] = std::pow(record.set.std_dev.kte, 2);
  record.covariance[CoefficientRecord::covarianceIndex(0, 3)] = alone * alone * estimate_->covariance();
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
