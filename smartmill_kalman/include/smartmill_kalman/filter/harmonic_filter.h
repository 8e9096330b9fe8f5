#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <memory>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_kalman/filter/harmonic_gain.h"
#include "smartmill_kalman/filter/adaptive_memory.h"

namespace smartmill::kalman {

/// How a filter is laid out.
struct HarmonicFilterParameters {
  double bandwidth = 5000.0;
  int max_harmonics = 50;
  double noise_rms = 1.0;
  double settling_revolutions = 0.2;
  double memory_revolutions = 8.0;

  void declare(ParameterTable& table) {
    table.number("bandwidth", bandwidth, "Hz", Range::positive(),
                 "harmonics of the spindle frequency up to here, and below 0.45 of the sample rate");
    table.number(
        "max_harmonics", max_harmonics, "1", Range::closed(0, 200),
        "at most so many; low speeds reach this first. Laying out takes the square of it; 0: a random walk");
    table.number("noise_rms", noise_rms, "N", Range::positive(), "noise of one sample of the sensor");
    table.number("settling_revolutions", settling_revolutions, "1", Range::positive(),
                 "time constant of each harmonic's amplitude after a change: smaller follows faster");
    table.number(
        "memory_revolutions", memory_revolutions, "1", Range::positive(),
        "time constant once nothing changes: larger is quieter; up to settling_revolutions: always quick");
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
/// Runs in the coordinates in which nothing couples: each harmonic with the sensor's answer to it in the
/// steady state (exact, H(n w)), and what each mode still rings beside it. M + N + 1 rotations and a gain:
/// the cost is linear in the number of states; nothing is allocated.
///
/// After a change (start, tool entry) it follows within settling_revolutions; while the innovations say that
/// nothing changes, the memory grows to memory_revolutions and the noise falls; an innovation out of line
/// takes it back at once. Only the gain changes, the state goes on.
class HarmonicFilter {
 public:
  static constexpr std::size_t LEVELS = 3;

  /// @param sensor measured over applied force [1] @param spindle_speed [rad/s] > 0 @param sample_rate [Hz]
  HarmonicFilter(const ModalModel& sensor, double spindle_speed, double sample_rate,
                 const HarmonicFilterParameters& parameters);
  /// With gains of this speed or one nearby; they tell the number of harmonics.
  HarmonicFilter(std::vector<HarmonicGain> gains, const ModalModel& sensor, double spindle_speed,
                 double sample_rate);

  /// Takes one measured sample [N]. @return applied force [N] at this sample, from all samples up to it.
  double step(double measured) {
    innovation_ = measured - predicted_output_;
    const double force = advance(gains_[level()].data(), innovation_, force_gain_[level()]);
    memory_.add(innovation_);
    return force;
  }

  /// Keeps the state going without a measurement. @return predicted force [N].
  double predict() {
    innovation_ = 0.0;
    return advance(gains_[level()].data(), 0.0, 0.0);
  }

  /// At rest, no force.
  void reset();

  /// Other sensor model or spindle speed, same number of harmonics: the force and the modes' displacements go
  /// on, the gains stay.
  void retune(const ModalModel& sensor, double spindle_speed);

  /// The sensor is another than was believed: what is expected to be measured goes on, the force jumps to
  /// what explains it. @param gains of the other sensor; empty, with as many modes: the gains stay
  void replaceSensor(const ModalModel& sensor, std::vector<HarmonicGain> gains);

  /// Harmonics of the measured force at the next sample [N]: output = Re sum Y_n, n = 0..N.
  std::vector<std::complex<double>> measuredHarmonics() const;

  /// Harmonic n of the applied force at the next sample [N], 0 the constant: force = Re sum.
  std::complex<double> forceHarmonic(std::size_t n) const {
    const std::size_t i = modes_ + n;
    return {batches_[i / 4].re[i % 4], batches_[i / 4].im[i % 4]};
  }

  /// Slope of the sample expected next over the spindle's angle [N/rad], of the harmonics in their steady
  /// state. @param highest harmonic that counts
  double slope(double highest = 1e9) const;

  /// Takes the force of another filter over (harmonics beyond its own: zero), so that a new layout starts
  /// without a jump. The sensor's modes must be as many.
  void continueFrom(const HarmonicFilter& other);

  /// Fixed-interval smoother with the slowest gain (modified Bryson-Frazier: nothing is stored but
  /// innovations), of all samples together. @return applied force [N] at each sample. Starts from this
  /// filter's state and leaves it at the end.
  std::vector<double> smooth(const std::vector<double>& measured);

  double innovation() const { return innovation_; }                  ///< [N] of the last step
  double innovationStd() const { return innovation_std_[level()]; }  ///< [N] expected by the design
  double spindleSpeed() const { return spindle_speed_; }             ///< [rad/s]
  int harmonics() const { return harmonics_; }
  std::size_t states() const { return 2 * modes_ + 1 + 2 * static_cast<std::size_t>(harmonics_); }
  std::size_t level() const { return memory_.level(); }  ///< 0 quick .. LEVELS - 1 slow
  bool settled() const { return memory_.settled(); }     ///< at its longest memory
  /// Times that an innovation was out of line: the memory began anew.
  std::size_t restarts() const { return memory_.restarts(); }
  void setLevel(std::size_t level) { memory_.setLevel(level); }
  /// State in the coordinates of HarmonicGain.
  std::vector<double> state() const;
  void setState(const std::vector<double>& state);

  // A pair is a rotation (a, b) of (re, im) with the share (c1, c2) in the measured and (g) in the applied
  // force. Vector4 pairs run side by side.
  typedef double Vector4 __attribute__((vector_size(32), aligned(8)));
  struct PairBatch {
    Vector4 re, im, a, b, c1, c2, g;
  };
  struct GainBatch {
    Vector4 re, im;
  };
  /// What a smoother goes back with; one for as long as sensor, speed and gains stay.
  struct SmootherDesign {
    std::vector<PairBatch> batches;                             ///< re, im of no meaning
    std::vector<std::vector<GainBatch>> gains, smoothing;  ///< a level each
    std::vector<double> variance, force_gain;              ///< [N2], [1] a level each
  };
  std::shared_ptr<const SmootherDesign> smootherDesign() const;
  /// One sample back: lambda of a sample from that of the one after it. @param level, innovation of the
  /// sample's step @param seen false: it was bridged @return correction of its predicted force [N]
  static double smoothBackward(const SmootherDesign& design, std::size_t level, double innovation, bool seen,
                       std::vector<GainBatch>& lambda);

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
  mutable std::shared_ptr<const SmootherDesign> smoother_design_;  // empty: to be made
};

}  // namespace smartmill::kalman
