#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_kalman/tuning/memory_schedule.h"

namespace smartmill::kalman {

/// A calibration constant (applied over measured force) as a function of the length of tool and holder:
/// linear (Burzoni eq. 3-4), or with a linear reciprocal (bending beam).
struct LengthDependence {
  bool reciprocal = false;
  double slope = 0.0;                                           ///< [1/m]
  double offset = 0.0;                                          ///< [1]
  double slope_std = std::numeric_limits<double>::quiet_NaN();  ///< [1/m]
  double offset_std = std::numeric_limits<double>::quiet_NaN();
  double covariance = std::numeric_limits<double>::quiet_NaN();  ///< [1/m] of slope and offset
  double at(double length) const {                               ///< [1] at length [m]
    const double line = slope * length + offset;
    return reciprocal ? 1.0 / line : line;
  }
  /// Standard deviation [1] of at(); NaN where that of slope or offset is unknown.
  double stdAt(double length) const;
};

/// Calibration from six sensors to three forces (Burzoni ch. 3).
struct SpindleSensorCalibration {
  LengthDependence x, y, z;  ///< applied force over the pair's mean
  std::optional<LengthDependence> yx, yz,
      xz;  ///< cross-talk: load along the first axis over mean of the second axis' pair
  /// Dynamic cross-talk with static gain 1 (eq. 3-7), driven by the measured force of the first axis. Ideal:
  /// static cross-talk (eq. 3-5).
  ModalModel dynamic_yx, dynamic_yz, dynamic_xz;
  /// [m] range of tool and holder that the constants are valid for.
  std::array<double, 2> lengths{{0.0, std::numeric_limits<double>::infinity()}};
  std::array<double, 6> preload{{0, 0, 0, 0, 0, 0}};  ///< [N] > 0 compression of each sensor at rest
  double least_compression = 0.0;                     ///< [N] >= 0 with less a sensor does not measure
  double range_limit = std::numeric_limits<double>::infinity();  ///< [N] largest compression
  double low_pass = 0.0;  ///< [Hz] of force/measured, causal; 0: none. Not applied to the compensation.
  double drift_std = 5.0 / 60.0;  ///< [N/s] > 0 prior of a sensor's drift (Burzoni: to 5 N/min)
  std::array<std::complex<double>, 3> unbalance{};  ///< [kg m] F = Re(unbalance w^2 exp(i spindle angle))
  std::array<double, 3> unbalance_std{{0, 0, 0}};   ///< [kg m] prior; 0: unknown
  MemorySchedule memory;  ///< process noise of the filter over the spindle speed; empty: fixed design

  SpindleSensorCalibration();
  /// Burzoni Table 1, Table 3 and the preloads of section 3.1.
  static SpindleSensorCalibration table3();
  /// @throws Error naming key and value.
  void validate() const;
  /// @throws Error naming a length [m] of tool and holder outside the valid range.
  void checkLength(double length) const;
};

/// Pairs' means (eq. 3-1): x half the difference, y half the negative difference, z half the sum: a force
/// along the spindle compresses both sensors (eq. 3-5 prints a difference there, which would lose it).
/// @param sensors [N] order of SPINDLE_SENSOR_CHANNELS @return [N]
std::array<double, 3> pairMeans(const std::array<double, 6>& sensors);

/// Static calibration (eq. 3-5). @param means [N] pairMeans @param length [m] @return force on the tool [N]
std::array<double, 3> staticForce(const SpindleSensorCalibration& calibration, double length,
                                  const std::array<double, 3>& means);

/// Largest lateral force [N] along x or y (0, 1) alone that keeps every sensor of its pair between
/// least_compression and its range limit.
double lateralLimit(const SpindleSensorCalibration& calibration, double length, std::size_t axis);

/// Reads and writes a smartmill-spindle-sensor/1 file. @throws Error of one line naming file, key and value.
SpindleSensorCalibration readSpindleSensor(const std::string& file);
void writeSpindleSensor(const SpindleSensorCalibration& calibration, const std::string& file);

/// Static calibration measurements: weights hung on a dummy tool, one row each.
struct StaticMeasurements {
  std::vector<int> test;                       ///< measurements of one test have a common drift
  std::vector<double> time;                    ///< [s]
  std::vector<double> length;                  ///< [m] of tool and holder
  std::vector<std::array<double, 3>> load;     ///< [N] applied
  std::vector<std::array<double, 6>> sensors;  ///< [N]
  std::string file;                            ///< for messages
  std::size_t size() const { return time.size(); }
};

/// Table with columns test, time[s], length[mm], load_x[N], load_y[N], load_z[N], x1[N] .. z2[N].
/// @throws Error naming file, line and column.
StaticMeasurements readStaticMeasurements(const std::string& file);

/// Constants of one length of tool and holder, including those outside the triangular model.
struct ConstantsAtLength {
  double length = 0.0;                             ///< [m]
  std::array<std::array<double, 3>, 3> share{};    ///< [1] pair [row] per load along [column]
  std::array<std::array<double, 3>, 3> std_dev{};  ///< [1]
  double drift = 0.0;                              ///< [N/s] largest of all pairs and tests, removed
  double residual = 0.0;                           ///< [N] of a pair's mean, RMS
};

struct StaticCalibration {
  SpindleSensorCalibration calibration;  ///< with standard deviations of its lines
  std::vector<ConstantsAtLength> lengths;
};

struct StaticCalibrationOptions {
  double significant = 2.0;        ///< [std] least constant or cross-talk
  double proven_reciprocal = 9.0;  ///< [1] decrease of chi squared for a linear reciprocal: three deviations
  double length_margin = 2e-3;     ///< [m] validity of the constants beyond the measured lengths
};

/// Constants by least squares over all measurements of one length (offset and drift of every test are
/// unknowns), then their weighted lines over length (eq. 3-4). One length: no slope. A cross-talk within two
/// of its standard deviations is omitted. The reciprocal is linear where three or more lengths prove it.
/// @param base preload and limits. @throws Error when a direction was never loaded.
StaticCalibration calibrateStatic(const StaticMeasurements& measurements,
                                  const SpindleSensorCalibration& base,
                                  const StaticCalibrationOptions& options = {});

/// @throws Error naming the table and a length in it outside the valid range.
void checkLengths(const StaticMeasurements& measurements, const SpindleSensorCalibration& calibration);

/// [1] of the largest force, up to which a calibration is valid (Burzoni 3.2.1).
constexpr double LARGEST_STATIC_ERROR = 0.05;

/// Verification (Burzoni 3.2.1): largest difference between estimated and applied force over the largest
/// applied force, each axis [1]. Zero and drift come from the measurements without load. An axis that is
/// never loaded: over the largest load of all axes.
std::array<double, 3> verifyStatic(const StaticMeasurements& measurements,
                                   const SpindleSensorCalibration& calibration);

/// Dynamic cross-talk (static gain 1) from taps along the first axis.
/// @param force [N] measured by the first axis, one record a tap @param cross [N] pair's mean of the
/// second @param constant [1] calibration constant of that cross-talk @param sample_rate [Hz]
/// @param low, high [Hz] band of the fit @throws Error.
ModalModel fitDynamicCrossTalk(const std::vector<std::vector<double>>& force,
                               const std::vector<std::vector<double>>& cross, double constant,
                               double sample_rate, double low, double high, int max_modes);

}  // namespace smartmill::kalman
