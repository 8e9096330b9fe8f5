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

  void declare(ParameterTable& table) {
    table.number("pieces", pieces, "1", Range::closed(2, 30), "of the splines");
    table.number("most_cuts", most_cuts, "1", Range::closed(1, 100),
                 "the last so many of a tool in a material");
    table.number("settle_time", settle_time, "s", Range::closed(0.0, 10.0),
                 "after full engagement, and before it ends, that does not count");
    table.number("least_revolutions", least_revolutions, "1", Range::closed(2, 1000), "of a cut that counts");
    table.number(
        "restless", restless, "1", Range::open(0.0, 1.0),
        "share of the force that does not repeat with the revolution (chatter): a cut with more is left "
        "out");
    table.number("gain_error", gain_error, "1", Range::closed(0.0, 0.5),
                 "share by which the force sensor's gain may be wrong in all cuts alike: part of the band");
  }
};

/// Mean force of a cut over the spindle's angle, as samples come.
class MeanRevolution {
 public:
  void add(double angle, double fx, double fy);
  /// Angles that were met, each with its mean. Engagement is left to the caller.
  AngleRecord record() const;
  double count() const { return count_; }
  /// [1] of the variance of fx and fy, what does not repeat.
  double restless() const;

 private:
  static constexpr std::size_t BINS = 360;
  struct Bin {
    double count = 0.0, place = 0.0, fx = 0.0, fy = 0.0, square = 0.0;
  };
  std::array<Bin, BINS> bins_{};
  double count_ = 0.0;
};

/// Force over chip thickness from running cuts: force/compensated over spindle/angle while the tool is fully
/// engaged, each cut its mean revolution, the cuts of one tool in one material together. Inputs in stamp
/// order; what comes out follows from them alone.
class CurveFinder {
 public:
  /// @throws Error naming key and value.
  explicit CurveFinder(const CurveParameters& parameters);

  /// After each cut that counts.
  void onCurves(std::function<void(const IdentifiedForceCurves&)> callback) { found_ = std::move(callback); }
  /// Why a cut did not count, or no curve came of it: one line.
  void onLeftOut(std::function<void(const std::string&)> callback) { left_out_ = std::move(callback); }

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
  void use();
  void close();
  void fit(const std::vector<Cut>& cuts);

  CurveParameters parameters_;
  std::function<void(const IdentifiedForceCurves&)> found_;
  std::function<void(const std::string&)> left_out_;
  std::optional<CuttingCondition> condition_;
  std::deque<Sample> samples_;
  std::deque<UnwrappedAngle> angles_;
  std::optional<double> steady_since_, steady_until_;  // [s]
  double last_state_ = 0.0, last_used_ = 0.0;          // [s]
  double turned_ = 0.0;                                // [rad] of what was used
  MeanRevolution revolution_;
  std::map<std::pair<std::string, std::string>, std::vector<Cut>> cuts_;  // by tool and material
};

/// The same behind the sorter: node and tool that reads bags both feed this class.
class ForceCurvePipeline {
 public:
  /// @param hold_back [s], see StreamSorter.
  ForceCurvePipeline(const CurveParameters& parameters, double hold_back);
  CurveFinder& finder() { return finder_; }

  void push(const CuttingCondition& condition);
  void push(const CncState& state);
  void push(const SpindleAngle& angle);
  void push(const ForceBlock& block);
  void flush() { sorter_.flush(); }  ///< end of data

 private:
  CurveFinder finder_;
  StreamSorter sorter_;
  StreamSorter::Stream conditions_, states_, angles_, blocks_;
};

}  // namespace smartmill::loadmeter
