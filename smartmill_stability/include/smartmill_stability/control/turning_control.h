#pragma once

#include <complex>
#include <deque>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::stability {

/// Second-order model of the machine in single-point turning (Kim eq. 1..4, 9): y_w = gain w^2 / (s^2 +
/// 2 zeta w s + w^2) a. Chip thickness a = a0 - y(t) + mu y(t - T), y = y_w - y_t: deflection y_w of the
/// machine minus displacement y_t of the tool by the actuator.
struct SecondOrder {
  double gain = 0.0;           ///< [1] K / K_m
  double frequency = 0.0;      ///< [rad/s]
  double damping_ratio = 0.0;  ///< [1]
  /// Of gain, frequency and damping ratio, in their units.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  std::complex<double> response(double w) const;  ///< [1] deflection over chip thickness at w [rad/s]
  ModalModel modal() const;
};

/// Spectral estimate of Kim: a segment in blocks with a Hamming window.
struct EstimatorParameters {
  double sample_rate = 1000.0;
  int segment = 2048;
  int block = 512;
  double least_signal = 30.0;
  double frequency_low = 5.0, frequency_high = 150.0;

  void declare(ParameterTable& table) {
    table.section(
        "Estimator: segments of 2.048 s at 1 ms, blocks of 512 samples overlapping by half, Hamming window.");
    table.number("estimator_rate", sample_rate, "Hz", Range::positive(),
                 "sample rate of the estimator; the rate of the streams is an integer multiple of it");
    table.number("segment", segment, "1", Range::atLeast(16), "samples of a segment");
    table.number("block", block, "1", Range::atLeast(16), "samples of a block, at most segment");
    table.number("least_signal", least_signal, "1", Range::positive(),
                 "smallest ratio of power to noise floor of a line that is used");
    table.number("frequency_low", frequency_low, "Hz", Range::notNegative(), "lower end of the band");
    table.number("frequency_high", frequency_high, "Hz", Range::positive(),
                 "upper end of the band, above frequency_low; the noise floor is estimated above it");
  }
};

/// Estimate from one segment.
struct SegmentEstimate {
  bool informed = false;  ///< enough lines above the noise floor for a fit
  int lines = 0;          ///< above the noise floor
  SecondOrder model;      ///< fitted to the lines
  /// [1] Plain ratio y_w / a at each frequency [Hz]: biased by leakage, as in Kim.
  std::vector<double> frequency;
  std::vector<std::complex<double>> ratio;
};

/// Estimates gain, frequency and damping of y_w over a from one segment. The fit compares the windowed
/// spectra of the deflection with those of the model response to the measured chip thickness, so both contain
/// the leakage of the window (2.7 Hz at 512 points, more than the half-power bandwidth of 2.2 Hz). The state
/// at the start of the segment is fitted too.
/// @param start of the iteration; nullptr: grid search over the band. @throws Error on wrong lengths.
SegmentEstimate estimateSegment(const std::vector<double>& chip, const std::vector<double>& deflection,
                                const EstimatorParameters& parameters, const SecondOrder* start = nullptr);

/// Kim eq. 10: minimum of the real part of K/K_m (G_m - K_m K_c G_c) over all frequencies; above -0.5 every
/// speed is stable.
double residualMargin(const SecondOrder& machine, const SecondOrder& controller);

/// Minimum of residualMargin() at two standard deviations of the machine on both sides along each principal
/// axis of its covariance.
double worstMargin(const SecondOrder& machine, const SecondOrder& controller);

struct ControllerParameters {
  EstimatorParameters estimator;
  double rate = 10000.0;  ///< [Hz] of the control loop, an integer multiple of the estimator's
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
    table.number("overlap", overlap, "1", Range::closed(0.0, 1.0),
                 "overlap factor of consecutive revolutions (mu)");
    table.number("chip", chip, "m", {}, "nominal chip thickness");
    table.number("drift", drift, "1", Range::notNegative(),
                 "relative change of the machine within a segment (process noise of the estimate)");
    table.number(
        "margin", margin, "1", Range::open(-0.5, 0.0),
        "smallest real part of the residual (Kim eq. 10) at two standard deviations that activates a "
        "new controller");
    table.number(
        "lead", lead, "s", Range::closed(0.0, 0.5),
        "time from a sample to the sample at which its command acts, for the transport to the actuator "
        "and back; an integer number of samples");
    table.number("actuator_delay", actuator_delay, "s", Range::closed(0.0, 0.1),
                 "delay of the actuator after its command");
    table.flag("leaves_cut", leaves_cut,
               "true: a tool that vibrates out of the cut leaves the surface unchanged; false: the chip "
               "thickness may be negative");
    estimator.declare(table);
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// Feed-forward controller (Kim fig. 3, eq. 8..10): moves the tool by the deflection that the estimated
/// machine has under the chip thickness, and updates the estimate with each segment. Its only inputs are the
/// two displacement streams.
class AdaptiveChatterController {
 public:
  /// @throws Error on bad parameters.
  explicit AdaptiveChatterController(const ControllerParameters& parameters);

  /// One sample of deflection and tool displacement [m]. @return [m] commanded tool displacement until the
  /// next sample, or, with a lead, for the sample interval that begins `lead` after this sample. It is then
  /// predicted from the estimated machine and the chips that result from this and the pending commands. 0
  /// before the first estimate.
  double step(double deflection, double tool);

  /// Estimates of the single segments, in order.
  const std::vector<SegmentEstimate>& segments() const { return segments_; }
  /// Combined estimate after each segment; gain 0 before the first informed one.
  const std::vector<SecondOrder>& estimates() const { return estimates_; }
  const SecondOrder& active() const { return active_; }  ///< active controller; gain 0: none

 private:
  double pastSurface() const;
  double predicted();
  double issued(double after) const;
  void updateEstimate();
  void activate(const SecondOrder& model);

  ControllerParameters parameters_;
  std::deque<double> surface_, chips_;  // newest first, at the control rate
  std::deque<double> issued_;           // pending commands, newest first
  std::vector<double> future_surface_;  // predicted
  std::vector<double> segment_chip_, segment_deflection_;
  int phase_ = 0;
  SecondOrder estimate_, active_;
  std::unique_ptr<ModalFilter> filter_;
  std::vector<SegmentEstimate> segments_;
  std::vector<SecondOrder> estimates_;
};

/// Integrates an acceleration of the headstock to displacement above a corner frequency (proposed by Kim for
/// machines whose deflection cannot be measured). The ratio of deflection to chip thickness is unchanged when
/// both pass through the same integrator.
class AccelerationIntegrator {
 public:
  /// @param corner [Hz] @param rate [Hz]
  AccelerationIntegrator(double corner, double rate);
  double step(double acceleration);  ///< [m/s2] -> [m]

 private:
  ModalFilter filter_;
};

}  // namespace smartmill::stability
