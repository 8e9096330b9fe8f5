#pragma once

#include <cstddef>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_kalman/in_cut/cutting_frf.h"

namespace smartmill::kalman {

/// Steady segment of a cut's record: tool displacement over the table sensor's force [m/N], x or y.
/// @param axis 0 or 1 @param sensor of that axis @param settling [s] after the entry, of tool, sensor and the
/// first marks on the surface @throws Error where a column is missing.
CutSegment toolSegment(const Record& record, const CampaignTest& test, std::size_t axis,
                       const ModalModel& sensor, double settling = 0.03);

/// Steady segment for the sensor itself [1]: measured force over the force that the model predicts for a
/// rigid tool, at harmonics of the tooth passing frequency (nearly independent of runout).
/// @param relative_std [1] of that force @throws Error where a column or a key is missing, and where the
/// model's tool is not rigid.
CutSegment sensorSegment(const Record& record, const CampaignTest& test, std::size_t axis,
                         const MachineModel& model, double relative_std, double settling = 0.03);

}  // namespace smartmill::kalman
