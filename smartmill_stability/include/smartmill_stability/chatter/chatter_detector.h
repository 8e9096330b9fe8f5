#pragma once

#include <array>
#include <deque>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_core/signal/unwrapped_angle.h"

namespace smartmill::stability {

struct ChatterParameters {
  int revolutions = 16, hop_revolutions = 8;
  double energy_ratio = 0.1;
  double least_severity = 5.0;
  double alternation_ratio = 0.1;
  double settle_revolutions = 4.0;
  double path_tolerance = 1.0e-3;
  double maximum_gap = 0.2;

  void declare(ParameterTable& table) {
    table.number("chatter_revolutions", revolutions, "1", Range::closed(4, 200),
                 "of the spindle in a window: a longer one tells nearer frequencies from the harmonics");
    table.number("chatter_hop_revolutions", hop_revolutions, "1", Range::positive(),
                 "between two verdicts, at most chatter_revolutions");
    table.number("chatter_energy_ratio", energy_ratio, "1", Range::open(0.0, 1.0),
                 "energy outside the spindle's harmonics over all: chatter above");
    table.number("chatter_least_severity", least_severity, "N", Range::notNegative(),
                 "and above this force outside the harmonics (or in the signal's unit)");
    table.number(
        "chatter_alternation_ratio", alternation_ratio, "1", Range::openLow(0.0, 1.0),
        "flip of an even number of teeth above: energy that alternates from tooth to tooth over all; 1: "
        "never. Runout of a tool with two teeth alternates too: 0.02 at 5 % of the feed, with the square of "
        "it");
    table.number("settle_revolutions", settle_revolutions, "1", Range::closed(0.0, 1000.0),
                 "dropped after the tool came into full engagement");
    table.number("path_tolerance", path_tolerance, "m", Range::openLow(0.0, 1.0),
                 "distance of the tool from the steady part of the cut");
    table.number("maximum_gap", maximum_gap, "s", Range::openLow(0.0, 60.0),
                 "longer without controller state or spindle angle: not steady");
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// Verdict on one window (topic chatter/state).
struct ChatterState {
  double stamp = 0.0;  ///< [s] end of the window
  std::string condition;
  bool valid = false;
  bool chatter = false;
  double frequency = std::numeric_limits<double>::quiet_NaN();  ///< [Hz]
  double energy_ratio = 0.0;  ///< [1] outside the spindle's harmonics over all, without the mean
  double severity = 0.0;      ///< [N] root mean square outside the harmonics, all axes together
  /// [1] energy that alternates from tooth to tooth (odd multiples of half the tooth passing) over all; 0 for
  /// an odd number of teeth
  double alternation = 0.0;
  /// [s] begin of the first revolution from which the force repeats no more to the end of the window; NaN
  /// without chatter
  double onset = std::numeric_limits<double>::quiet_NaN();
};

/// Tells chatter from forced vibration in the compensated force: what repeats every revolution (teeth,
/// runout) is the mean over the window's revolutions at each angle; what is left is chatter or noise. A flip
/// (period-two) of an even number of teeth repeats every revolution as runout does, and no sampling once per
/// revolution tells it from runout; what tells is its size: a flip makes every other tooth leave the cut, so
/// most of the energy alternates from tooth to tooth. Inputs in stamp order; results follow from them alone.
class ChatterDetector {
 public:
  using Output = std::function<void(const ChatterState&)>;

  /// @throws Error as ChatterParameters::validate().
  ChatterDetector(const ChatterParameters& parameters, Output output);

  void handle(const CuttingCondition& condition);
  void handle(const CncState& state);
  void handle(const SpindleAngle& angle);
  void handle(const ForceBlock& block);
  void reset();

 private:
  struct Sample {
    double time;
    std::array<double, 3> force;
  };
  using Angle = UnwrappedAngle;
  void dropWindow();
  void notSteady(double stamp);
  void evaluate();
  double angleAt(double time) const;
  double timeAt(double turned) const;
  /// Force of an axis at times between the samples, which come at a rate [Hz].
  std::vector<double> forceAt(const std::vector<double>& times, std::size_t axis, double rate) const;
  void judge(double from, double to);

  ChatterParameters parameters_;
  Output output_;
  std::optional<CuttingCondition> condition_;
  std::deque<Sample> samples_;
  std::deque<Angle> angles_;
  std::optional<double> steady_since_, steady_until_;  // [s]
  std::optional<double> window_start_;                 // [rad] turned
  double last_state_ = 0.0;
  std::uint64_t next_index_ = 0;
  bool said_invalid_ = false;
};

/// Samples of another sensor for the detector: up to three channels in their own unit (vibration, sound), to
/// which severity and least_severity then belong. @throws Error without a channel.
ForceBlock signalBlock(const SampleBlock& block);

/// A detector behind a StreamSorter: what node and offline tool both use.
class DetectionPipeline {
 public:
  /// @param hold_back [s], see StreamSorter.
  DetectionPipeline(const ChatterParameters& parameters, double hold_back, ChatterDetector::Output output);

  void push(const CuttingCondition& condition);
  void push(const CncState& state);
  void push(const SpindleAngle& angle);
  void push(const ForceBlock& block);
  void push(const SampleBlock& block) { push(signalBlock(block)); }
  void flush() { sorter_.flush(); }  ///< end of data
  std::string waitingFor() const { return sorter_.waitingFor(); }
  std::size_t late() const { return sorter_.late(); }

 private:
  ChatterDetector detector_;
  StreamSorter sorter_;
  StreamSorter::Stream conditions_, states_, angles_, blocks_;
};

}  // namespace smartmill::stability
