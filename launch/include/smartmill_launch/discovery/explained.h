#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/reported_parameter.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_launch/discovery/believed_limits.h"
#include "smartmill_launch/session/cut_planner.h"

namespace smartmill::discovery {

/// The part of the report.json of `explain` (formats.md, smartmill-report/2) that a discovery uses.
struct Explained {
  struct Effect {
    std::string name;
    std::vector<ReportedParameter> parameters;
    std::string text() const;  ///< "runout: offset_um 9.02 +- 0.02, angle_deg 41 +- 1"
  };
  /// A test that would distinguish effects the records do not distinguish.
  struct SuggestedTest {
    std::string text;
    bool cut = false;       ///< false: air
    double speed = 0.0;     ///< [rad/s]
    Engagement engagement;  ///< of a cut
  };
  std::string verdict;
  std::vector<Effect> effects;
  std::vector<std::string> rivals;  ///< "runout or tooth_radius"
  std::optional<SuggestedTest> suggested_test;
  double gap_before = NOT_A_NUMBER,
         gap_after =
             NOT_A_NUMBER;  ///< [1] held-out tests; fitted tests if no held-out test shows a disagreement
  bool better = false;  ///< the gap of the fitted tests falls and that of the held-out tests does not grow
};

/// @throws Error with the file and what is wrong in it.
Explained readExplained(const std::string& file);

/// The suggested test as a slot, no deeper than the limits, or an air cut. @throws Error if it does not fit
/// machine, stock or tool.
session::PlannedCut planSuggestedTest(const session::CutPlanner& planner,
                                      const Explained::SuggestedTest& suggested_test,
                                      const session::SlotRequest& slot, double air_time,
                                      const BelievedLimits& limits = {});

}  // namespace smartmill::discovery
