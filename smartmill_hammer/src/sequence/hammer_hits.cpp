// The hits of a HammerSequence: judged, repeated, at one height and at the second.

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>

#include "sequence_detail.h"
#include "smartmill_core/modal/hit_check.h"
#include "smartmill_hammer/analysis/coil_talk.h"
#include "smartmill_hammer/sequence/hammer_sequence.h"

namespace smartmill {
namespace hammer {
namespace {

/// Hits at the second height, at least; [m] of tool left above it.
constexpr int SECOND_HITS = 3;
constexpr double LEAST_SHANK = 4e-3;
/// Of the hammer's offset: less tells nothing.
constexpr double LEAST_LOWERED = 0.15;

}  // namespace

// Of a trial blow only the blow counts: the tool stands too far from the sensor for its answer to be judged.
HitFault HammerSequence::judged(const Hit& hit) const {
  HitCheckOptions options{parameters_.weak_force, parameters_.second_hit_share,
                          RANGE_SHARE * station_.range_volt, parameters_.force_high};
  if (stage_ != Stage::trial) return hitFault(hit, options);
  Hit blow = hit;
  blow.response = blow.force;
  options.response_range = 0.0;
  return hitFault(blow, options);
}

void HammerSequence::recorded(double now, HitCollector::Record record,
                              std::optional<HitCollector::Record> cross) {
  removeCoilTalk(record.hit, parameters_.coil_share);
  if (cross) removeCoilTalk(cross->hit, parameters_.coil_share);
  HitFault fault{record.fault, true};
  if (fault.text.empty() && cross) fault.text = cross->fault;
  if (fault.text.empty()) fault = judged(record.hit);
  if (!fault.text.empty()) return badHit(now, fault.text, fault.bad_data);
  if (stage_ == Stage::trial) return tried(now, record.hit);
  std::vector<Hit>& hits = second_ ? second_hits_ : hits_;
  hits.push_back(std::move(record.hit));
  if (cross && !second_) cross_hits_.push_back(std::move(cross->hit));
  const std::vector<HitFault> beside = faultsBeside(hits, std::vector<bool>(hits.size(), true));
  for (std::size_t h = 0; h < hits.size(); ++h) {
    if (beside[h].text.empty()) continue;
    hits.erase(hits.begin() + static_cast<std::ptrdiff_t>(h));
    if (!second_ && h < cross_hits_.size())
      cross_hits_.erase(cross_hits_.begin() + static_cast<std::ptrdiff_t>(h));
    return badHit(now, beside[h].text, beside[h].bad_data);
  }
  say("hit " + std::to_string(hits.size()) + " of " + std::to_string(hitsDue()), hitProgress());
  if (static_cast<int>(hits.size()) >= hitsDue() || enough()) return hitsDone(now);
  wait_ = Wait::rest;
  rest_until_ = now + parameters_.rest_time;
}

/// [1] with a second height the first one's hits end at 0.83.
double HammerSequence::hitProgress() const {
  const double from = second_ ? 0.87 : 0.7, to = second_ || !secondHeightDue() ? 0.95 : 0.83;
  const std::size_t hits = second_ ? second_hits_.size() : hits_.size();
  return from + (to - from) * static_cast<double>(hits) / hitsDue();
}

/// At the second height half as many: only the ratio to the first counts.
int HammerSequence::hitsDue() const {
  return second_ ? std::min(goal_.hits, std::max(SECOND_HITS, (goal_.hits + 1) / 2)) : goal_.hits;
}

void HammerSequence::hitsDone(double now) {
  if (!second_ && secondHeightDue()) return toSecondHeight(now);
  evaluate();
  retract(now);
}

/// [m] by which the tool is lowered for the second height: no further than the search of the flute has been,
/// and the hammer still meets the tool.
double HammerSequence::lowered() const {
  const double room = goal_.stickout - station_.offset - parameters_.read_height - LEAST_SHANK;
  return roundTo(std::min(0.5 * station_.offset, room), parameters_.resolution);
}

bool HammerSequence::correctsApart() const {
  return parameters_.tip_correction == "apart" && goal_.stickout > 0.0 && station_.offset > 0.0;
}

bool HammerSequence::secondHeightDue() const {
  return correctsApart() && parameters_.second_height != 0 && lowered() > LEAST_LOWERED * station_.offset;
}

/// First back to the station's distance, where nothing of the tool can reach the sensor; then down.
void HammerSequence::toSecondHeight(double now) {
  second_ = true;
  bad_hits_ = 0;
  stage_ = Stage::to_second;
  say("lowering the tool for hits at a second height", 0.83);
  Axes3 here{};
  double to_go = 0.0;
  readPosition(*state_, here, to_go);
  const Axes3 station = stationPosition();
  Axes3 beside = here;
  for (std::size_t axis = 0; axis < 2; ++axis) beside[axis] = station[axis];
  Axes3 down = beside;
  down[2] = station[2] - lowered();
  move(now, here, {{beside, parameters_.jog_feed}, {down, parameters_.approach_feed}});
}

/// The first height's hits stand for themselves.
void HammerSequence::withoutSecond(double now, const std::string& why) {
  no_second_ = why;
  second_hits_.clear();
  calibration_.reset();
  say("no second height: " + why, 0.95);
  evaluate();
  retract(now);
}

void HammerSequence::badHit(double now, const std::string& why, bool bad_data) {
  if (++bad_hits_ > parameters_.max_bad_hits) {
    if (second_) return withoutSecond(now, std::to_string(bad_hits_) + " useless hits, the last: " + why);
    return abort(now, bad_data ? FrfCode::bad_data : FrfCode::no_hit,
                 std::to_string(bad_hits_) + " useless hits, the last: " + why);
  }
  say("hit thrown away: " + why, hitProgress());
  wait_ = Wait::rest;
  rest_until_ = now + parameters_.rest_time;
}

}  // namespace hammer
}  // namespace smartmill
