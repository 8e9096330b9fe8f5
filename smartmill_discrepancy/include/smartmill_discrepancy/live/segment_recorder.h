#pragma once

#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::discrepancy {

/// A load meter value during a segment.
struct LoadMeasurement {
  double time = 0.0;  ///< [s] from the start of the segment
  double load = 0.0;  ///< [1] of full scale
};

/// Record segment of steady cutting or air cutting, as a test of a campaign.
struct RecordSegment {
  double stamp = 0.0;  ///< [s] of its end
  /// In cut throughout: running_before is stated. start_time counts from the first input. cut_time_before
  /// is that of the condition; without it the steady cutting time since the first input.
  CampaignTest test;
  ToolGeometry tool;  ///< as the condition states it
  Record record;      ///< time, spindle_angle, fx, fy, fz
  std::vector<LoadMeasurement> load;
};

/// Force that is compared with the twin.
enum class ComparedForce {
  measured,     ///< output of the dynamometer; the twin has the modes of the sensor
  compensated,  ///< force on the tool, of any force sensor; the twin has none
};

struct SegmentParameters {
  double length = 0.3;
  double settle = 0.15;
  double path_tolerance = 1.0e-4;

  void declare(ParameterTable& table) {
    table.number("length", length, "s", Range::openLow(0.1, 60.0), "length of a segment of steady cutting");
    table.number("settle", settle, "s", Range::notNegative(),
                 "omitted at the start of steady motion: the vibrations of the entry decay");
    table.number("path_tolerance", path_tolerance, "m", Range::positive(),
                 "maximum distance from the condition's path in steady motion");
  }
};

/// When a motion is steady; the same on every machine.
struct SteadinessOptions {
  double speed = 0.02;         ///< [1] of the stated spindle speed
  double angle = 0.02;         ///< [rad] from constant speed
  double confirmation = 0.05;  ///< [s] of steady motion after a segment: the controller's state may be late
  double history = 1.0;        ///< [s] of angles and loads in addition to the length of a segment
};

/// Cuts the streams of a running machine into segments of equal length: condition, controller state, spindle
/// angle, force sensor and load meter in stamp order.
class SegmentRecorder {
 public:
  SegmentRecorder(const SegmentParameters& parameters, std::function<void(const RecordSegment&)> deliver,
                  const SteadinessOptions& limits = {});

  void handle(const CuttingCondition& condition);
  void handle(const CncState& state);
  void handle(const SpindleAngle& angle);
  void handle(const SampleBlock& forces);
  /// A block that is not compensated throughout ends the segment as lost samples do.
  void handle(const ForceBlock& compensated);
  void handle(const LoadSample& load);
  void reset();

 private:
  // Angle [rad] at the start and speed [rad/s] of the spindle.
  struct SpindleRotation {
    double phase = 0.0, speed = 0.0;
  };
  void finish();
  std::optional<SpindleRotation> steadyRotation(double begin, double end) const;
  CampaignTest testOf(double begin, double speed) const;
  Record recordOf(const std::string& name, const SpindleRotation& rotation) const;
  void restartSegment();
  void dropCondition();

  SegmentParameters parameters_;
  SteadinessOptions limits_;
  std::function<void(const RecordSegment&)> deliver_;
  std::optional<CuttingCondition> condition_;
  std::optional<double> steady_since_;  // [s]
  std::optional<double> first_;         // [s] stamp of the first samples
  double cut_time_ = 0.0;               // [s] of steady cutting before the current motion
  std::deque<SpindleAngle> angles_;
  std::deque<SampleBlock> blocks_;
  std::deque<LoadSample> loads_;
  std::deque<RecordSegment> unconfirmed_;  // until the controller confirms that the motion continued
};

/// The recorder behind a stream sorter, for a node and for a bag.
class SegmentPipeline {
 public:
  SegmentPipeline(const SegmentParameters& parameters, ComparedForce compared, double hold_back,
                  std::function<void(const RecordSegment&)> deliver);

  void push(const CuttingCondition& condition);
  void push(const CncState& state);
  void push(const SpindleAngle& angle);
  void push(const SampleBlock& dynamometer);
  void push(const ForceBlock& compensated);
  void push(const LoadSample& load);
  ComparedForce compared() const { return compared_; }
  void flush() { sorter_.flush(); }

 private:
  ComparedForce compared_;
  SegmentRecorder recorder_;
  StreamSorter sorter_;
  StreamSorter::Stream conditions_, states_, angles_, blocks_, loads_;
};

}  // namespace smartmill::discrepancy
