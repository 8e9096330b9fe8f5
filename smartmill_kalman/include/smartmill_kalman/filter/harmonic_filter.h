#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_kalman/filter/adaptive_memory.h"
#include "smartmill_kalman/filter/harmonic_gain.h"
#include "smartmill_kalman/filter/harmonic_pairs.h"
#include "smartmill_kalman/filter/harmonic_smoother.h"

namespace smartmill::kalman {

/// Settings of a filter's design. The initialisers are the defaults of the parameters.
struct HarmonicFilterParameters {
  double bandwidth = 5000.0;
  int max_harmonics = 50;
  double noise_rms = 1.0;
  double settling_revolutions = 0.2;
  double memory_revolutions = 8.0;
  /// The same process noise for every harmonic (Burzoni's Q): one with a low transmissibility has a longer
  /// memory than memory_revolutions, by its reciprocal. False: all have the same memory.
  bool uniform_noise = false;
  /// Each harmonic enters the force with its Wiener weight in a steady cut; for sensors whose noise,
  /// amplified by 1 / |H|, is not small compared with the force. They narrow the range of a force with little
  /// noise by 3 to 6 %.
  bool weighted = false;

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
///
/// With HarmonicFilterParameters::weighted each harmonic enters the force of a steady cut with the weight
/// that minimises its mean square error (Wiener): where the sensor hardly responds, a harmonic is mostly
/// noise, amplified by 1 / |H|.
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
    const double force = advance(gains_[memory_.level()].data(), innovation_, force_gain_[memory_.level()]);
    memory_.add(innovation_);
    innovation_sum_ += innovation_ * innovation_;
    if (++innovation_count_ >= revolution_) endRevolution();
    if (weighted_ && !memory_.settled()) resetWeights();
    return force;
  }

  /// Advances the state without a measurement. @return predicted force [N].
  double predict() {
    innovation_ = 0.0;
    return advance(gains_[memory_.level()].data(), 0.0, 0.0);
  }

  /// At rest, no force.
  void reset();

  /// Changes sensor model or spindle speed; the number of harmonics, the gains, the force and the modes'
  /// displacements stay.
  void retune(const ModalModel& sensor, double spindle_speed);

  /// Corrects the sensor model: the predicted measurement stays, the force jumps to explain it.
  /// @param gains of the new sensor; empty: the gains stay (same number of modes only)
  void replaceSensor(const ModalModel& sensor, std::vector<HarmonicGain> gains);

  /// Takes over the force of another filter (harmonics that it lacks: zero), so that a new design starts
  /// without a jump. @throws Error when the number of modes differs.
  void continueFrom(const HarmonicFilter& other);

  /// Fixed-interval smoother with the slowest gain (modified Bryson-Frazier, which stores innovations only).
  /// Starts from the present state and ends in that after the last sample. @return applied force [N].
  std::vector<double> smooth(const std::vector<double>& measured);

  double innovation() const { return innovation_; }                          ///< [N] of the last step
  double innovationStd() const { return innovation_std_[memory_.level()]; }  ///< [N] by design
  const HarmonicPairs& pairs() const { return pairs_; }
  const AdaptiveMemory& memory() const { return memory_; }  ///< level 0 quick .. LEVELS - 1 slow
  void setLevel(std::size_t level) { memory_.setLevel(level); }
  /// Weight of harmonic n in the force, 1 unless the cut is steady.
  double weight(std::size_t n) const {
    const std::size_t i = pairs_.modes() + n;
    return weights_[i / 4].g[i % 4];
  }
  /// False (the state of a filter made from gains): all weights of the harmonics are 1, as a smoother
  /// requires, which corrects the filter's force.
  void setWeighting(bool on) {
    weighting_ = on;
    if (!on && weighted_) resetWeights();
  }
  /// @param state in the coordinates of HarmonicGain
  void setState(const std::vector<double>& state);
  std::shared_ptr<const HarmonicSmoother> smoother() const;

 private:
  using GainBatch = HarmonicPairs::GainBatch;

  double advance(const GainBatch* gain, double innovation, double force_gain);
  void setModel(const ModalModel& sensor, double spindle_speed);
  void setGains();
  void replaceModes(const ModalModel& sensor, std::vector<HarmonicGain> gains);
  /// Weights of the next revolution by the innovations of this one.
  void endRevolution();
  void resetWeights();
  using WeightBatch = HarmonicPairs::WeightBatch;
  std::vector<WeightBatch> unitWeights() const;
  /// Share of an innovation in the force of its step, of each level.
  std::vector<double> forceGains(const std::vector<WeightBatch>& weights) const;

  HarmonicPairs pairs_;
  std::vector<HarmonicGain> design_;
  std::vector<std::vector<GainBatch>> gains_;
  std::vector<double> force_gain_, innovation_std_;
  std::vector<WeightBatch> weights_;           // [1] of the pairs in the force; 0: of a mode
  bool weighting_ = false, weighted_ = false;  // whether weights are used; whether one is not 1
  double predicted_output_ = 0.0, innovation_ = 0.0;
  double innovation_sum_ = 0.0;                        // [N2] of the running revolution
  std::size_t innovation_count_ = 0, revolution_ = 1;  // [samples]
  AdaptiveMemory memory_;
  mutable std::shared_ptr<const HarmonicSmoother> smoother_;  // empty: not computed yet
};

}  // namespace smartmill::kalman
