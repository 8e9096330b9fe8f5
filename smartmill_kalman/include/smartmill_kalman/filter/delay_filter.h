#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_kalman/filter/adaptive_memory.h"
#include "smartmill_kalman/filter/harmonic_filter.h"

namespace smartmill::kalman {

/// Discrete model of a sensor whose force repeats with a period T that is no whole number of samples.
/// State: sensor modes (two a mode, StateSpace form), then a line of forces F(k - 3) .. F(k - 3 + line - 1).
struct DelayModel {
  /// @param period [s] @throws Error where it is no 18 .. 1e6 samples.
  DelayModel(const ModalModel& sensor, double period, double sample_rate);
  /// Another period [samples]; line, interpolate and at change with it. @throws Error as above.
  void setPeriod(double samples);

  std::size_t modes = 0, line = 0;  ///< [1] modes of the sensor; forces kept, ceil(T) + TAPS / 2
  std::vector<double> transition;   ///< 2 x 2 of each mode, row-major
  std::vector<double> drive;        ///< [mode state][HOLD]: share of F(k - 3) .. F(k + 4) in the next state
  std::vector<double> output;       ///< of the modes' states
  double direct = 0.0;              ///< [1]
  std::vector<double> interpolate;  ///< TAPS shares of line[at] .. in F one period before the line's next
  std::size_t at = 0;
  double period = 0.0;  ///< [samples]

  static constexpr std::size_t HOLD = 8;   ///< points of the interpolation between two samples
  static constexpr std::size_t TAPS = 16;  ///< points of the interpolation one period earlier
  static constexpr std::size_t NOW = 3;    ///< line[NOW] is F(k)

  std::size_t states() const { return 2 * modes + line; }
  /// x(k + 1) = phi x(k), as long as states().
  void step(std::vector<double>& x) const;
  /// Measured of a state [N].
  double measured(const std::vector<double>& x) const;
};

struct DelayGainOptions {
  double quick = 1.5;  ///< [1] shortest memory over settling_revolutions: the line has more states than the
                       ///< harmonics
  /// Longest recursion, and relative rise of P per revolution at convergence. Frequencies that the sensor
  /// hardly transmits converge much later; the recursion then ends at its longest, if the variance of the
  /// innovation rises by less than `settled`.
  double max_revolutions = 1000.0, converged = 1e-7, settled = 1e-4;
};

/// Stationary gain P c' / (c P c' + r) of the model with white noise of variance q on every new force of the
/// line, by the Chandrasekhar recursion: P starts at zero and grows by one rank a step, which costs a step
/// O(states) where a Riccati step costs the cube.
/// @param q, r [N2] > 0 @return {gain, variance of the innovation as the last element}
/// @throws Error when it does not converge.
std::vector<double> delayGain(const DelayModel& model, double q, double r,
                              const DelayGainOptions& options = {});

/// Kalman filter of one axis with the force of Dunwoody eq. 7.1, F(t) = F(t - T), in place of the Fourier
/// series. Discrete: a line of the forces of one revolution; the force one period before the line's next
/// element is interpolated between samples (Lagrange, TAPS points: flat from zero to 0.4 of the sample rate's
/// half, gain at most 1, so the loop is stable at any T). The modes are discretised exactly (matrix
/// exponential) for a force that is the polynomial through HOLD samples.
///
/// Process noise q = r / tau^2 with tau the memory in revolutions; three memories as in HarmonicFilter.
/// The band is limited by the sensor
/// only. A step costs one pass over the line of T samples.
class DelayFilter {
 public:
  /// @param spindle_speed [rad/s] > 0, a revolution at least 18 samples @param parameters bandwidth and
  /// max_harmonics are not used. @throws Error.
  DelayFilter(const ModalModel& sensor, double spindle_speed, double sample_rate,
              const HarmonicFilterParameters& parameters);

  /// Filters one measured sample [N]. @return applied force [N] at this sample, from all samples up to it.
  double step(double measured);
  /// Advances the state without a measurement. @return predicted force [N].
  double predict() { return advance(0.0); }
  void reset();

  /// Changes the spindle speed: the force is kept as a function of the angle, the gains stay.
  void retune(double spindle_speed);
  /// Takes over the force of another filter of the same sensor, so that new gains start without a jump.
  void continueFrom(const DelayFilter& other);

  double innovation() const { return innovation_; }  ///< [N] of the last step
  double innovationStd() const { return innovation_std_[memory_.level()]; }
  std::size_t states() const { return model_.states(); }
  std::size_t level() const { return memory_.level(); }
  void setLevel(std::size_t level) { memory_.setLevel(level); }

  double spindleSpeed() const;  ///< [rad/s]

 private:
  double advance(double innovation);
  double expected() const;
  /// Resamples the line of another filter to the period of this one.
  void resampleFrom(const DelayFilter& other);

  double sample_rate_;
  DelayModel model_;
  std::vector<std::vector<double>> gain_;  // a level each
  std::vector<double> innovation_std_;
  AdaptiveMemory memory_;
  std::vector<double> modes_, next_, line_;  // the line is a window that moves through a longer array
  std::size_t head_ = 0;
  double innovation_ = 0.0;
};

}  // namespace smartmill::kalman
