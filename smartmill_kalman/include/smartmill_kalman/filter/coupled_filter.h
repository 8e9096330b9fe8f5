#pragma once

#include <array>
#include <complex>
#include <string>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_kalman/filter/harmonic_filter.h"

namespace smartmill::kalman {

/// Response of sensor axis [row] to a force along [column], measured over applied force [1].
struct SensorMatrix {
  std::array<std::array<ModalModel, 3>, 3> h;

  std::array<std::array<std::complex<double>, 3>, 3> response(double f) const;  ///< at f [Hz]
  /// Largest over smallest singular value at f [Hz]: how much the inversion multiplies relative errors.
  double condition(double f) const;
};

/// Cross-talk of a column: gains of the modes that the axes themselves show, fitted to a measured FRF by
/// weighted least squares (linear, for the poles are known). @param frf of the row's sensor axis over the
/// column's force
/// @param own, other models of the column's and of the row's own axis @param low, high [Hz]
ModalModel fitCrossTalk(const FrequencyResponse& frf, const ModalModel& own, const ModalModel& other,
                        double low, double high);

/// Cross-talk correction of three single-axis filters: the harmonics of the force are the inverse of the
/// sensor matrix times the measured harmonics.
class CrossTalkInverse {
 public:
  /// @param harmonics of the filters. @throws Error when the matrix cannot be inverted at one of them.
  CrossTalkInverse(const SensorMatrix& sensor, double spindle_speed, double sample_rate, int harmonics);

  /// Corrects the force by the other axes. @param axes filters of x, y, z after their step @param force [N]
  /// of x, y, z
  void add(const std::vector<HarmonicFilter>& axes, std::array<double, 3>& force) const;

 private:
  /// Contribution of axis [column]'s harmonic n (state after the step) to the force along [row], without the
  /// single-axis estimate.
  std::vector<std::array<std::array<std::complex<double>, 3>, 3>> correction_;
};

/// Reads and writes a smartmill-sensor-matrix/1 file: xx .. zz, a model each, named measured axis first.
/// @throws Error of one line naming file, key and value.
SensorMatrix readSensorMatrix(const std::string& file);
void writeSensorMatrix(const SensorMatrix& matrix, const std::string& file);

/// Three axes with cross-talk (Bachrathy and Stepan eq. 2.3..2.7 at the harmonics of the spindle): one
/// HarmonicFilter per axis estimates the measured harmonics; the harmonics of the force are the inverse of
/// the matrix times these. Transients of the modes are compensated axis by axis.
class CoupledFilter {
 public:
  /// @throws Error when the matrix is singular at a harmonic.
  CoupledFilter(const SensorMatrix& sensor, double spindle_speed, double sample_rate,
                const HarmonicFilterParameters& parameters);

  /// @param measured x, y, z [N] @return applied x, y, z [N] at this sample.
  std::array<double, 3> step(const std::array<double, 3>& measured);

 private:
  std::vector<HarmonicFilter> axis_;
  std::vector<CrossTalkInverse> inverse_;  // one
};

}  // namespace smartmill::kalman
