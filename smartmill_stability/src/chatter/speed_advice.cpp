#include "smartmill_stability/chatter/speed_advice.h"

#include <algorithm>

#include "chatter/cut_finder.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using Kind = RecordingVerdict::Kind;

double secondsOf(const Recording& recording) {
  return recording.channels.empty()
             ? 0.0
             : static_cast<double>(recording.channels[0].size()) / recording.sample_rate;
}

}  // namespace

RecordingVerdict judgeCut(const CutSound& sound) {
  constexpr double MARGIN = 0.001;  // [s] of the interpolation
  constexpr int FAMILY = 2;         // [1] companions that show teeth
  RecordingRequest request;
  request.speed = sound.speed;
  request.teeth = sound.teeth;
  const RecordingVerdict alone = judgeRecording(sound.cut, request);
  if (!std::isfinite(alone.speed) ||
      secondsOf(sound.air) < CutFinder::windowOf(sound.cut, alone.speed) + MARGIN)
    return alone;
  request.speed = alone.speed;
  request.idle = sound.air;
  RecordingVerdict verdict = judgeRecording(sound.cut, request);
  const bool vibrates = verdict.kind == Kind::unsure || (verdict.chatter() && verdict.companions >= FAMILY);
  if (alone.kind == Kind::no_cut && !vibrates) return alone;
  verdict.speed_source = alone.speed_source;
  return verdict;
}

void SoundTry::add(const RecordingVerdict& part) {
  if (part.kind == Kind::no_cut) {
    if (parts == 0) kind = Kind::no_cut, text = part.text();
    return;
  }
  const bool chattered = kind == Kind::chatter;
  ++parts;
  if (part.kind == Kind::chatter) {
    if (chattered && part.probability <= probability) return;
    kind = part.kind;
    probability = part.probability;
  } else if (chattered) {
    return;
  } else {
    const double of_part = std::isnan(part.probability) ? 0.5 : part.probability;
    probability = parts == 1 ? of_part : probability + (of_part - probability) / parts;
    kind = probability < RecordingVerdict::STABLE_BELOW ? Kind::stable : Kind::unsure;
  }
  speed = part.speed;
  frequency = part.frequency;
  text = part.text();
}

void SpeedRange::validate() const {
  if (low == 0.0 && high == 0.0) return;
  if (!(low > 0.0) || !(high > low) || !std::isfinite(high))
    throw Error(formatted("speeds: %g to %g rad/s: expected 0 < low < high", low, high));
}

SpeedAdvice adviseSpeeds(int teeth, const SpeedRange& range, const std::vector<SoundTry>& tries) {
  constexpr double SLIP = 0.02;  // [1] a speed at the end of the range that is heard this much beyond it
  range.validate();
  SpeedAdvice advice;
  advice.used.assign(tries.size(), false);
  const auto first =
      std::find_if(tries.begin(), tries.end(), [](const SoundTry& t) { return t.decides() && t.chatters(); });
  SpeedRange speeds = range;
  if (speeds.high == 0.0 && first != tries.end()) {
    speeds = {0.5 * first->speed, 2.0 * first->speed};
    for (const SoundTry& t : tries)
      if (t.decides()) speeds = {std::min(speeds.low, t.speed), std::max(speeds.high, t.speed)};
  }
  const auto usable = [&](const SoundTry& t) {
    return t.decides() && (speeds.high == 0.0 ||
                           (t.speed > (1.0 - SLIP) * speeds.low && t.speed < (1.0 + SLIP) * speeds.high));
  };
  std::vector<HeardCut> cuts;
  bool stable = false;
  for (std::size_t k = 0; k < tries.size(); ++k) {
    if (!usable(tries[k])) continue;
    advice.used[k] = true;
    HeardCut cut;
    cut.speed = speeds.high == 0.0 ? tries[k].speed : std::clamp(tries[k].speed, speeds.low, speeds.high);
    stable = tries[k].kind == Kind::stable;
    if (!stable) cut.frequency = tries[k].frequency;
    cuts.push_back(cut);
  }
  const auto chattering =
      std::find_if(cuts.begin(), cuts.end(), [](const HeardCut& cut) { return cut.frequency.has_value(); });
  if (stable || chattering == cuts.end()) return advice;
  std::rotate(cuts.begin(), chattering, chattering + 1);
  SpeedSearch search(teeth, speeds.low, speeds.high);
  for (const HeardCut& cut : cuts) search.heard(cut);
  advice.speeds = bestProposals(search.proposals());
  const SpeedProposal next = search.next();
  const auto same = std::find_if(advice.speeds.begin(), advice.speeds.end(), [&](const SpeedProposal& p) {
    return std::abs(p.speed / next.speed - 1.0) < SLIP;
  });
  if (same != advice.speeds.end()) advice.speeds.erase(same);
  advice.speeds.insert(advice.speeds.begin(), next);
  return advice;
}

}  // namespace smartmill::stability
