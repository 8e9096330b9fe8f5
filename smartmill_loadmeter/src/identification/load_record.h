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
#include "smartmill_loadmeter/identification/identification.h"

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

/// What records are condensed about.
struct LoadPoint {
  double time_constant = 0.0;   ///< [s]
  double ktc = 1e9, kte = 1e4;  ///< [N/m2], [N/m]
  Runout runout;
};

/// One air cut or cut: its load-meter samples, condensed without loss into the sizes of the responses that
/// they can hold.
struct LoadRecord {
  double speed = 0.0;       ///< [rad/s]
  double start_time = 0.0;  ///< [s]
  double edge_age = 0.0;    ///< [s] cutting time of the edge in the middle of the cut
  bool cut = false;
  bool has_angle = false;  ///< of the spindle at each sample
  ToolGeometry tool;
  Engagement engagement;
  /// Without the angle runout acts through the mean alone: share of it, per Ktc and Kte.
  std::array<double, 2> share{{1.0, 1.0}};

  // How far samples scatter about their response: noise, and ripple where the angle is not known.
  double variance = 0.0;  ///< [V2]
  double in_cut = 1.0;    ///< [1] share of the samples that show the ripple
  double samples = 0.0;   ///< [1] those that the lag makes alike count once; 0: the scatter is not known
  bool sparse = false;    ///< teeth pass between the samples: they may meet a few phases of the ripple only
  /// [1] share of the power of each harmonic of a revolution that, taken at these times, looks like a level.
  std::vector<double> locked;

  // Condensed: target = rows x quantities, each with the noise of one sample.
  Eigen::MatrixXd rows;
  Eigen::VectorXd target;
  LoadRow sum = LoadRow::Zero();  ///< of the rows: what a constant error of the voltage does
  double left = 0.0;              ///< [V2] squares that the record's own best fit leaves
  double spread = 1.0;            ///< [1] noise of a row in units of the common one
  double rounding = 0.0;          ///< [V] of its level

  // Samples of a campaign's record; empty: a mean.
  std::vector<double> voltage;  ///< [V]
  std::size_t first = 0;        ///< sample at or after engagement
  double dt = 0.0, lead = 0.0;  ///< [s] sample interval; engagement before sample `first`
  bool throughout = false;      ///< in cut before the record began
  double engage_angle = 0.0;    ///< [rad] of the spindle
  std::vector<double> angle;    ///< [rad] from `first` on

  /// About a point; a mean is condensed by nature. @param resolution [V].
  void condense(const Spindle& spindle, const LoadPoint& about);
};

/// A record of a campaign.
LoadRecord loadRecord(const CampaignTest& test, const Record& record, const ToolGeometry& tool);

/// Steady readings of an air cut or a cut on the running machine. @param noise [V] common to the records.
/// @param first_stamp [s] of the session. @param edge_age [s].
LoadRecord loadRecord(const LoadTest& test, bool cut, const Spindle& spindle, double noise,
                      double first_stamp, double edge_age);

/// What an offset of the cutter axis, its angle not known, does to a cut: share of the mean torque, and the
/// ripple that comes through the lag. Tabulated over the offset.
class RunoutEffect {
 public:
  static constexpr std::size_t ANGLES = 4;  ///< even over one pitch

  /// @param largest [m] offset.
  RunoutEffect(const LoadRecord& record, const Spindle& spindle, double time_constant, double largest);

  /// Mean torque over that without runout, per Ktc and Kte.
  std::array<double, 2> share(double offset, std::size_t angle) const;
  std::array<double, 2> share(double offset) const;  ///< mean over the angles

  struct Variance {
    double ripple = 0.0;        ///< [V2]
    double interference = 0.0;  ///< [V2] RMS of what harmonics add to or take from each other at few phases
  };
  Variance variance(double offset, std::size_t angle, double ktc, double kte) const;
  /// Of the samples' mean, by harmonics whose phase they meet again and again [V2]; mean over the angles.
  double lockedVariance(double offset, double ktc, double kte, const std::vector<double>& locked) const;

 private:
  struct Node {
    std::array<double, 2> share{};
    std::vector<std::array<std::complex<double>, 2>> harmonics;  // [V] amplitude per N/m2 and N/m
  };
  static constexpr std::size_t NODES = 13;
  double at(double offset, std::size_t* node) const;
  std::vector<double> power(double offset, std::size_t angle, double ktc, double kte) const;

  double largest_;
  std::vector<std::array<Node, ANGLES>> nodes_;
};

}  // namespace smartmill::loadmeter
