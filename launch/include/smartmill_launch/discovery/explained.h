#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/reported_parameter.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_launch/session/cut_planner.h"

namespace smartmill::discovery {

/// What a report.json of `explain` says (formats.md, smartmill-report/1), as far as a discovery needs it.
struct Explained {
  struct Effect {
    std::string name;
    std::vector<ReportedParameter> parameters;
    std::string text() const;  ///< "runout: offset_um 9.02 +- 0.02, angle_deg 41 +- 1"
  };
  /// A test that would tell rivals apart.
  struct Wanted {
    std::string text;
    bool cut = false;       ///< false: air
    double speed = 0.0;     ///< [rad/s]
    Engagement engagement;  ///< of a cut
  };
  std::string verdict;
  std::vector<Effect> effects;
  std::vector<std::string> rivals;  ///< "runout or tooth_radius"
  std::optional<Wanted> wanted;
  double gap_before = NOT_A_NUMBER,
         gap_after = NOT_A_NUMBER;  ///< [1] held out; of the fit where no test is, or none shows anything
  bool better = false;              ///< the improved model fits better, and the held-out tests no worse
};

/// @throws Error naming file and fault.
Explained readExplained(const std::string& file);

/// The wanted test as a slot or an air cut. @throws Error saying what of machine, stock or cutter it does not
/// fit.
session::PlannedCut planWanted(const session::CutPlanner& planner, const Explained::Wanted& wanted,
                               const session::SlotWish& frame, double air_time);

}  // namespace smartmill::discovery
