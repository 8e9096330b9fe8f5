#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <memory>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_kalman/filter/adaptive_memory.h"
#include "smartmill_kalman/filter/harmonic_gain.h"

namespace smartmill::kalman {

/// Settings of a filter's design. The initialisers are the defaults of the parameters.
struct HarmonicFilterParameters {
  double bandwidth = 5000.0;
  int max_harmonics = 50;
  double noise_rms = 1.0;
  double settling_revolutions = 0.2;
  double memory_revolutions = 8.0;

  void declare(ParameterTable& table) {
    table.number(
        "bandwidth", bandwidth, "Hz", Range::positive(),
        "highest frequency of the harmonics of the spindle; at most 0.45 of the sample rate is used");
    table.number("max_harmonics", max_harmonics, "1", Range::closed(0, 200),
                 "largest number of harmonics, reached at low speeds; the design time grows with its square; "
                 "0: random walk");
    table.number("noise_rms", noise_rms, "N", Range::positive(),
                 "standard deviation of one sample of the sensor");
    table.number(
        "settling_revolutions", settling_revolutions, "1", Range::positive(),
        "time constant of the harmonics' amplitudes after a change of the force; smaller follows faster");
    table.number(
        "memory_revolutions", memory_revolutions, "1", Range::positive(),
        "time constant in a steady cut; larger is less noisy; at most settling_revolutions: not used");
  }
  /// Memory of a level of `levels` [revolutions]: quick, geometric mean, slow.
  double memory(std::size_t level) const;
  /// @throws Error naming key and value.
  void validate() const;
};

/// Gains from quick to slow: settling_revolutions, memory_revolutions and their geometric mean.
std::vector<HarmonicGain> designGains(const ModalModel& sensor, double spindle_speed, double sample_rate,
                                      const HarmonicFilterParameters& parameters);

/// Kalman filter of Dunwoody chapter 5 for one axis at one spindle speed: sensor modes (eq. 5.18..5.23,
/// static gain 1) driven by a force that is a constant and N harmonics of the spindle frequency with slowly
/// wandering amplitudes (eq. 5.28..5.35).
///
/// Runs in decoupled coordinates: each harmonic together with the sensor's exact steady-state response H(n w)
/// to it, and the free response of each mode. A step is M + N + 1 rotations and a gain: its cost is linear in
/// the number of states, and it does not allocate.
///
/// After a change (start, tool entry) the filter follows within settling_revolutions. In a steady cut its
/// memory grows to memory_revolutions and the noise falls; an outlying innovation resets it (AdaptiveMemory).
/// Only the gain changes, the state continues.
class HarmonicFilter {
 public:
  static constexpr std::size_t LEVELS = 3;

  /// @param sensor measured over applied force [1] @param spindle_speed [rad/s] > 0 @param sample_rate [Hz]
  HarmonicFilter(const ModalModel& sensor, double spindle_speed, double sample_rate,
                 const HarmonicFilterParameters& parameters);
  /// @param gains of this speed or a nearby one; they determine the number of harmonics
  HarmonicFilter(std::vector<HarmonicGain> gains, const ModalModel& sensor, double spindle_speed,
                 double sample_rate);

  /// Filters one measured sample [N]. @return applied force [N] at this sample, from all samples up to it.
  double step(double measured) {
    innovation_ = measured - predicted_output_;
    const double force = advance(gains_[level()].data(), innovation_, force_gain_[level()]);
    memory_.add(innovation_);
    return force;
  }

  /// Advances the state without a measurement. @return predicted force [N].
  double predict() {
    innovation_ = 0.0;
    return advance(gains_[level()].data(), 0.0, 0.0);
  }

  /// At rest, no force.
  void reset();

  /// Changes sensor model or spindle speed; the number of harmonics, the gains, the force and the modes'
  /// displacements stay.
  void retune(const ModalModel& sensor, double spindle_speed);

  /// Corrects the sensor model: the predicted measurement stays, the force jumps to explain it.
  /// @param gains of the new sensor; empty: the gains stay (same number of modes only)
  void replaceSensor(const ModalModel& sensor, std::vector<HarmonicGain> gains);

  /// Harmonics of the measured force at the next sample [N]: output = Re sum Y_n, n = 0..N.
  std::vector<std::complex<double>> measuredHarmonics() const;

  /// Harmonic n of the applied force at the next sample [N], 0 the constant: force = Re sum.
  std::complex<double> forceHarmonic(std::size_t n) const {
    const std::size_t i = modes_ + n;
    return {batches_[i / 4].re[i % 4], batches_[i / 4].im[i % 4]};
  }

  /// Derivative of the predicted sample with respect to the spindle angle [N/rad], steady-state harmonics
  /// only.
  /// @param highest harmonic that is included
  double slope(double highest = 1e9) const;

  /// Takes over the force of another filter (harmonics that it lacks: zero), so that a new design starts
  /// without a jump. @throws Error when the number of modes differs.
  void continueFrom(const HarmonicFilter& other);

  /// Fixed-interval smoother with the slowest gain (modified Bryson-Frazier, which stores innovations only).
  /// Starts from the present state and ends in that after the last sample. @return applied force [N].
  std::vector<double> smooth(const std::vector<double>& measured);

  double innovation() const { return innovation_; }                  ///< [N] of the last step
  double innovationStd() const { return innovation_std_[level()]; }  ///< [N] by design
  double spindleSpeed() const { return spindle_speed_; }             ///< [rad/s]
  int harmonics() const { return harmonics_; }
  std::size_t states() const { return 2 * modes_ + 1 + 2 * static_cast<std::size_t>(harmonics_); }
  std::size_t level() const { return memory_.level(); }  ///< 0 quick .. LEVELS - 1 slow
  bool settled() const { return memory_.settled(); }     ///< longest memory
  /// Times that an outlying innovation reset the memory.
  std::size_t restarts() const { return memory_.restarts(); }
  void setLevel(std::size_t level) { memory_.setLevel(level); }
  /// State in the coordinates of HarmonicGain.
  std::vector<double> state() const;
  void setState(const std::vector<double>& state);

  // A pair is a rotation (a, b) of (re, im) that contributes (c1, c2) to the measured and g to the applied
  // force. A batch holds four pairs.
  typedef double Vector4 __attribute__((vector_size(32), aligned(8)));
  struct PairBatch {
    Vector4 re, im, a, b, c1, c2, g;
  };
  struct GainBatch {
    Vector4 re, im;
  };
  /// Data of the backward pass, constant while sensor, speed and gains stay.
  struct SmootherDesign {
    std::vector<PairBatch> batches;                        ///< re, im unused
    std::vector<std::vector<GainBatch>> gains, smoothing;  ///< each level
    std::vector<double> variance, force_gain;              ///< [N2], [1] each level
  };
  std::shared_ptr<const SmootherDesign> smootherDesign() const;
  /// Backward pass of one sample. @param level, innovation of the sample's step @param is_measured false: it
  /// was predicted @param lambda adjoint of the next sample, replaced by that of this one @return correction
  /// of the predicted force [N]
  static double smoothBackward(const SmootherDesign& design, std::size_t level, double innovation,
                               bool is_measured, std::vector<GainBatch>& lambda);

 private:
  double advance(const GainBatch* gain, double innovation, double force_gain);
  void setModel(const ModalModel& sensor, double spindle_speed);
  std::vector<double> toPairs(const std::vector<double>& state) const;
  void setGains();
  void replaceModes(const ModalModel& sensor, std::vector<HarmonicGain> gains);
  double predictedOutput() const;

  ModalModel sensor_;
  double spindle_speed_ = 0.0, sample_rate_;
  std::size_t modes_;
  int harmonics_;
  std::vector<HarmonicGain> design_;
  std::vector<std::array<double, 4>> modal_;  // transition of each mode's two states, row-major
  std::vector<PairBatch> batches_;
  std::vector<std::vector<GainBatch>> gains_;
  std::vector<double> force_gain_, innovation_std_;
  double predicted_output_ = 0.0, innovation_ = 0.0;
  AdaptiveMemory memory_;
  mutable std::shared_ptr<const SmootherDesign> smoother_design_;  // empty: not computed yet
};

}  // namespace smartmill::kalman
