#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"

namespace smartmill::discrepancy {

struct StreamShiftOptions {
  double range = 1.0;  ///< [s] searched to either side (formats.md, stream_offset_s)
  /// [1] Share of the squares of the force that the acceleration explains at the shift: noise alone explains
  /// thousandths, an axis that moves a sensor nearly all where the records move.
  double min_explained = 0.2;
  double max_other = 0.5;  ///< [1] of that, of any other shift: a periodic motion fits at several
  double lobe = 0.5;       ///< [1] of the largest share, within which shifts belong to the same peak
};

/// By how much the force columns of a campaign are recorded later than those of the controller.
struct StreamShift {
  double delay = 0.0, std_dev = 0.0;  ///< [s]
  double explained = 0.0;             ///< [1] share of the squares of the force by the acceleration
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
std::optional<StreamShift> shiftOfForces(const std::vector<RecordedTest>& tests,
                                         const StreamShiftOptions& options = {});

}  // namespace smartmill::discrepancy
