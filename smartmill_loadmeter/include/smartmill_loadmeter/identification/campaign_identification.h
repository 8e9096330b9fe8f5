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

/// Which samples of a record make its mean force.
enum class Means {
  all,         ///< every sample in cut
  revolutions  ///< the largest whole number of revolutions in cut: no part of one tooth counts twice
};

/// Six coefficients from the mean forces of a campaign's cuts, unweighted.
/// @throws Error naming the file and what is missing.
IdentifiedCoefficients identifyFromForceRecords(const Campaign& campaign, const MachineModel& model,
                                                Means means);

struct LoadRecordOptions {
  /// The model's stated uncertainty of the spindle section holds for load_meter_v_per_w and the bandwidth
  /// too; without it both are exact.
  bool spindle_uncertainty = false;
  /// [1] relative standard deviation of the axial depth, common to all cuts (the tool's length).
  double depth_uncertainty = 0.0;
  /// [m] RMS of the cutter axis' offset (runout) that is to be expected. With the spindle angle the offset is
  /// then found from the ripple; without it the coefficients are averaged over offsets up to sqrt(3) times as
  /// large, each as likely as means and scatter of the records make it.
  double runout_uncertainty = 0.0;
  /// Stribeck, warm-up, edge growth, runout and a slower load meter are tried where the records disagree.
  bool choose_terms = true;
};

struct LoadRecordResult {
  CoefficientSet set;
  double covariance_tc_te = 0.0;  ///< [N2/m3] of Ktc and Kte
  FrictionLaw friction;           ///< as found
  double bandwidth = 0.0;         ///< [Hz] of the load meter: the model's, or found
  double edge_growth = 0.0;       ///< [1/s] of Kte with the cutting time of the edge
  double runout = 0.0;            ///< [m] offset of the cutter axis
  double runout_angle = 0.0;  ///< [rad] of the offset, 0..2 pi, as effects.md; NaN: the records do not tell
  double noise = 0.0;         ///< [V] RMS of the load meter about each record's own best fit
  double misfit = 0.0;        ///< [1] chi2 per degree of freedom between the records; 1: they agree
  double disagreement = 0.0;  ///< [1] RMS of it, as a share of the records' voltage
  std::vector<std::string> terms;  ///< chosen by evidence beyond Coulomb and viscous friction
  std::vector<std::string> notes;  ///< lines for the user
};

/// Ktc and Kte from the load-meter records of a campaign's air cuts and cuts. The records are shorter than
/// the load meter needs to settle, so the whole response is fitted: the torque of each cut from engage_time
/// on (ripple of the teeth included, where the record knows the spindle angle) through the lag of known
/// bandwidth, together with the friction. Each record is condensed, without loss, into its idle torque and
/// the sizes of its responses; laws of friction and wear are then compared on those. Without air cuts the
/// model's friction with its stated uncertainty takes part as an observation. The standard deviations are the
/// larger of those from the noise and those from the scatter between records, plus the rounding where noise
/// does not dither it.
/// @throws Error naming the file and what is missing.
LoadRecordResult identifyFromLoadRecords(const Campaign& campaign, const MachineModel& model,
                                         const LoadRecordOptions& options);

/// A test of a campaign with its record.
struct TestRecord {
  CampaignTest test;
  Record record;
};
/// The same from records in memory. @param where names the source in messages.
LoadRecordResult identifyFromLoadRecords(const std::vector<TestRecord>& tests, const MachineModel& model,
                                         const LoadRecordOptions& options, const std::string& where);

}  // namespace smartmill::loadmeter
