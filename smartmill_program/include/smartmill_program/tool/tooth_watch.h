#pragma once

#include <complex>
#include <cstddef>
#include <deque>
#include <optional>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::program {

struct ToothWatchParameters {
  double least_force = 10.0;
  double usual_runout = 6e-6;
  double least_loss = 0.6;
  int reference_revolutions = 6;
  double force_change = 0.06;
  double false_alarm_hours = 1000.0;

  void declare(ParameterTable& table) {
    table.number("least_force", least_force, "N", Range::positive(),
                 "mean force of a revolution below which it is no reference: the tool is out of the cut");
    table.number("usual_runout", usual_runout, "m", Range::notNegative(),
                 "of tools in their holders: at a feed per tooth of this size it takes teeth out of the cut");
    table.number("least_loss", least_loss, "1", Range::open(0.0, 1.0),
                 "share of the force of a tooth whose loss is reported");
    table.number("reference_revolutions", reference_revolutions, "1", Range::closed(3, 100),
                 "revolutions before the last two with which these are compared; at least three are needed");
    table.number(
        "force_change", force_change, "1", Range::open(0.0, 1.0),
        "standard deviation of unmodelled changes of the force within a few revolutions, relative to "
        "the force of a tooth");
    table.number("false_alarm_hours", false_alarm_hours, "h", Range::positive(),
                 "mean time of cutting between two false reports by normally distributed noise");
  }
  /// @throws Error naming key and value.
  void validate() const { checkBounds(*this); }
};

/// Force across the tool at a spindle angle.
struct ForceSample {
  double time = 0.0;          ///< [s]
  double turned = 0.0;        ///< [rad] spindle angle, unwrapped over revolutions
  double fx = 0.0, fy = 0.0;  ///< [N] on the tool
};

/// A tooth that no longer cuts.
struct ToothLoss {
  double stamp = 0.0;        ///< [s] last sample that was needed
  double lost_at = 0.0;      ///< [s] estimated time of the loss
  double revolutions = 0.0;  ///< [1] from lost_at to stamp
  int tooth = 0;             ///< 0..teeth-1 as in ToolGeometry::toothAngle()
  double loss = 0.0;         ///< [1] share of the tooth's force
  double loss_std = 0.0;     ///< [1]
  double log_likelihood_ratio = 0.0;
};

/// Mean force over the last whole revolution.
struct RevolutionForce {
  double begin = 0.0, time = 0.0;              ///< [s] end of its first and last twelfth
  std::complex<double> force = {0.0, 0.0};     ///< [N] x + i y
  std::complex<double> rotating = {0.0, 0.0};  ///< [N] mean of force exp(i spindle angle)
};

/// Finds the loss of a tooth within two revolutions from the force that rotates with the tool.
///
/// A tooth at immersion angle phi exerts -(Ft + i Fr) exp(-i phi) on the tool (x + i y), phi = spindle angle
/// + t_j. The mean over a revolution of the force times exp(i spindle angle) is therefore
///
///     Z = -sum_j A_j exp(-i t_j),     A_j: mean of Ft + i Fr of tooth j
///
/// whatever the engagement is, one arc or several. Equal teeth have Z = 0, runout gives a constant. Without
/// tooth j the next tooth to come removes its chip too: Z changes at once by A (1 - k exp(i pitch))
/// exp(-i t_j), k the share of the chip in the force (the rest is edge force). The mean force falls by
/// (1 - k) / teeth at most, and keeps its direction.
///
/// Test (window-limited generalised likelihood ratio, Lai 1998): at each twelfth of a revolution the change D
/// of Z over the last revolution against reference_revolutions that end two revolutions earlier. With normal
/// noise of standard deviation s in each component, found from these revolutions, exp(-|D|^2 / (2 s^2)) is
/// the probability of a larger change. A loss is reported when there is for 7/12 of a revolution
/// - a likelihood ratio according to false_alarm_hours,
/// - the size of at least least_loss of a tooth. By runout its share differs from the mean one; the first
///   harmonic of the shares follows from Z before,
/// - a small sum of squares of the deviations from a loss, each over its standard deviation: direction of D
///   from that of the nearest tooth; mean force, compared with that of the references, extrapolated, outside
///   of what this tooth leaves (entries, exits, feeds and overrides change it otherwise); drift of Z before
///   (growing chatter); unevenness of the shares, and usual_runout over the feed per tooth (where runout
///   keeps a tooth out of the cut, others leave it with each change of the engagement).
///
/// A tool with one tooth has no such test: its loss is the end of the force. Requires 12 samples in a
/// revolution.
class ToothWatch {
 public:
  /// @throws Error on a parameter out of range.
  explicit ToothWatch(const ToothWatchParameters& parameters);

  /// @param tool at least one tooth @param axial_depth [m] of the cut; 0: not known
  void setTool(const ToolGeometry& tool, double axial_depth = 0.0);
  /// @param feed_per_tooth [m] at present; empty: not known
  void setFeed(const std::optional<double>& feed_per_tooth) { feed_ = feed_per_tooth; }

  /// Samples in time order. @return a loss that this sample completes
  std::optional<ToothLoss> push(const ForceSample& sample);
  /// Samples are missing, or the angle jumped: begins anew.
  void reset();

  /// Mean of the last whole revolution, once after each; empty: none since the last call.
  std::optional<RevolutionForce> takeRevolution();

  static constexpr std::size_t STEPS = 12;           ///< [1] tests in a revolution
  static constexpr std::size_t LEAST_REFERENCE = 3;  ///< [1] revolutions

 private:
  struct Step {
    double time = 0.0;
    std::complex<double> force, rotating;  // [N] means
  };
  struct Point {
    double time, turned;
    std::complex<double> force, rotating;  // [N]
  };
  struct Reference {
    std::size_t count = 0;
    std::complex<double> force;     // [N] mean, extrapolated to the present
    std::complex<double> rotating;  // [N] mean
    double drift = 0.0;             // [N] newest of rotating against the mean
    double variance = 0.0;          // [N2] of a component of rotating
  };
  void integrate(const Point& from, const Point& to);
  std::optional<ToothLoss> endStep();
  std::optional<ToothLoss> test();
  Reference reference() const;
  std::size_t firstDeviation(std::size_t references) const;
  int nearestTooth(double at) const;
  const RevolutionForce& revolutionBefore(std::size_t steps) const {
    return revolutions_[revolutions_.size() - 1 - steps];
  }

  ToothWatchParameters parameters_;
  ToolGeometry tool_;
  double phase_ = 0.0;          // [rad] of the force of a tooth against its tip
  std::optional<double> feed_;  // [m] per tooth
  long step_ = 0;
  bool whole_ = false;  // the present step has begun at its begin
  std::optional<Point> last_;
  Step sum_;
  std::deque<Step> steps_;
  std::deque<RevolutionForce> revolutions_;  // that end with each step
  std::size_t run_ = 0;                      // steps in which a tooth was missing
  std::size_t since_revolution_ = 0;         // steps
  std::optional<RevolutionForce> revolution_;
};

}  // namespace smartmill::program
