#pragma once

#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/cutting/regression.h"
#include "smartmill_core/model/machine_model.h"

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

/// Ktc and Kte from the load-meter records of a campaign's air cuts and cuts. The records are shorter than
/// the load meter needs to settle, so the whole response is fitted: the torque of each cut from engage_time
/// on (ripple of the teeth included, where the record knows the spindle angle) through the lag of known
/// bandwidth, together with the friction. Everything is linear in viscous, coulomb, Ktc and Kte. Without air
/// cuts the model's friction stands. The standard deviations are the larger of those from the noise and those
/// from the scatter between records.
/// @param notes lines for the user: what was left out.
/// @throws Error naming the file and what is missing.
CoefficientSet identifyFromLoadRecords(const Campaign& campaign, const MachineModel& model,
                                       std::vector<std::string>* notes);

}  // namespace smartmill::loadmeter
