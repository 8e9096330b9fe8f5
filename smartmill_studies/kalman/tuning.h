#pragma once

#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace smartmill::kalman {

/// Burzoni's criterion on a simpler model than his: the force is a random walk of intensity q = 2^n [N2/s], n
/// = 1..30 (eq. 6-2), scored by the RMSE of amplitude spectra at the harmonics of a spindle speed (eq. 6-1).
/// His own model is the ExpandedDisturbanceFilter.
constexpr int LEAST_EXPONENT = 1, MOST_EXPONENT = 30;

/// RMSE [N s] of every exponent (rows) at every spindle speed (columns).
struct TuningMap {
  std::vector<double> speed;              ///< [rad/s]
  std::vector<std::vector<double>> rmse;  ///< [exponent - LEAST_EXPONENT][speed]
  /// Exponent of the least RMSE at a speed (nearest column).
  int best(double speed) const;
};

/// Force of a record through the random-walk filter. @param q [N2/s] @param r [N2]
std::vector<double> randomWalkForce(const std::vector<double>& measured, const ModalModel& sensor,
                                    double sample_rate, double q, double r);

/// Map from taps: filtered sensor output compared with the hammer force, harmonics up to `band` [Hz], +- 1 Hz
/// each. @param r [N2]
TuningMap tapMap(const ReferenceTaps& taps, const ModalModel& sensor, double sample_rate, double r,
                 const std::vector<double>& speeds, double band);

/// Taps of a sensor at the edge of its confidence interval (eq. 6-3, 6-4): the output spectra times
/// (1 + k s) exp(i k s), s the relative standard deviation of the measured FRF. @param k -3 .. 3
ReferenceTaps plantAt(const ReferenceTaps& taps, const FrequencyResponse& measured, double sample_rate,
                      double k);

/// Mean square of the signal before the hits [N2]: R of a tap test. @param before [s]
double noiseBefore(const ReferenceTaps& taps, double sample_rate, double before);

/// RMSE [N] of the amplitudes of all spindle harmonics up to `band`, over whole revolutions.
struct CutScore {
  double rmse = 0.0;       ///< [N]
  double amplitude = 0.0;  ///< [1] largest error of a tooth harmonic's amplitude, of those above 2 %
};
CutScore scoreCut(const std::vector<double>& force, const std::vector<double>& truth, double sample_rate,
                  double spindle_speed, int flutes, std::size_t from, double band, double amplitude_band);

/// Memory [revolutions] of the harmonics in each band, by the likelihood of a cut's innovations; it requires
/// only the measured force. Noise comes from the sensor and from the uncertainty of its FRF. @param edges
/// [Hz] between the bands, ascending @param frf measured, with std_dev
struct BandTuning {
  std::vector<double> memory;  ///< [1] one per band
  double log_likelihood = 0.0;
};
BandTuning tuneBands(const std::vector<double>& measured, const ModalModel& sensor, double spindle_speed,
                     double sample_rate, double noise_rms, const std::vector<double>& edges,
                     const FrequencyResponse& frf, int max_harmonics);

/// Force of a record through the filter with a memory per band.
std::vector<double> bandForce(const std::vector<double>& measured, const ModalModel& sensor,
                              double spindle_speed, double sample_rate, double noise_rms,
                              const std::vector<double>& edges, const std::vector<double>& memory,
                              int max_harmonics, double* log_likelihood = nullptr);

/// A map, and the best exponents of cuts [rad/s] as overlay.
struct NamedMap {
  std::string name;
  TuningMap map;
  std::vector<std::pair<double, int>> cuts;
};
/// Draws maps next to each other with gnuplot, with the optimum of the taps as a line and the cuts as dots.
/// @throws Error.
void drawMaps(const std::vector<NamedMap>& maps, const std::string& png);

}  // namespace smartmill::kalman
