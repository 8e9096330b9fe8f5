#include "recordings/bag_compensation.h"

#include <map>
#include <optional>
#include <utility>

#include "node/calibration_goal.h"
#include "node/rotation.h"
#include "node/wiring.h"
#include "recordings/frame_tree.h"
#include "smartmill_core/error.h"
#include "smartmill_core/frames.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::kalman {
namespace {

/// Splits force blocks into cuts at the stamps of the cutting conditions.
class CutSplitter {
 public:
  explicit CutSplitter(std::function<void(BagCut&&)> output) : output_(std::move(output)) {}

  void addCondition(const CuttingCondition& condition) { conditions_[condition.stamp] = condition; }

  void addMeasured(const ForceBlock& block) { measured_ = block; }
  /// Compensated block of the same samples.
  void addCompensated(const ForceBlock& block, const SensorForces& forces) {
    const double speed = forces.health().speed;
    for (std::size_t i = 0; i < block.force[0].size(); ++i) {
      const double time = block.stamp + static_cast<double>(i) / block.sample_rate;
      startCutAt(time);
      if (!cut_) continue;
      cut_->sample_rate = block.sample_rate;
      if (speed > 0.0) cut_->speed = speed;
      if (i == 0 && !forces.hasDefaultForceModel()) cut_->force_model = forces.forceModel();
      cut_->offset.push_back(time - cut_->stamp);
      if (!block.isCompensated()) cut_->settling += 1.0 / block.sample_rate;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        cut_->measured[axis].push_back(measured_.force[axis][i]);
        cut_->compensated[axis].push_back(block.force[axis][i]);
      }
    }
  }

  void close() {
    if (cut_ && !cut_->offset.empty()) output_(std::move(*cut_));
    cut_.reset();
  }

 private:
  /// Switches to the condition in force at a time [s].
  void startCutAt(double time) {
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

  std::function<void(BagCut&&)> output_;
  std::map<double, CuttingCondition> conditions_;  // by stamp
  std::optional<double> current_;                  // [s] stamp of the condition in force
  std::optional<BagCut> cut_;
  ForceBlock measured_;
};

/// Rotates cuts into the machine's frame. They wait until the recording has given the sensor's transform.
class FrameTransformer {
 public:
  FrameTransformer(RecordingReader& bag, std::function<void(BagCut&&)> output) : output_(std::move(output)) {
    for (const char* topic : {"/tf_static", "/tf"}) {
      bag.on<plain::TFMessage>(topic, [this](const plain::TFMessage& message, double) {
        for (const plain::TransformStamped& transform : message.transforms) frames_.add(transform);
      });
    }
  }
  void setFrame(const std::string& frame) { frame_ = frame; }
  bool isKnown() const { return frames_.rotation(frames::MACHINE, frame_).has_value(); }
  void add(BagCut&& cut) {
    waiting_.push_back(std::move(cut));
    if (isKnown()) flush();
  }
  /// Without a transform the cuts stay in the sensor's frame.
  void flush() {
    std::array<double, 9> rotation{{1, 0, 0, 0, 1, 0, 0, 0, 1}};
    if (const auto known = frames_.rotation(frames::MACHINE, frame_))
      rotation = frames::rotationMatrix(*known);
    for (BagCut& cut : waiting_) {
      for (auto* force : {&cut.measured, &cut.compensated}) rotateInPlace(rotation, *force);
      output_(std::move(cut));
    }
    waiting_.clear();
  }

 private:
  std::function<void(BagCut&&)> output_;
  FrameTree frames_;
  std::string frame_ = frames::DYNAMOMETER;
  std::vector<BagCut> waiting_;
};

/// Replaces the forces of a cut where the method needs the whole record; the pipeline runs the others.
void compensateWholeCut(BagCut& cut, Method method, const CompensationPipeline& pipeline,
                        const HarmonicFilterParameters& parameters) {
  if (!needsWholeRecord(method) || !(cut.speed > 0.0)) return;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    cut.compensated[axis] = compensateRecord(method, cut.measured[axis], pipeline.forces().sensor(axis),
                                             cut.speed, cut.sample_rate, parameters);
  }
}

}  // namespace

BagSummary compensateBag(const std::string& path, const ForceSensor& sensor, const NodeParameters& parameters,
                         Method method, const PulseTachometerParameters& tachometer_parameters,
                         const std::function<void(BagCut&&)>& done,
                         const std::function<void(double)>& progress) {
  BagSummary summary;
  RecordingReader bag(path);
  FrameTransformer transformer(bag, done);
  std::optional<CompensationPipeline> pipeline;
  CutSplitter splitter([&](BagCut&& cut) {
    ++summary.cuts;
    compensateWholeCut(cut, method, *pipeline, parameters.compensationOfSensor().filter);
    transformer.add(std::move(cut));
  });
  CompensationPipeline::Outputs outputs;
  outputs.force.measured = [&](const ForceBlock& block) { splitter.addMeasured(block); };
  outputs.force.compensated = [&](const ForceBlock& block) {
    splitter.addCompensated(block, pipeline->forces());
  };
  outputs.result = [&](const SensorResult& result) { summary.identified.push_back(result); };
  pipeline.emplace(parameters.compensationOfSensor(), parameters.taps, sensor, parameters.hold_back,
                   std::move(outputs));
  loadSensorFiles(*pipeline, parameters);
  std::size_t blocks = 0;
  bag.on<plain::SampleBlock>(parameters.input(), [&](const plain::SampleBlock& m, double) {
    if (blocks++ == 0 && !m.header.frame_id.empty()) transformer.setFrame(m.header.frame_id);
    pipeline->push(fromMsg(m));
  });
  connect(bag, *pipeline);
  // A recording of the pulses alone.
  PulseTachometer tachometer(tachometer_parameters);
  if (!bag.has(names::SPINDLE_ANGLE) && bag.has(names::TACHOMETER)) {
    bag.on<SampleBlock>(names::TACHOMETER, [&](const SampleBlock& block, double) {
      for (const PulseReading& reading : tachometer.push(block)) pipeline->push(reading.angle);
      if (const std::string fault = tachometer.takeFault(); !fault.empty()) summary.tachometer_fault = fault;
    });
    summary.pulses = tachometer.counts();
  }
  bag.on<CuttingCondition>(names::CUTTING_CONDITION, [&](const CuttingCondition& condition, double) {
    splitter.addCondition(condition);
    pipeline->push(condition);
  });
  feed<MeasuredModes>(bag, names::TOOL_MODES, *pipeline);
  bag.on<plain::MeasureFrfActionGoal>(names::goals(names::MEASURE_SENSOR_FRF),
                                      [&](const plain::MeasureFrfActionGoal& m, double received) {
                                        pipeline->push(goalFromMsg(m.goal, received));
                                      });
  bag.on<plain::CalibrateForceSensorActionGoal>(
      names::goals(names::CALIBRATE_SENSOR),
      [&](const plain::CalibrateForceSensorActionGoal& m, double received) {
        pipeline->push(calibrationGoal(m.goal, toSec(m.goal.header.stamp), received));
      });
  bag.run(progress);
  summary.duration = bag.duration();
  if (blocks == 0) throw Error(path + ": topic " + parameters.input() + " not found");
  if (pipeline->forces().isUncalibrated()) {
    throw Error(path + ": the force sensor (" + parameters.sensor +
                ") is not calibrated: no goal of kalman/calibrate with step FIT, no calibration file");
  }
  pipeline->flush();
  splitter.close();
  transformer.flush();
  summary.rotation_known = transformer.isKnown();
  summary.gaps = pipeline->forces().health().gaps;
  summary.not_finite = pipeline->forces().health().not_finite;
  summary.late = pipeline->sorter().late();
  if (summary.pulses) summary.pulses = tachometer.counts();
  return summary;
}

}  // namespace smartmill::kalman
