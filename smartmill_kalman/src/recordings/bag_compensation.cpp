#include "recordings/bag_compensation.h"

#include <map>
#include <optional>
#include <utility>

#include "node/rotation.h"
#include "node/wiring.h"
#include "recordings/frame_tree.h"
#include "smartmill_core/error.h"
#include "smartmill_core/frames.h"
#include "smartmill_recording/recording_reader.h"

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

/// Turns cuts into the machine's frame as soon as the bag has told how the sensor sits; until then they wait.
class Turner {
 public:
  Turner(RecordingReader& bag, std::function<void(BagCut&&)> done) : done_(std::move(done)) {
    for (const char* topic : {"/tf_static", "/tf"}) {
      bag.on<plain::TFMessage>(topic, [this](const plain::TFMessage& message, double) {
        for (const plain::TransformStamped& transform : message.transforms) frames_.add(transform);
      });
    }
  }
  void setFrame(const std::string& frame) { frame_ = frame; }
  bool known() const { return frames_.rotation(frames::MACHINE, frame_).has_value(); }
  void take(BagCut&& cut) {
    waiting_.push_back(std::move(cut));
    if (known()) release();
  }
  /// Those that nothing is known of stay in the sensor's own frame.
  void release() {
    std::array<double, 9> rotation{{1, 0, 0, 0, 1, 0, 0, 0, 1}};
    if (const auto known = frames_.rotation(frames::MACHINE, frame_))
      rotation = frames::rotationMatrix(*known);
    for (BagCut& cut : waiting_) {
      for (auto* force : {&cut.measured, &cut.compensated}) rotateInPlace(rotation, *force);
      done_(std::move(cut));
    }
    waiting_.clear();
  }

 private:
  std::function<void(BagCut&&)> done_;
  FrameTree frames_;
  std::string frame_ = frames::DYNAMOMETER;
  std::vector<BagCut> waiting_;
};

/// A method that wants the whole cut, in place of what came sample by sample.
void compensateWhole(BagCut& cut, Method method, const CompensationPipeline& sorted,
                     const HarmonicFilterParameters& parameters) {
  // The others come as the node makes them.
  if ((method != Method::smoother && method != Method::inverse) || !(cut.speed > 0.0)) return;
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
  RecordingReader bag(path);
  Turner turner(bag, done);
  std::optional<CompensationPipeline> sorted;
  Cutter cutter([&](BagCut&& cut) {
    ++summary.cuts;
    compensateWhole(cut, method, *sorted, parameters.compensation.filter);
    turner.take(std::move(cut));
  });
  sorted.emplace(parameters.compensation, parameters.taps, sensor, parameters.hold_back,
                 CompensationPipeline::Outputs{
                     [&](const ForceBlock& measured, const ForceBlock& compensated) {
                       cutter.blocks(measured, compensated, sorted->health().speed);
                     },
                     {},
                     {},
                     [&](const SensorResult& result) { summary.identified.push_back(result); }});
  useFiles(*sorted, parameters);
  std::size_t blocks = 0;
  bag.on<plain::SampleBlock>(parameters.force_input, [&](const plain::SampleBlock& m, double) {
    if (blocks++ == 0 && !m.header.frame_id.empty()) turner.setFrame(m.header.frame_id);
    sorted->push(fromMsg(m));
  });
  connect(bag, *sorted);
  bag.on<CuttingCondition>(names::CUTTING_CONDITION, [&](const CuttingCondition& condition, double) {
    cutter.condition(condition);
    sorted->push(condition);
  });
  feed<MeasuredModes>(bag, names::TOOL_MODES, *sorted);
  bag.on<plain::MeasureFrfActionGoal>(names::goals(names::MEASURE_SENSOR_FRF),
                                      [&](const plain::MeasureFrfActionGoal& m, double received) {
                                        sorted->push(goalFromMsg(m.goal, received));
                                      });
  bag.run(progress);
  summary.duration = bag.duration();
  if (blocks == 0) throw Error(path + ": holds no " + parameters.force_input);
  sorted->flush();
  cutter.close();
  turner.release();
  summary.rotation_known = turner.known();
  summary.gaps = sorted->health().gaps;
  summary.not_finite = sorted->health().not_finite;
  summary.late = sorted->late();
  return summary;
}

}  // namespace smartmill::kalman
