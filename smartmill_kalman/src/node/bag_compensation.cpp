#include "node/bag_compensation.h"

#include <map>
#include <optional>
#include <utility>

#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/MeasureFrfActionGoal.h>
#include <smartmill_msgs/ModalModel.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include "node/rotation.h"
#include "node/wiring.h"
#include "smartmill_core/error.h"
#include "smartmill_ros/bag_reader.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/goals.h"

namespace smartmill::kalman {
namespace {

/// Cuts the compensated blocks at the conditions' stamps.
class Cutter {
 public:
  explicit Cutter(std::function<void(BagCut&&)> done) : done_(std::move(done)) {}

  void condition(const CuttingCondition& condition) { conditions_[condition.stamp] = condition; }

  void blocks(const ForceBlock& measured, const ForceBlock& compensated, double speed) {
    for (std::size_t i = 0; i < measured.force[0].size(); ++i) {
      const double time = measured.stamp + static_cast<double>(i) / measured.sample_rate;
      turnTo(time);
      if (!cut_) continue;
      cut_->sample_rate = measured.sample_rate;
      if (speed > 0.0) cut_->speed = speed;
      cut_->offset.push_back(time - cut_->stamp);
      if (compensated.status != ForceBlock::Status::compensated) cut_->settling += 1.0 / measured.sample_rate;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        cut_->measured[axis].push_back(measured.force[axis][i]);
        cut_->compensated[axis].push_back(compensated.force[axis][i]);
      }
    }
  }

  void close() {
    if (cut_ && !cut_->offset.empty()) done_(std::move(*cut_));
    cut_.reset();
  }

 private:
  void turnTo(double time) {
    auto next = conditions_.upper_bound(time);
    if (next == conditions_.begin()) return;
    --next;
    if (current_ && *current_ == next->first) return;
    close();
    current_ = next->first;
    if (next->second.kind != CuttingCondition::Kind::cut) return;
    cut_ = BagCut();
    cut_->name = next->second.name;
    cut_->stamp = next->first;
  }

  std::function<void(BagCut&&)> done_;
  std::map<double, CuttingCondition> conditions_;  // by stamp
  std::optional<double> current_;                  // [s] stamp of the condition that holds
  std::optional<BagCut> cut_;
};

/// Transforms of a whole bag: they hold also for blocks that came before them.
class BagTransforms {
 public:
  explicit BagTransforms(const std::string& path) {
    BagReader bag(path);
    for (const bool is_static : {true, false}) {
      bag.on<tf2_msgs::TFMessage>(is_static ? "/tf_static" : "/tf",
                                  [this, is_static](const tf2_msgs::TFMessage& message, double) {
                                    for (const auto& transform : message.transforms)
                                      buffer_.setTransform(transform, "bag", is_static);
                                  });
    }
    bag.run();
  }
  /// Rotation of a frame into the machine's, row-major; nothing when the bag does not tell.
  std::optional<std::array<double, 9>> toMachine(const std::string& frame) const {
    if (!buffer_.canTransform(frames::MACHINE, frame, ros::Time(0))) return {};
    return frames::rotationMatrix(
        buffer_.lookupTransform(frames::MACHINE, frame, ros::Time(0)).transform.rotation);
  }

 private:
  tf2::BufferCore buffer_;
};

/// A method that wants the whole cut, in place of what came sample by sample.
void compensateWhole(BagCut& cut, Method method, const SortedCompensation& sorted,
                     const HarmonicFilterParameters& parameters) {
  if (method == Method::kalman || method == Method::fixed_lag || !(cut.speed > 0.0)) return;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    cut.compensated[axis] = compensateRecord(method, cut.measured[axis], sorted.sensor(axis), cut.speed,
                                             cut.sample_rate, parameters);
  }
}

}  // namespace

BagSummary compensateBag(const std::string& path, const ForceSensor& sensor, const NodeParameters& parameters,
                         Method method, const std::function<void(BagCut&&)>& done,
                         const std::function<void(double)>& progress) {
  BagSummary summary;
  const BagTransforms transforms(path);
  std::array<double, 9> rotation{{1, 0, 0, 0, 1, 0, 0, 0, 1}};
  std::optional<SortedCompensation> sorted;
  Cutter cutter([&](BagCut&& cut) {
    ++summary.cuts;
    compensateWhole(cut, method, *sorted, parameters.compensation.filter);
    for (auto* force : {&cut.measured, &cut.compensated}) rotateInPlace(rotation, *force);
    done(std::move(cut));
  });
  sorted.emplace(
      parameters.compensation, parameters.taps, sensor, parameters.hold_back,
      SortedCompensation::Outputs{[&](const ForceBlock& measured, const ForceBlock& compensated) {
                                    cutter.blocks(measured, compensated, sorted->health().speed);
                                  },
                                  {},
                                  {},
                                  [&](const SensorResult& result) { summary.identified.push_back(result); }});
  useFiles(*sorted, parameters);
  BagReader bag(path);
  summary.duration = bag.duration();
  std::size_t blocks = 0;
  bag.on<smartmill_msgs::SampleBlock>(
      parameters.force_input, [&](const smartmill_msgs::SampleBlock& m, double) {
        if (blocks++ == 0) {
          const auto found =
              transforms.toMachine(m.header.frame_id.empty() ? frames::DYNAMOMETER : m.header.frame_id);
          summary.rotation_known = found.has_value();
          rotation = found.value_or(rotation);
        }
        sorted->push(fromMsg(m));
      });
  connect(bag, *sorted);
  bag.on<smartmill_msgs::CuttingCondition>(names::CUTTING_CONDITION,
                                           [&](const smartmill_msgs::CuttingCondition& m, double) {
                                             const CuttingCondition condition = fromMsg(m);
                                             cutter.condition(condition);
                                             sorted->push(condition);
                                           });
  feed<smartmill_msgs::ModalModel>(bag, names::TOOL_MODES, *sorted);
  bag.on<smartmill_msgs::MeasureFrfActionGoal>(
      names::goals(names::MEASURE_SENSOR_FRF),
      [&](const smartmill_msgs::MeasureFrfActionGoal& m, double received) {
        sorted->push(goalFromMsg(m.goal, received));
      });
  bag.run(progress);
  if (blocks == 0) throw Error(path + ": holds no " + parameters.force_input);
  sorted->flush();
  cutter.close();
  summary.gaps = sorted->health().gaps;
  summary.not_finite = sorted->health().not_finite;
  summary.late = sorted->late();
  return summary;
}

}  // namespace smartmill::kalman
