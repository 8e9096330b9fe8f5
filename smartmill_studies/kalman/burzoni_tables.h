#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "kalman/spindle_rig.h"
#include "smartmill_core/testing/reference_case.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"

namespace smartmill::kalman {

/// Spindle speeds of his tables [rpm].
constexpr std::array<double, 7> BURZONI_RPM{{1000, 4500, 6000, 8400, 9000, 11600, 17600}};
/// [1] Noise of taps over the square root of the R stated for them at which his Q arises: his calibration
/// constant (table 2), as if his R were that of the signal before it.
constexpr double BURZONI_TAP_NOISE = 18.0;

/// Data of the sensor in the simulated spindle, calibrated and tapped by the steps of the product, in air and
/// in seven slots.
struct BurzoniData {
  std::array<ModalModel, 2> sensor;
  std::array<ReferenceTaps, 2> taps, noisy_taps;  ///< as measured; with BURZONI_TAP_NOISE times the noise
  std::array<double, 2> r_tap{}, r_air{};         ///< [N2] before the hits; air cut at 9000 rpm
  std::array<std::vector<double>, 2> air;         ///< [N] at 9000 rpm, unbalance off
  std::array<std::vector<double>, 2> air_raw;     ///< [N] with it
  std::array<std::vector<double>, 2> still;       ///< [N] at rest
  std::vector<SpindleRig::Record> cuts;           ///< one per speed
  int flutes = 0;
};
/// Taps with white noise added to the response. @param rms [N]
ReferenceTaps withNoise(const ReferenceTaps& taps, double rms, std::uint64_t seed);
/// @param band [Hz] highest harmonic @throws Error
BurzoniData gatherBurzoni(const MachineModel& model, std::uint64_t seed, double band);

/// One speed of one of tables 8 to 15.
struct BurzoniRow {
  double rpm = 0.0;
  double q_printed = 0.0, rmse_printed = 0.0;    ///< [N2/s], [N]
  int exponent = 0;                              ///< of the Q from the taps, 2^n
  double rmse = 0.0;                             ///< [N] of the cut with that Q
  int cut_exponent = 0;                          ///< of the best Q of the cut
  double cut_rmse = 0.0, cut_wave = 0.0;         ///< [N], [%] with it
  int noisy_exponent = 0;                        ///< of the Q from the noisy taps
  double noisy_rmse = 0.0;                       ///< [N] of the cut with that Q
  double walk = 0.0;                             ///< [N] force as a random walk, same Q
  double harmonics = 0.0, harmonics_wave = 0.0;  ///< [N], [%] of this package's filter
  std::vector<double> curve;                     ///< [N] of the cut over the exponents of Q
};
struct BurzoniTable {
  std::string name;
  std::size_t axis = 0;
  double r_tap_printed = 0.0, r_cut_printed = 0.0, r_tap = 0.0, r_cut = 0.0;  ///< [N2]
  std::vector<BurzoniRow> rows;
};
/// Table 8 + number, number 0..7. @throws Error
BurzoniTable burzoniTable(const BurzoniData& data, std::size_t number, double band);
constexpr std::size_t BURZONI_TABLES = 8;

/// Static loads and unbalance (sections 3.2, 3.3) on the same machine, with the sensor calibrated by his
/// weights.
struct BurzoniStatics {
  SpindleSensorCalibration calibration;
  std::array<double, 3> verified{};                        ///< [1] error against the dynamometer at 120 mm
  std::array<std::vector<double>, 3> hung, sensor_output;  ///< [N] weights at 139 mm, and the sensor's output
  std::array<std::vector<double>, 2> pressed, on_table;    ///< [N] tool against the workpiece along x, y
  std::vector<double> turning;                             ///< [rpm] in air
  std::vector<std::vector<double>> unbalanced, balanced;   ///< [N] along x at each, with and without
};
/// @throws Error
BurzoniStatics gatherStatics(const MachineModel& model, std::uint64_t seed);

}  // namespace smartmill::kalman
