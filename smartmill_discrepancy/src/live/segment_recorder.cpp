#include "smartmill_discrepancy/live/segment_recorder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "smartmill_core/math/running_line.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/signal/steady_path.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

/// Whether a campaign can state a cut: a feed in the plane of the table (on a ramp the end face cuts as well)
/// and one engagement over the whole depth.
bool isPlain(const CuttingCondition& condition) {
  constexpr double LEVEL = 1e-3;  // [1]
  const auto& from = condition.steady_from;
  const auto& to = condition.steady_to;
  return condition.engagement.bands.empty() &&
         std::abs(to[2] - from[2]) <= LEVEL * std::hypot(to[0] - from[0], to[1] - from[1]);
}

}  // namespace

SegmentRecorder::SegmentRecorder(const SegmentParameters& parameters,
                                 std::function<void(const RecordSegment&)> deliver,
                                 const SteadinessOptions& limits)
    : parameters_(parameters), limits_(limits), deliver_(std::move(deliver)) {
}

void SegmentRecorder::reset() {
  dropCondition();
  first_.reset();
  cut_time_ = 0.0;
  angles_.clear();
  loads_.clear();
}

void SegmentRecorder::dropCondition() {
  condition_.reset();
  restartSegment();
}

void SegmentRecorder::restartSegment() {
  steady_since_.reset();
  blocks_.clear();
  unconfirmed_.clear();
}

void SegmentRecorder::handle(const CuttingCondition& condition) {
  dropCondition();
  condition_ = condition;
}

void SegmentRecorder::handle(const CncState& state) {
  if (!condition_ || !condition_->isSteady()) return;
  const bool cut = condition_->kind == CuttingCondition::Kind::cut;
  const bool path =
      !cut || (isPlain(*condition_) && onSteadyPath(*condition_, state, parameters_.path_tolerance));
  const bool steady = path && std::abs(state.spindle_speed / condition_->spindle_speed - 1.0) < limits_.speed;
  if (steady && !steady_since_) steady_since_ = state.stamp;
  if (!steady && steady_since_) {
    if (cut) cut_time_ += state.stamp - *steady_since_;
    restartSegment();
  }
  while (!unconfirmed_.empty() && state.stamp >= unconfirmed_.front().stamp + limits_.confirmation) {
    const RecordSegment segment = std::move(unconfirmed_.front());
    unconfirmed_.pop_front();
    deliver_(segment);
  }
}

void SegmentRecorder::handle(const SpindleAngle& angle) {
  angles_.push_back(angle);
  while (angles_.front().stamp < angle.stamp - parameters_.length - limits_.history) angles_.pop_front();
}

void SegmentRecorder::handle(const LoadSample& load) {
  loads_.push_back(load);
  while (loads_.front().stamp < load.stamp - parameters_.length - limits_.history) loads_.pop_front();
}

void SegmentRecorder::handle(const SampleBlock& forces) {
  if (forces.size() == 0) return;
  if (!first_) first_ = forces.stamp;
  if (!steady_since_ || forces.stamp < *steady_since_ + parameters_.settle) return;
  const bool gap =
      !blocks_.empty() && forces.first_index != blocks_.back().first_index + blocks_.back().size();
  if (gap) blocks_.clear();
  blocks_.push_back(forces);
  // Stamps are rounded: half a sample is enough.
  const double length = forces.timeOf(forces.size()) - blocks_.front().stamp;
  if (length >= parameters_.length - 0.5 / forces.sample_rate) finish();
}

void SegmentRecorder::handle(const ForceBlock& compensated) {
  SampleBlock block;
  block.stamp = compensated.stamp;
  block.sample_rate = compensated.sample_rate;
  block.first_index = compensated.first_index;
  block.channels = {FORCE_CHANNELS.begin(), FORCE_CHANNELS.end()};
  block.units.assign(FORCE_CHANNELS.size(), "N");
  bool valid = compensated.isCompensated();
  for (std::size_t i = 0; i < compensated.force[0].size(); ++i) {
    for (const std::vector<double>& axis : compensated.force) {
      valid = valid && std::isfinite(axis[i]);
      block.samples.push_back(axis[i]);
    }
  }
  if (valid) {
    handle(block);
  } else {
    blocks_.clear();
  }
}

// Linear fit of the angles of a segment; nothing if the speed is not constant.
std::optional<SegmentRecorder::SpindleRotation> SegmentRecorder::steadyRotation(double begin,
                                                                                double end) const {
  RunningLine line;  // [rad] over [s]
  double unwrapped = 0.0, last = 0.0, last_stamp = 0.0;
  for (const SpindleAngle& a : angles_) {
    if (a.stamp < begin || a.stamp > end) continue;
    if (line.count() == 0) {
      unwrapped = a.angle;
    } else {
      const double expected = a.speed * (a.stamp - last_stamp);
      unwrapped += expected + std::remainder(a.angle - last - expected, units::TWO_PI);
    }
    last = a.angle;
    last_stamp = a.stamp;
    line.add(a.stamp - begin, unwrapped);
  }
  if (line.count() < 3 || !line.isDetermined()) return {};
  SpindleRotation rotation;
  rotation.speed = line.slope();
  rotation.phase = line.level();
  const bool is_steady = std::all_of(angles_.begin(), angles_.end(), [&](const SpindleAngle& a) {
    const double expected = line.at(a.stamp - begin);
    return a.stamp < begin || a.stamp > end ||
           std::abs(std::remainder(a.angle - expected, units::TWO_PI)) < limits_.angle;
  });
  if (!is_steady) return {};
  return rotation;
}

CampaignTest SegmentRecorder::testOf(double begin, double speed) const {
  CampaignTest test;
  test.name = condition_->name;
  test.file = condition_->name + ".csv";
  test.kind = condition_->kind == CuttingCondition::Kind::air ? TestKind::air : TestKind::cut;
  test.sample_rate = blocks_.front().sample_rate;
  test.spindle_speed = speed;
  test.running_before = begin - *steady_since_;
  test.start_time = begin - *first_;
  if (test.kind == TestKind::cut) {
    test.engagement = condition_->engagement;
    test.feed_direction = headingOf(*condition_);
    test.cut_time_before = std::isnan(condition_->cut_time_before)
                               ? cut_time_ + *test.running_before
                               : condition_->cut_time_before + begin - condition_->stamp;
  }
  return test;
}

Record SegmentRecorder::recordOf(const std::string& name, const SpindleRotation& rotation) const {
  Record record;
  record.file = name;
  std::vector<double> angle;
  std::array<std::vector<double>, 3> force;
  for (const SampleBlock& b : blocks_) {
    const std::array<std::size_t, 3> channel{{b.channel("fx"), b.channel("fy"), b.channel("fz")}};
    for (std::size_t i = 0; i < b.size(); ++i) {
      const double t = static_cast<double>(record.time.size()) / blocks_.front().sample_rate;
      record.time.push_back(t);
      const double a = std::fmod(rotation.phase + rotation.speed * t, units::TWO_PI);
      angle.push_back(a < 0.0 ? a + units::TWO_PI : a);
      for (std::size_t axis = 0; axis < 3; ++axis) force[axis].push_back(b.at(i, channel[axis]));
    }
  }
  record.add("spindle_angle") = std::move(angle);
  record.add("fx") = std::move(force[0]);
  record.add("fy") = std::move(force[1]);
  record.add("fz") = std::move(force[2]);
  return record;
}

void SegmentRecorder::finish() {
  const double begin = blocks_.front().stamp, end = blocks_.back().timeOf(blocks_.back().size());
  if (const std::optional<SpindleRotation> rotation = steadyRotation(begin, end)) {
    RecordSegment segment;
    segment.stamp = end;
    segment.test = testOf(begin, rotation->speed);
    segment.tool = condition_->tool;
    segment.record = recordOf(segment.test.name, *rotation);
    for (const LoadSample& l : loads_) {
      if (l.stamp >= begin && l.stamp <= end && std::isfinite(l.spindle_load))
        segment.load.push_back({l.stamp - begin, l.spindle_load});
    }
    unconfirmed_.push_back(std::move(segment));
  }
  blocks_.clear();
}

SegmentPipeline::SegmentPipeline(const SegmentParameters& parameters, ComparedForce compared,
                                 double hold_back, std::function<void(const RecordSegment&)> deliver)
    : compared_(compared),
      recorder_(parameters, std::move(deliver)),
      sorter_(hold_back),
      conditions_(sorter_.addLatched(names::CUTTING_CONDITION)),
      states_(sorter_.addRegular(names::CNC_STATE)),
      angles_(sorter_.addRegular(names::SPINDLE_ANGLE)),
      blocks_(sorter_.addRegular(compared == ComparedForce::measured ? names::DYNAMOMETER
                                                                     : names::FORCE_COMPENSATED)),
      // Absent from some machines: waited for only by the hold-back.
      loads_(sorter_.addUnawaited(names::CNC_LOAD)) {
  sorter_.onRestart([this] { recorder_.reset(); });
}

void SegmentPipeline::push(const CuttingCondition& condition) {
  sorter_.push(conditions_, condition.stamp, [this, condition] { recorder_.handle(condition); });
}

void SegmentPipeline::push(const CncState& state) {
  sorter_.push(states_, state.stamp, [this, state] { recorder_.handle(state); });
}

void SegmentPipeline::push(const SpindleAngle& angle) {
  sorter_.push(angles_, angle.stamp, [this, angle] { recorder_.handle(angle); });
}

void SegmentPipeline::push(const SampleBlock& dynamometer) {
  sorter_.push(blocks_, dynamometer.stamp, [this, dynamometer] { recorder_.handle(dynamometer); });
}

void SegmentPipeline::push(const ForceBlock& compensated) {
  sorter_.push(blocks_, compensated.stamp, [this, compensated] { recorder_.handle(compensated); });
}

void SegmentPipeline::push(const LoadSample& load) {
  sorter_.push(loads_, load.stamp, [this, load] { recorder_.handle(load); });
}

}  // namespace smartmill::discrepancy
