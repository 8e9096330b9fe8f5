#include "smartmill_launch/session/control_verdict.h"

#include <cmath>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::session {
namespace {

// Speed and feed of the controller's state vary by less than this without a change of the overrides.
constexpr double CHANGE = 0.005;  // [1]
// A window of the detector lies wholly after a change when it ends this much later: it has 16 revolutions
// (chatter_revolutions of the shipped stability.yaml), after 12 in which the cut settles.
constexpr double REVOLUTIONS = 28.0;

bool differs(double value, double other) {
  return std::abs(value - other) > CHANGE * std::abs(other);
}

}  // namespace

bool ControlVerdict::suppressed() const {
  return std::isfinite(onset) && std::isfinite(duration) && after.kind == CutVerdict::Kind::stable;
}

std::string ControlVerdict::text() const {
  if (!std::isfinite(onset)) return "no chatter, nothing to control: " + after.text();
  const std::string chatter = formatted("chatter at %.1f Hz", frequency);
  if (!std::isfinite(duration)) return chatter + ", no override followed";
  return chatter +
         formatted("; %.2f s later spindle %.1f %%, feed %.1f %%, then ", duration, 100.0 * speed_ratio,
                   100.0 * feed_ratio) +
         after.text();
}

ControlVerdict controlVerdict(const std::vector<ChatterWindow>& windows, const std::vector<CutState>& states,
                              double speed, double feed) {
  ControlVerdict verdict;
  double changed = NOT_A_NUMBER;
  if (!states.empty()) {
    const CutState& last = states.back();
    verdict.speed_ratio = last.spindle_speed / speed;
    verdict.feed_ratio = last.feed / feed;
    for (const CutState& state : states) {
      if (differs(state.spindle_speed, last.spindle_speed) || differs(state.feed, last.feed))
        changed = state.stamp;
    }
  }
  std::vector<ChatterWindow> before, after;
  for (const ChatterWindow& window : windows) {
    if (window.chatter && !std::isfinite(verdict.onset)) verdict.onset = window.stamp;
    const bool is_before = std::isfinite(changed) &&
                           window.stamp < changed + REVOLUTIONS * units::TWO_PI / states.back().spindle_speed;
    (is_before ? before : after).push_back(window);
  }
  verdict.after = cutVerdict(after);
  verdict.frequency = cutVerdict(before.empty() ? after : before).frequency;
  if (changed > verdict.onset) verdict.duration = changed - verdict.onset;
  return verdict;
}

}  // namespace smartmill::session
