#pragma once

#include <deque>
#include <functional>
#include <optional>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::discrepancy {

/// A stretch of steady cutting, or of the spindle turning in air, as a test of a campaign.
struct Stretch {
  double stamp = 0.0;  ///< [s] of its end
  CampaignTest test;   ///< no engage_time: in cut throughout
  Record record;       ///< time, spindle_angle, fx, fy, fz
};

/// Cuts the streams of a running machine into stretches of equal length: condition, controller state, spindle
/// angle and force sensor in stamp order.
class StretchRecorder {
 public:
  /// @param length [s] of a stretch. @param path_tolerance [m] beside the condition's line
  StretchRecorder(double length, double path_tolerance, std::function<void(const Stretch&)> deliver);

  void handle(const CuttingCondition& condition);
  void handle(const CncState& state);
  void handle(const SpindleAngle& angle);
  void handle(const SampleBlock& dynamometer);
  void reset();

 private:
  void finish();

  double length_, path_tolerance_;
  std::function<void(const Stretch&)> deliver_;
  std::optional<CuttingCondition> condition_;
  bool steady_ = false;
  std::deque<SpindleAngle> angles_;
  std::deque<SampleBlock> blocks_;
};

/// The same behind a sorter, for a node and for a bag alike.
class SortedStretches {
 public:
  SortedStretches(double length, double path_tolerance, double hold_back,
                  std::function<void(const Stretch&)> deliver);

  void push(const CuttingCondition& condition);
  void push(const CncState& state);
  void push(const SpindleAngle& angle);
  void push(const SampleBlock& dynamometer);
  void flush() { sorter_.flush(); }

 private:
  void watch(double stamp);

  StretchRecorder recorder_;
  StreamSorter sorter_;
  StreamSorter::Stream conditions_, states_, angles_, blocks_;
  double newest_ = -1e300;
};

}  // namespace smartmill::discrepancy
