#include "smartmill_loadmeter/identification/force_curve_identification.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/steady_path.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

void MeanRevolution::add(double angle, double fx, double fy) {
  double turn = std::fmod(angle / units::TWO_PI, 1.0);
  if (turn < 0.0) turn += 1.0;
  Bin& bin = bins_[std::min(static_cast<std::size_t>(turn * BINS), BINS - 1)];
  bin.count += 1.0;
  bin.angle += turn * units::TWO_PI;
  bin.fx += fx;
  bin.fy += fy;
  bin.square += fx * fx + fy * fy;
  count_ += 1.0;
}

AngleRecord MeanRevolution::record() const {
  AngleRecord record;
  for (const Bin& bin : bins_) {
    if (bin.count == 0.0) continue;
    record.angle.push_back(bin.angle / bin.count);
    record.fx.push_back(bin.fx / bin.count);
    record.fy.push_back(bin.fy / bin.count);
  }
  return record;
}

double MeanRevolution::restless() const {
  double all = 0.0, repeated = 0.0, fx = 0.0, fy = 0.0;
  for (const Bin& bin : bins_) {
    if (bin.count == 0.0) continue;
    all += bin.square;
    repeated += (bin.fx * bin.fx + bin.fy * bin.fy) / bin.count;
    fx += bin.fx;
    fy += bin.fy;
  }
  const double variance = all - (fx * fx + fy * fy) / count_;
  return variance > 0.0 ? (all - repeated) / variance : 0.0;
}

ForceCurveIdentification::ForceCurveIdentification(const CurveParameters& parameters)
    : parameters_(parameters) {
  checkBounds(parameters_);
}

void ForceCurveIdentification::reset() {
  condition_.reset();
  samples_.clear();
  angles_.clear();
  steady_since_.reset();
  steady_until_.reset();
  last_state_ = last_sample_ = rotation_ = 0.0;
  revolution_ = {};
  cuts_.clear();
}

void ForceCurveIdentification::handle(const CuttingCondition& condition) {
  // A latched condition is received again when a subscriber reconnects.
  if (condition_ && condition_->stamp == condition.stamp && condition_->name == condition.name) return;
  closeCut();
  condition_ = condition;
  // The rotation is counted from here, so that its rounding does not depend on the uptime.
  if (!angles_.empty())
    angles_.assign(1, {angles_.back().time, angles_.back().measured, angles_.back().measured});
}

void ForceCurveIdentification::handle(const CncState& state) {
  const bool gap = state.stamp - last_state_ > parameters_.maximum_gap;
  last_state_ = state.stamp;
  const bool steady = condition_ && condition_->kind == CuttingCondition::Kind::cut && state.connected &&
                      state.feed > 0.0 && onSteadyPath(*condition_, state, parameters_.path_tolerance);
  if (!steady || gap) steady_since_.reset();
  if (!steady) {
    // No later state can mark these samples as steady.
    while (!samples_.empty() && samples_.front().time < state.stamp - parameters_.maximum_gap)
      samples_.pop_front();
    return;
  }
  if (!steady_since_) steady_since_ = state.stamp;
  steady_until_ = state.stamp;
  accumulate();
}

void ForceCurveIdentification::handle(const SpindleAngle& angle) {
  if (!std::isfinite(angle.angle) || !std::isfinite(angle.speed)) return;
  if (!angles_.empty() && angle.stamp - angles_.back().time > parameters_.maximum_gap) angles_.clear();
  if (angles_.empty()) {
    angles_.push_back({angle.stamp, angle.angle, angle.angle});
    return;
  }
  if (!(angle.stamp > angles_.back().time)) return;
  angles_.push_back(angles_.back().next(angle));
  while (angles_.size() > 2 &&
         angles_[1].time < angle.stamp - 2.0 * parameters_.maximum_gap - parameters_.settle_time)
    angles_.pop_front();
}

void ForceCurveIdentification::handle(const ForceBlock& block) {
  if (!block.isCompensated()) {
    samples_.clear();
    return;
  }
  for (std::size_t i = 0; i < block.force[0].size(); ++i) {
    if (std::isfinite(block.force[0][i] + block.force[1][i]))
      samples_.push_back(
          {block.stamp + static_cast<double>(i) / block.sample_rate, block.force[0][i], block.force[1][i]});
  }
}

// Samples between two steady states, away from the ends of the engagement.
void ForceCurveIdentification::accumulate() {
  if (angles_.size() < 2) return;
  const double from = std::max(*steady_since_ + parameters_.settle_time, angles_.front().time);
  const double to = std::min(*steady_until_ - parameters_.settle_time, angles_.back().time);
  const auto& a = condition_->steady_from;
  const auto& b = condition_->steady_to;
  const double heading = std::atan2(b[1] - a[1], b[0] - a[0]), c = std::cos(heading), s = std::sin(heading);
  std::size_t at = 1;
  double first = 0.0, last = 0.0;
  bool any = false;
  while (!samples_.empty() && samples_.front().time <= to) {
    const Sample sample = samples_.front();
    samples_.pop_front();
    if (sample.time < from) continue;
    while (at + 1 < angles_.size() && angles_[at].time < sample.time) ++at;
    const double rotation = angles_[at - 1].between(angles_[at], sample.time);
    // The immersion angle is measured from the normal of the feed; forces along and across the feed.
    revolution_.add(rotation + heading, c * sample.fx + s * sample.fy, -s * sample.fx + c * sample.fy);
    if (!any) first = rotation;
    any = true;
    last = rotation;
    last_sample_ = sample.time;
  }
  rotation_ += last - first;
}

void ForceCurveIdentification::closeCut() {
  const MeanRevolution revolution = revolution_;
  const double revolutions = rotation_ / units::TWO_PI;
  revolution_ = {};
  rotation_ = 0.0;
  samples_.clear();
  steady_since_.reset();
  steady_until_.reset();
  if (!condition_ || condition_->kind != CuttingCondition::Kind::cut) return;
  const auto reject = [&](const std::string& why) {
    if (on_rejected_) on_rejected_("'" + condition_->name + "': " + why);
  };
  if (revolutions < parameters_.least_revolutions) {
    if (revolution.count() > 0.0)
      reject(formatted("%.1f steady revolutions, expected at least %d", revolutions,
                       parameters_.least_revolutions));
    return;
  }
  if (revolution.restless() > parameters_.restless) {
    reject(formatted("%.0f %% of the force is not synchronous with the spindle (chatter?)",
                     100.0 * revolution.restless()));
    return;
  }
  if (!condition_->engagement.bands.empty()) return reject("the engagement changes over the height");
  Cut cut{last_sample_, condition_->name, revolution.record()};
  cut.record.engagement = condition_->engagement;
  std::vector<Cut>& cuts = cuts_[{condition_->tool_name, condition_->material}];
  if (cuts.size() >= static_cast<std::size_t>(parameters_.most_cuts)) cuts.erase(cuts.begin());
  cuts.push_back(std::move(cut));
  try {
    fitCurves(cuts);
  } catch (const Error& error) {
    reject(error.what());
  }
}

void ForceCurveIdentification::fitCurves(const std::vector<Cut>& cuts) {
  if (!on_curves_) return;
  IdentifiedForceCurves found;
  std::vector<AngleRecord> records;
  for (const Cut& cut : cuts) {
    records.push_back(cut.record);
    found.cuts.push_back(cut.name);
  }
  found.stamp = cuts.back().stamp;
  found.tool = condition_->tool_name;
  found.material = condition_->material;
  found.teeth = condition_->tool.teeth;
  found.curves = fitForceCurves(records, condition_->tool, parameters_.pieces);
  widen(found.curves, parameters_.gain_error);
  on_curves_(found);
}

// Force and angle are optional, so that nothing waits for them when they are missing.
ForceCurvePipeline::ForceCurvePipeline(const CurveParameters& parameters, double hold_back)
    : identification_(parameters),
      sorter_(hold_back),
      conditions_(sorter_.addLatched(names::CUTTING_CONDITION)),
      states_(sorter_.addRegular(names::CNC_STATE)),
      angles_(sorter_.addOptional(names::SPINDLE_ANGLE)),
      blocks_(sorter_.addOptional(names::FORCE_COMPENSATED)) {
  sorter_.onRestart([this] { identification_.reset(); });
}

}  // namespace smartmill::loadmeter
