#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_core/signal/unwrapped_angle.h"
#include "smartmill_loadmeter/identification/force_curve.h"

namespace smartmill::loadmeter {

struct CurveParameters {
  int pieces = 8;
  int most_cuts = 12;
  double settle_time = 0.1;
  int least_revolutions = 8;
  double restless = 0.2;
  double gain_error = 0.005;
  // No parameters of a node:
  double maximum_gap = 0.2;        ///< [s] longest time without state or angle in a steady cut
  double path_tolerance = 1.0e-3;  ///< [m] largest distance from the line between steady_from and steady_to

  void declare(ParameterTable& table) {
    table.number("pieces", pieces, "1", Range::closed(2, 30), "segments of each spline");
    table.number("most_cuts", most_cuts, "1", Range::closed(1, 100),
                 "newest cuts of a tool in a material that are fitted together");
    table.number("settle_time", settle_time, "s", Range::closed(0.0, 10.0),
                 "ignored after the begin and before the end of full engagement");
    table.number("least_revolutions", least_revolutions, "1", Range::closed(2, 1000),
                 "steady revolutions that a cut must have");
    table.number("restless", restless, "1", Range::open(0.0, 1.0),
                 "largest share of the force's variance that is not synchronous with the spindle; a cut with "
                 "more (chatter) is "
                 "rejected");
    table.number("gain_error", gain_error, "1", Range::closed(0.0, 0.5),
                 "standard deviation of the force sensor's gain, common to all cuts; part of the band");
  }
};

/// Mean force of a cut over the spindle angle, accumulated sample by sample.
class MeanRevolution {
 public:
  void add(double angle, double fx, double fy);
  /// Mean force at each angle with samples. The caller sets the engagement.
  AngleRecord record() const;
  double count() const { return count_; }
  /// Share of the variance of fx and fy that is not synchronous with the spindle [1].
  double restless() const;

 private:
  static constexpr std::size_t BINS = 360;
  struct Bin {
    double count = 0.0, angle = 0.0, fx = 0.0, fy = 0.0, square = 0.0;
  };
  std::array<Bin, BINS> bins_{};
  double count_ = 0.0;
};

/// Identifies force over chip thickness during cuts: force/compensated over spindle/angle at full engagement,
/// averaged over the revolutions of each cut and fitted to all cuts of one tool in one material. Inputs in
/// stamp order determine the result.
class ForceCurveIdentification {
 public:
  /// @throws Error with key and value.
  explicit ForceCurveIdentification(const CurveParameters& parameters);

  /// Called after each accepted cut.
  void onCurves(std::function<void(const IdentifiedForceCurves&)> callback) {
    on_curves_ = std::move(callback);
  }
  /// Called with the reason, in one line, when a cut is rejected.
  void onRejected(std::function<void(const std::string&)> callback) { on_rejected_ = std::move(callback); }

  void handle(const CuttingCondition& condition);
  void handle(const CncState& state);
  void handle(const SpindleAngle& angle);
  void handle(const ForceBlock& block);
  void reset();

 private:
  struct Sample {
    double time, fx, fy;
  };
  struct Cut {
    double stamp;
    std::string name;
    AngleRecord record;
  };
  void accumulate();
  void closeCut();
  void fitCurves(const std::vector<Cut>& cuts);

  CurveParameters parameters_;
  std::function<void(const IdentifiedForceCurves&)> on_curves_;
  std::function<void(const std::string&)> on_rejected_;
  std::optional<CuttingCondition> condition_;
  std::deque<Sample> samples_;
  std::deque<UnwrappedAngle> angles_;
  std::optional<double> steady_since_, steady_until_;  // [s]
  double last_state_ = 0.0, last_sample_ = 0.0;        // [s]
  double rotation_ = 0.0;                              // [rad] rotation of the accumulated samples
  MeanRevolution revolution_;
  std::map<std::pair<std::string, std::string>, std::vector<Cut>> cuts_;  // by tool and material
};

/// Puts the streams into stamp order; used by the node and for bags.
class ForceCurvePipeline {
 public:
  /// @param hold_back [s], see StreamSorter.
  ForceCurvePipeline(const CurveParameters& parameters, double hold_back);
  ForceCurveIdentification& identification() { return identification_; }

  void push(const CuttingCondition& condition) { sort(conditions_, condition); }
  void push(const CncState& state) { sort(states_, state); }
  void push(const SpindleAngle& angle) { sort(angles_, angle); }
  void push(const ForceBlock& block) { sort(blocks_, block); }
  void flush() { sorter_.flush(); }  ///< end of data

 private:
  template <typename Input>
  void sort(StreamSorter::Stream stream, const Input& input) {
    sorter_.push(stream, input.stamp, [this, input] { identification_.handle(input); });
  }

  ForceCurveIdentification identification_;
  StreamSorter sorter_;
  StreamSorter::Stream conditions_, states_, angles_, blocks_;
};

}  // namespace smartmill::loadmeter
