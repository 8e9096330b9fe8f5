#pragma once

#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/cutting/regression.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/calibration/friction_law.h"

namespace smartmill::loadmeter {

/// Samples that the mean force of a record includes.
enum class Means {
  all,         ///< every sample in cut
  revolutions  ///< the largest integer number of revolutions in cut
};

/// Six coefficients from the mean forces of a campaign's cuts, unweighted.
/// @throws Error naming the file and what is missing.
IdentifiedCoefficients identifyFromForceRecords(const Campaign& campaign, const MachineModel& model,
                                                Means means);

struct LoadRecordOptions {
  /// The model's stated uncertainty of the spindle section also applies to load_meter_v_per_w and the
  /// bandwidth; otherwise both are exact.
  bool spindle_uncertainty = false;
  /// [1] relative standard deviation of the axial depth, common to all cuts (the tool's length).
  double depth_uncertainty = 0.0;
  /// [m] expected RMS of the cutter axis' offset (runout). With the spindle angle the offset is fitted to the
  /// ripple; without it the coefficients are averaged over offsets up to sqrt(3) times as large, weighted by
  /// the likelihood of the records' means and scatter.
  double runout_uncertainty = 0.0;
  /// Adds Stribeck friction, warm-up, edge growth, runout or another load-meter lag when the records
  /// disagree.
  bool choose_terms = true;
  /// [1] >= 2, least number of different feeds; the third is a check of the regression.
  std::size_t least_feeds = 3;
};

struct LoadRecordResult {
  CoefficientSet set;
  double covariance_tc_te = 0.0;   ///< [N2/m3] of Ktc and Kte
  FrictionLaw friction;            ///< fitted
  double bandwidth = 0.0;          ///< [Hz] of the load meter, fitted or the model's
  double edge_growth = 0.0;        ///< [1/s] of Kte with the cutting time of the edge
  double runout = 0.0;             ///< [m] offset of the cutter axis
  double runout_angle = 0.0;       ///< [rad] of the offset, 0..2 pi, as in effects.md; NaN: not observable
  double noise = 0.0;              ///< [V] RMS of the residual of each record's own best fit
  double misfit = 0.0;             ///< [1] chi2 per degree of freedom between the records; 1: consistent
  double disagreement = 0.0;       ///< [1] RMS of the residual between the records over that of their voltage
  std::vector<std::string> terms;  ///< added by evidence to Coulomb and viscous friction
  std::vector<std::string> notes;  ///< messages
};

/// Ktc and Kte from the load-meter records of a campaign's air cuts and cuts. The records are too short for
/// the load meter to settle, so that the whole response is fitted together with the friction: the torque
/// of each cut from engage_time on (with the ripple of the teeth if the record has the spindle angle) through
/// the first-order lag. Each record is condensed without loss into its idle torque and the amplitudes of its
/// responses; friction and wear laws are compared on those. Without air cuts the model's friction with its
/// stated uncertainty enters as an observation. The standard deviations are the larger of those from the
/// noise and from the scatter between records, plus the rounding error that noise does not dither.
/// @throws Error with the file and what is missing.
LoadRecordResult identifyFromLoadRecords(const Campaign& campaign, const MachineModel& model,
                                         const LoadRecordOptions& options);

/// Test of a campaign with its record.
struct TestRecord {
  CampaignTest test;
  Record record;
};
/// The same for records in memory. @param where source, for messages.
LoadRecordResult identifyFromLoadRecords(const std::vector<TestRecord>& tests, const MachineModel& model,
                                         const LoadRecordOptions& options, const std::string& where);

}  // namespace smartmill::loadmeter
