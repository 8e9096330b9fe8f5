#pragma once

#include <optional>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/signal/stream_shift.h"

namespace smartmill::discrepancy {

/// By how much the force columns of a campaign are recorded later than those of the controller.
struct ForceShift : StreamShift {
  char axis = 'x';
};

/// A record with the test that describes it.
struct RecordedTest {
  CampaignTest test;
  Record record;
};

/// The shift at which the acceleration of an axis explains most of the force along it, by one mass for all
/// tests that record both and state no stream_offset: d'Alembert's force of what moves with the sensor.
/// @return no value: no such tests, no axis that explains a force, or several shifts
std::optional<ForceShift> shiftOfForces(const std::vector<RecordedTest>& tests,
                                        const StreamShiftOptions& options = {});

}  // namespace smartmill::discrepancy
