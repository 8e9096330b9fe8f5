#pragma once

#include <array>
#include <deque>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/chatter_criterion.h"
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
  std::string angle = "measured";
  double harmonics_window = 1.0;

  void declare(ParameterTable& table) {
    table.number("chatter_revolutions", revolutions, "1", Range::closed(4, 200),
                 "spindle revolutions of a window; a longer window separates chatter from nearer harmonics");
    table.number("chatter_hop_revolutions", hop_revolutions, "1", Range::positive(),
                 "revolutions between two verdicts, at most chatter_revolutions");
    table.number("chatter_energy_ratio", energy_ratio, "1", Range::open(0.0, 1.0),
                 "chatter above this ratio of the energy outside the spindle harmonics to the total energy");
    table.number("chatter_least_severity", least_severity, "N", Range::notNegative(),
                 "and above this RMS outside the harmonics (in the unit of the signal)");
    table.number(
        "chatter_alternation_ratio", alternation_ratio, "1", Range::openLow(0.0, 1.0),
        "flip chatter of a tool with an even number of teeth above this ratio of the energy that alternates "
        "from tooth to tooth to the total energy; 1: never. Runout of a tool with two teeth alternates too: "
        "0.02 for a runout of 5 % of the feed per tooth, growing with its square");
    table.number("settle_revolutions", settle_revolutions, "1", Range::closed(0.0, 1000.0),
                 "revolutions ignored after the tool reaches full engagement");
    table.number("path_tolerance", path_tolerance, "m", Range::openLow(0.0, 1.0),
                 "largest distance of the tool from the path of the steady cut");
    table.number("maximum_gap", maximum_gap, "s", Range::openLow(0.0, 60.0),
                 "longest interval without controller state or spindle angle within a window");
    table.choice(
        "chatter_angle", angle, {"measured", "none"},
        "measured: windows of revolutions by spindle/angle; none: the revolutions are found from the "
        "harmonics of the signal and the speed of cnc/state, for a microphone or a vibration sensor "
        "alone");
    table.number("chatter_harmonics_window", harmonics_window, "s", Range::closed(0.2, 30.0),
                 "with chatter_angle: none, length of the signal of a verdict, twice in each such time");
  }
  /// @throws Error naming key and value.
  void validate() const;
  ChatterCriterionOptions criterion() const;
};

/// Verdict on one window (topic chatter/state).
struct ChatterState {
  double stamp = 0.0;  ///< [s] end of the window
  std::string condition;
  bool valid = false;
  bool chatter = false;
  double frequency = std::numeric_limits<double>::quiet_NaN();  ///< [Hz]
  double energy_ratio = 0.0;  ///< [1] energy outside the spindle harmonics over total energy, without mean
  double severity = 0.0;      ///< [N] RMS outside the spindle harmonics, all axes together
  /// [1] Energy that alternates from tooth to tooth (odd multiples of half the tooth passing frequency) over
  /// total energy; 0 for an odd number of teeth.
  double alternation = 0.0;
  /// [s] Start of the first revolution after which no revolution of the window repeats; NaN without chatter.
  double onset = std::numeric_limits<double>::quiet_NaN();
};

/// Distinguishes chatter from forced vibration in the compensated force: applies ChatterCriterion to windows
/// of whole revolutions within a steady cut, and within an unsteady one of a tool with two or more evenly
/// spaced teeth, where RevolutionWindow removes the change of the engagement and flips are not judged. With
/// ChatterParameters::angle none it applies judgeRecording() to the signal of the steady cut; a verdict that
/// is unsure is not valid. Where the feed of a cut turns, the force in its frame repeats with the angle of
/// the teeth to the feed: both are taken from the controller's positions. Inputs in stamp order; the results
/// depend on the inputs only.
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
  struct Position {
    double time, x, y;
  };
  using Angle = UnwrappedAngle;
  void notePosition(const CncState& state);
  std::optional<double> turnRate(double from, double to) const;
  void dropWindow();
  bool isJudged(const CncState& state) const;
  void notSteady(double stamp);
  void evaluate();
  double angleAt(double time) const;
  double timeAt(double turned) const;
  /// Force of an axis, interpolated at times [s]. @param rate [Hz] of the samples
  std::vector<double> forceAt(const std::vector<double>& times, std::size_t axis, double rate) const;
  void judge(double from, double to);
  void evaluateHarmonics();
  void judgeHarmonics(double to, double rate);

  ChatterParameters parameters_;
  ChatterCriterion criterion_, unsteady_criterion_;
  Output output_;
  std::optional<CuttingCondition> condition_;
  std::deque<Sample> samples_;
  std::deque<Angle> angles_;
  std::deque<Position> positions_;                     // [m] where the feed turns
  std::optional<double> steady_since_, steady_until_;  // [s]
  std::optional<double> window_start_;                 // [rad] accumulated angle
  double last_state_ = 0.0;
  double speed_ = 0.0;                    // [rad/s] of the controller
  std::optional<double> harmonics_from_;  // [s] start of the next window without an angle
  std::uint64_t next_index_ = 0;
  bool reported_invalid_ = false;
};

/// Samples of another sensor (vibration, sound) in the form of the detector: up to three channels in their
/// own unit, which is then that of severity and least_severity. @throws Error without a channel.
ForceBlock signalBlock(const SampleBlock& block);

/// A detector behind a StreamSorter, for node and offline program.
class DetectionPipeline {
 public:
  /// @param hold_back [s] see StreamSorter
  DetectionPipeline(const ChatterParameters& parameters, double hold_back, ChatterDetector::Output output);

  void push(const CuttingCondition& condition);
  void push(const CncState& state);
  void push(const SpindleAngle& angle);
  void push(const ForceBlock& block);
  void push(const SampleBlock& block) { push(signalBlock(block)); }
  void flush() { sorter_.flush(); }  ///< at the end of the data
  std::string waitingFor() const { return sorter_.waitingFor(); }
  std::size_t late() const { return sorter_.late(); }

 private:
  ChatterDetector detector_;
  StreamSorter sorter_;
  StreamSorter::Stream conditions_, states_;
  std::optional<StreamSorter::Stream> angles_;
  StreamSorter::Stream blocks_;
};

}  // namespace smartmill::stability
