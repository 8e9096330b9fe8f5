#pragma once

#include <complex>
#include <deque>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::stability {

/// Single-point turning after Kim: chip thickness a = a0 - y(t) + mu y(t - T), y = y_w - y_t the deflection
/// y_w of the machine less the displacement y_t that an actuator gives to the tool (Kim eq. 1..4, 9).
/// Second-order machine as the controller believes it: y_w = gain w^2 / (s^2 + 2 zeta w s + w^2) a.
struct SecondOrder {
  double gain = 0.0;           ///< [1] K / K_m
  double frequency = 0.0;      ///< [rad/s]
  double damping_ratio = 0.0;  ///< [1]
  /// Of gain, frequency, damping ratio; in their units.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  std::complex<double> response(double w) const;  ///< [1] at w [rad/s]
  ModalModel modal() const;
};

/// Kim's spectral estimate: blocks of a segment under a Hamming window.
struct EstimatorParameters {
  double sample_rate = 1000.0;
  int segment = 2048;
  int block = 512;
  double least_signal = 30.0;
  double frequency_low = 5.0, frequency_high = 150.0;

  void declare(ParameterTable& table) {
    table.section("Estimate: segments of 2.048 s at 1 ms, Hamming window, 512 points, half overlapping.");
    table.number("estimator_rate", sample_rate, "Hz", Range::positive(),
                 "the streams' rate is a whole multiple of it");
    table.number("segment", segment, "1", Range::atLeast(16), "samples");
    table.number("block", block, "1", Range::atLeast(16), "samples under one window, at most segment");
    table.number("least_signal", least_signal, "1", Range::positive(),
                 "power of a line over the noise floor from which it is used");
    table.number("frequency_low", frequency_low, "Hz", Range::notNegative(), "of the lines looked at");
    table.number("frequency_high", frequency_high, "Hz", Range::positive(),
                 "above frequency_low; the noise floor is taken above");
  }
};

/// What one segment shows.
struct SegmentEstimate {
  bool informed = false;  ///< enough lines stand above the noise
  int lines = 0;
  SecondOrder model;  ///< fit of the lines
  /// Ratio y_w / a line by line [1] at frequency [rad/s]: biased by leakage, as Kim's.
  std::vector<double> frequency;
  std::vector<std::complex<double>> ratio;
};

/// Estimates gain, frequency and damping of y_w over a from one segment. The fit compares the windowed
/// spectra of the blocks with those of the model's own answer to the measured chip thickness, so the leakage
/// of the window (2.7 Hz at 512 points, more than the half-power bandwidth of 2.2 Hz) is in both; the state
/// at the segment's begin is free.
/// @param start of the search, nullptr: searched over the band. @throws Error on wrong lengths.
SegmentEstimate estimateSegment(const std::vector<double>& chip, const std::vector<double>& deflection,
                                const EstimatorParameters& parameters, const SecondOrder* start = nullptr);

/// Kim eq. 10: least real part of K/K_m (G_m - K_m K_c G_c) over all frequencies; above -0.5 every speed is
/// stable.
double residualMargin(const SecondOrder& machine, const SecondOrder& controller);

/// The least of that over the machine's uncertainty (corners at two standard deviations along each principal
/// axis of the covariance).
double worstMargin(const SecondOrder& machine, const SecondOrder& controller);

struct ControllerParameters {
  EstimatorParameters estimator;
  double rate = 10000.0;  ///< [Hz] of the control loop, a whole multiple of the estimator's
  double period = 0.1;    ///< [s] of a revolution
  double overlap = 1.0;
  double chip = 1.0e-4;
  double drift = 0.01;
  double margin = -0.4;
  double lead = 0.0;
  double actuator_delay = 0.0;
  bool leaves_cut = true;

  void declare(ParameterTable& table) {
    table.internal("rate", rate, "Hz", Range::positive());
    table.internal("period", period, "s", Range::positive());
    table.number("overlap", overlap, "1", Range::closed(0.0, 1.0), "of the cut with the one before (mu)");
    table.number("chip", chip, "m", {}, "nominal chip thickness");
    table.number("drift", drift, "1", Range::notNegative(),
                 "change of the machine a segment that is granted");
    table.number("margin", margin, "1", Range::open(-0.5, 0.0),
                 "real part that a new controller must keep at two standard deviations");
    table.number("lead", lead, "s", Range::closed(0.0, 0.5),
                 "commands are for samples so much later: the way to the actuator and back; a whole number "
                 "of samples");
    table.number("actuator_delay", actuator_delay, "s", Range::closed(0.0, 0.1),
                 "by which the actuator follows its commands late");
    table.flag("leaves_cut", leaves_cut,
               "whether a tool that vibrates out of the cut leaves the surface as it was; false: chips may "
               "be negative");
    estimator.declare(table);
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// Feed-forward controller (Kim fig. 3, eq. 8..10): moves the tool as the machine is believed to deflect
/// under the chip thickness, and learns the machine segment by segment. Needs the two displacement streams
/// alone.
class AdaptiveChatterController {
 public:
  /// @throws Error on bad parameters.
  explicit AdaptiveChatterController(const ControllerParameters& parameters);

  /// One sample of deflection and tool displacement [m]. @return tool displacement to make until the next
  /// sample [m], or from `lead` after this one until the next: then it stands on a prediction, the machine as
  /// believed under the chips that this and the commands under way will make. 0 before the first estimate.
  double step(double deflection, double tool);

  /// What each segment showed, in order.
  const std::vector<SegmentEstimate>& segments() const { return segments_; }
  /// The machine as believed after each segment; gain 0 before any information.
  const std::vector<SecondOrder>& beliefs() const { return beliefs_; }
  const SecondOrder& active() const { return active_; }  ///< controller in force; gain 0: none

 private:
  double pastSurface() const;
  double predicted();
  double issued(double after) const;
  void learn();
  void activate(const SecondOrder& model);

  ControllerParameters parameters_;
  std::deque<double> surface_, chips_;  // newest first, at the control rate
  std::deque<double> issued_;           // commands that are under way, newest first
  std::vector<double> coming_;          // surface that is predicted
  std::vector<double> segment_chip_, segment_deflection_;
  int phase_ = 0;
  SecondOrder believed_, active_;
  std::unique_ptr<ModalFilter> filter_;
  std::vector<SegmentEstimate> segments_;
  std::vector<SecondOrder> beliefs_;
};

/// Integrates a headstock accelerometer to displacement above a corner frequency (the paper's own proposal
/// for machines whose deflection cannot be measured). The ratio of deflection to chip thickness is not
/// changed where both went through it.
class AccelerationIntegrator {
 public:
  /// @param corner [Hz] @param rate [Hz]
  AccelerationIntegrator(double corner, double rate);
  double step(double acceleration);  ///< [m/s2] -> [m]

 private:
  ModalFilter filter_;
};

}  // namespace smartmill::stability
