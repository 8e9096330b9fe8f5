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

/// What the controller's load meter showed during a stretch.
struct LoadReading {
  double time = 0.0;  ///< [s] since the stretch began
  double load = 0.0;  ///< [1] of full scale
};

/// A stretch of steady cutting, or of the spindle turning in air, as a test of a campaign.
struct Stretch {
  double stamp = 0.0;  ///< [s] of its end
  /// In cut throughout: running_before is stated. start_time counts from the first input, cut_time_before
  /// what was cut steadily since.
  CampaignTest test;
  Record record;  ///< time, spindle_angle, fx, fy, fz
  std::vector<LoadReading> load;
};

struct StretchParameters {
  double length = 0.3;
  double settle = 0.15;
  double path_tolerance = 1.0e-4;

  void declare(ParameterTable& table) {
    table.number("length", length, "s", Range::openLow(0.1, 60.0),
                 "of a stretch of steady cutting that is judged at once");
    table.number("settle", settle, "s", Range::notNegative(),
                 "left out after the machine has come to steady motion: the vibrations of the entry");
    table.number("path_tolerance", path_tolerance, "m", Range::positive(),
                 "beside the condition's line that is still steady");
  }
};

/// Cuts the streams of a running machine into stretches of equal length: condition, controller state, spindle
/// angle, force sensor and load meter in stamp order.
class StretchRecorder {
 public:
  StretchRecorder(const StretchParameters& parameters, std::function<void(const Stretch&)> deliver);

  void handle(const CuttingCondition& condition);
  void handle(const CncState& state);
  void handle(const SpindleAngle& angle);
  void handle(const SampleBlock& dynamometer);
  void handle(const LoadSample& load);
  void reset();

 private:
  // How the spindle turned: angle [rad] at a moment, and speed [rad/s].
  struct Turning {
    double phase = 0.0, speed = 0.0;
  };
  void finish();
  std::optional<Turning> evenTurning(double begin, double end) const;
  CampaignTest testOf(double begin, double speed) const;
  Record recordOf(const std::string& name, const Turning& turning) const;
  void unsteady();
  void forget();

  StretchParameters parameters_;
  std::function<void(const Stretch&)> deliver_;
  std::optional<CuttingCondition> condition_;
  std::optional<double> steady_since_;  // [s]
  std::optional<double> first_;         // [s] stamp of the first samples
  double cut_time_ = 0.0;               // [s] of steady cutting that is over
  std::deque<SpindleAngle> angles_;
  std::deque<SampleBlock> blocks_;
  std::deque<LoadSample> loads_;
  std::deque<Stretch> unconfirmed_;  // until the controller says that the motion went on as it was
};

/// The same behind a sorter, for a node and for a bag alike.
class SegmentPipeline {
 public:
  SegmentPipeline(const StretchParameters& parameters, double hold_back,
                  std::function<void(const Stretch&)> deliver);

  void push(const CuttingCondition& condition);
  void push(const CncState& state);
  void push(const SpindleAngle& angle);
  void push(const SampleBlock& dynamometer);
  void push(const LoadSample& load);
  void flush() { sorter_.flush(); }

 private:
  StretchRecorder recorder_;
  StreamSorter sorter_;
  StreamSorter::Stream conditions_, states_, angles_, blocks_, loads_;
};

}  // namespace smartmill::discrepancy
