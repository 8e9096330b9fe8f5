#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/identification/load_test.h"

namespace smartmill::loadmeter {

/// Columns of a record, in units of a typical value: idle torque, Ktc, Kte, log of the time constant, runout
/// x, y.
enum LoadColumn { IDLE, KTC, KTE, LAG, RUNOUT_X, RUNOUT_Y, LOAD_COLUMNS };
using LoadRow = Eigen::Matrix<double, LOAD_COLUMNS, 1>;
const LoadRow& loadUnits();

/// Offset of the cutter axis [m], towards tooth 1 and across.
struct Runout {
  double x = 0.0, y = 0.0;
};

/// Point of linearisation of condensed records.
struct LoadPoint {
  double time_constant = 0.0;   ///< [s]
  double ktc = 1e9, kte = 1e4;  ///< [N/m2], [N/m]
  Runout runout;
};

/// Load-meter samples of an air cut or a cut, condensed without loss into the amplitudes of the responses
/// that they resolve.
struct LoadRecord {
  double speed = 0.0;       ///< [rad/s]
  double start_time = 0.0;  ///< [s]
  double edge_age = 0.0;    ///< [s] cutting time of the edge at the middle of the cut
  bool cut = false;
  bool has_angle = false;  ///< spindle angle at each sample
  ToolGeometry tool;
  Engagement engagement;
  /// Without the angle: ratio of the mean torque with runout to that without, for Ktc and Kte.
  std::array<double, 2> mean_ratio{{1.0, 1.0}};

  // Scatter of the samples about the response: noise, and ripple without the angle.
  double variance = 0.0;  ///< [V2]
  double in_cut = 1.0;    ///< [1] share of the samples in cut
  double samples = 0.0;   ///< [1] number of independent samples; 0: the scatter is unknown
  bool sparse =
      false;  ///< several tooth passes between samples, which may sample only a few phases of the ripple
  /// Share of the power of each harmonic of a revolution that is aliased to zero frequency at the sample
  /// times [1].
  std::vector<double> aliased_share;

  // Condensed: target = rows x quantities, each with the noise of one sample.
  Eigen::MatrixXd rows;
  Eigen::VectorXd target;
  LoadRow sum = LoadRow::Zero();  ///< of the rows: effect of a constant voltage error
  double residual_squares = 0.0;  ///< [V2] residual sum of squares of the record's own best fit
  double spread = 1.0;            ///< [1] noise of a row over the common noise
  double rounding = 0.0;          ///< [V] rounding error of the level

  // Samples of a campaign's record; empty: the record is a mean.
  std::vector<double> voltage;  ///< [V]
  std::size_t first = 0;        ///< sample at or after engagement
  double dt = 0.0, lead = 0.0;  ///< [s] sample interval; engagement before sample `first`
  bool starts_in_cut = false;   ///< in cut before the start of the record
  double engage_angle = 0.0;    ///< [rad] of the spindle
  std::vector<double> angle;    ///< [rad] from `first` on

  /// Condenses the samples about a point; no effect on a mean.
  void condense(const Spindle& spindle, const LoadPoint& about);
};

/// From a record of a campaign.
LoadRecord loadRecord(const CampaignTest& test, const Record& record, const ToolGeometry& tool);

/// From the steady readings of an air cut or a cut. @param noise [V] common to the records.
/// @param first_stamp [s] of the session. @param edge_age [s].
LoadRecord loadRecord(const LoadTest& test, bool cut, const Spindle& spindle, double noise,
                      double first_stamp, double edge_age);

/// Effect of an offset of the cutter axis with unknown angle on a cut: ratio of the mean torque and the
/// ripple behind the lag, tabulated over the offset.
class RunoutEffect {
 public:
  static constexpr std::size_t ANGLES = 4;  ///< evenly spaced over one pitch

  /// @param largest [m] offset.
  RunoutEffect(const LoadRecord& record, const Spindle& spindle, double time_constant, double largest);

  /// Ratio of the mean torque to that without runout, for Ktc and Kte.
  std::array<double, 2> meanRatio(double offset, std::size_t angle) const;
  std::array<double, 2> meanRatio(double offset) const;  ///< mean over the angles

  struct Variance {
    double ripple = 0.0;        ///< [V2]
    double interference = 0.0;  ///< [V2] RMS of the interference of harmonics at few phases
  };
  Variance variance(double offset, std::size_t angle, double ktc, double kte) const;
  /// Variance of the samples' mean by aliased harmonics [V2]; mean over the angles.
  double aliasedVariance(double offset, double ktc, double kte,
                         const std::vector<double>& aliased_share) const;

 private:
  struct Node {
    std::array<double, 2> mean_ratio{};
    std::vector<std::array<std::complex<double>, 2>> harmonics;  // [V] amplitude per N/m2 and N/m
  };
  static constexpr std::size_t NODES = 13;
  double at(double offset, std::size_t* node) const;
  std::vector<double> power(double offset, std::size_t angle, double ktc, double kte) const;

  double largest_;
  std::vector<std::array<Node, ANGLES>> nodes_;
};

}  // namespace smartmill::loadmeter
