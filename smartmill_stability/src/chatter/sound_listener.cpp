#include "smartmill_stability/chatter/sound_listener.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "chatter/cut_finder.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using Kind = RecordingVerdict::Kind;

constexpr std::size_t ONSET = 4;                         // [frames] louder or quieter in succession
constexpr std::size_t LEAST_QUIET = 6, MOST_QUIET = 25;  // [frames] of the level before the cut
constexpr std::size_t RECENT = 12;                       // [frames] of the clipped share
constexpr double AIR = 1.0;                              // [s] before the cut
/// A part of a cut: the recordings study judges 2.5 s; 36 revolutions are needed for several windows.
constexpr double PART = 2.0, PART_TURNS = 48.0, LONGEST_PART = 8.0;  // [s], [revolutions], [s]
constexpr double LONGEST_GAP = 0.05;                                 // [s] of lost samples that are bridged
constexpr double BACK = 1.0;            // [s] of stamps: a replay that begins again
constexpr double OTHER_SPEED = 0.03;    // [1] the harmonics correct less
constexpr double CONTROLLER_AGE = 2.0;  // [s]

/// Whether a try is used in another way than before.
bool differs(const SoundTry& a, const std::optional<SoundTry>& before) {
  constexpr double SAME = 0.005;  // [1] of speed and frequency
  if (!before || before->kind != a.kind || before->chatters() != a.chatters() || !a.decides()) return true;
  return std::abs(before->speed / a.speed - 1.0) > SAME ||
         (a.chatters() && std::abs(before->frequency / a.frequency - 1.0) > SAME);
}

}  // namespace

void SoundParameters::validate() const {
  checkBounds(*this);
  SpeedRange{speed_low, speed_high}.validate();
}

SoundListener::SoundListener(const SoundParameters& parameters) {
  parameters.validate();
  channel_ = parameters.channel;
  state_.teeth = parameters.teeth;
  state_.range = {parameters.speed_low, parameters.speed_high};
  state_.speed = stated_speed_ = parameters.speed;
}

// Stream

void SoundListener::push(const SampleBlock& block) {
  if (block.size() == 0) return;
  const std::size_t channel = channel_.empty() ? 0 : block.channel(channel_);
  if (rate_ > 0.0) {
    const auto step = static_cast<double>(block.first_index) - static_cast<double>(next_index_);
    if (block.stamp < newest_ - BACK) {
      forgetTries();
      rate_ = 0.0;
    } else if (block.sample_rate != rate_ || step < 0.0 || step > LONGEST_GAP * rate_) {
      stop(formatted("%.0f samples are missing", std::max(0.0, step)));
    } else {
      for (double k = 0.0; k < step; ++k) pushSample(block.stamp - (step - k) / rate_, last_, false);
    }
  }
  if (rate_ == 0.0) reset(block);
  state_.unit = block.units.empty() ? "" : block.units[channel];
  for (std::size_t i = 0; i < block.size(); ++i) {
    const double value = block.at(i, channel);
    const bool clipped = !std::isfinite(value);
    pushSample(block.timeOf(i), clipped ? last_ : value, clipped);
    if (rate_ == 0.0) return;  // silent
  }
  next_index_ = block.first_index + block.size();
}

void SoundListener::reset(const SampleBlock& block) {
  rate_ = block.sample_rate;
  count_ = air_from_ = 0;
  last_ = 0.0;
  sound_.clear();
  recent_.clear();
  quiet_.clear();
  loud_ = silent_ = 0;
  cut_.reset();
  earlier_ = Cut();
  earlier_->begin_time = block.stamp;
  frames_.reset(rate_);
  maker_.reset();
}

void SoundListener::pushSample(double time, double value, bool clipped) {
  last_ = value;
  sound_.push_back(value);
  ++count_;
  newest_ = time + 1.0 / rate_;
  if (static_cast<double>(sound_.size()) > (LONGEST_PART + 2.0 * AIR) * rate_) sound_.pop_front();
  if (frames_.push(time, value, clipped)) endFrame();
}

void SoundListener::endFrame() {
  const SoundFrame& frame = frames_.frame();
  if (frame.clipped == frame.samples) return stop("no values: muted or stuck");
  if (maker_.push(frame, frames_.step())) features_.push_back(maker_.features());
  recent_.push_back(frame);
  recent_.back().power.clear();
  if (recent_.size() > RECENT) recent_.pop_front();
  const auto share = [this](auto part) {
    double sum = 0.0;
    for (const SoundFrame& f : recent_) sum += part(f);
    return sum / static_cast<double>(recent_.size());
  };
  state_.stamp = newest_;
  state_.level = std::sqrt(frame.total);
  state_.clipped = share(
      [](const SoundFrame& f) { return static_cast<double>(f.clipped) / static_cast<double>(f.samples); });
  if (state_.kind == SoundState::Kind::no_sound) {
    state_.kind = SoundState::Kind::idle;
    state_.silence.clear();
    note("listening");
  }
  const CutFinderOptions detection;
  const bool loud = quiet_.size() >= LEAST_QUIET && frame.loudness > detection.contrast * quiet();
  if (!cut_) {
    loud_ = loud ? loud_ + 1 : 0;
    if (!isAfterEarlierCut(frame, detection.contrast) && !loud) {
      quiet_.push_back(frame.loudness);
      if (quiet_.size() > MOST_QUIET) quiet_.pop_front();
      state_.quiet_level = std::sqrt(share([](const SoundFrame& f) { return f.total; }));
    }
    if (loud_ >= ONSET) begin(count_ - loud_ * frame.samples);
    return;
  }
  silent_ = loud ? 0 : silent_ + 1;
  cut_->samples += frame.samples;
  cut_->clipped += frame.clipped;
  if (silent_ >= ONSET) {
    endCut(count_ - silent_ * frame.samples);
  } else if (static_cast<double>(count_ - cut_->judged) >= partLength(cut_->speed)) {
    endPart(*cut_, count_, false);
  }
}

/// [samples] @param speed [rad/s] 0: unknown
double SoundListener::partLength(double speed) const {
  const double turns = speed > 0.0 ? PART_TURNS * units::TWO_PI / speed : 0.0;
  return rate_ * std::clamp(turns, PART, LONGEST_PART);
}

double SoundListener::quiet() const {
  return median(std::vector<double>(quiet_.begin(), quiet_.end()));
}

/// Samples from..to of those that are kept.
Recording SoundListener::soundOf(std::uint64_t from, std::uint64_t to) const {
  const std::uint64_t first = count_ - sound_.size();
  Recording recording;
  recording.sample_rate = rate_;
  const auto at = [&](std::uint64_t sample) {
    return sound_.begin() + static_cast<std::ptrdiff_t>(std::max(sample, first) - first);
  };
  if (from < to) recording.channels.emplace_back(at(from), at(to));
  return recording;
}

// Cuts

void SoundListener::begin(std::uint64_t sample) {
  judgeEarlierCut(sample);
  Cut cut;
  cut.number = ++cuts_;
  cut.begin = cut.judged = sample;
  cut.begin_time = newest_ - static_cast<double>(count_ - sample) / rate_;
  cut.speed = presentSpeed();
  // The frame before the cut may contain its beginning.
  const std::uint64_t guard = recent_.back().samples, air = static_cast<std::uint64_t>(AIR * rate_);
  if (sample > guard) {
    const std::uint64_t end = sample - guard;
    cut.air = soundOf(std::max(air_from_, end > air ? end - air : 0), end);
  }
  cut_ = std::move(cut);
  silent_ = 0;
  state_.kind = SoundState::Kind::cutting;
}

/// Ends a part of a cut, which is then judged. @param end [samples] @param chatter_only another
/// verdict does not count
void SoundListener::endPart(Cut& cut, std::uint64_t end, bool last, bool chatter_only) {
  constexpr double LEAST = 0.5;  // [s] worth judging
  Part part;
  part.cut = cut.number;
  part.last = last;
  part.chatter_only = chatter_only;
  part.begin = cut.begin_time;
  part.end = newest_ - static_cast<double>(count_ - end) / rate_;
  part.clipped =
      static_cast<double>(cut.clipped) / static_cast<double>(std::max<std::size_t>(1, cut.samples));
  const auto length = static_cast<std::uint64_t>(partLength(cut.speed));
  if (static_cast<double>(end - std::min(end, cut.judged)) >= LEAST * rate_) {
    const std::uint64_t from = std::max(cut.begin, end > length ? end - length : 0);
    CutSound sound;
    sound.cut = soundOf(from, end);
    sound.cut.start = static_cast<double>(from - cut.begin) / rate_;
    sound.air = cut.air;
    sound.teeth = state_.teeth;
    sound.speed = cut.speed;
    part.sound = std::move(sound);
  } else if (cut.judged == cut.begin) {
    return;  // a bang
  }
  cut.judged = end;
  if (state_.teeth == 0) {
    if (last) note("a cut was heard; it is judged when the number of teeth is set");
    return;
  }
  parts_.push_back(std::move(part));
}

void SoundListener::endCut(std::uint64_t end) {
  endPart(*cut_, end, true);
  cut_.reset();
  loud_ = 0;
  air_from_ = count_;
  state_.kind = SoundState::Kind::idle;
}

/// Of a cut that ran when the sound began only the end is heard. @return whether the frame may be after it
bool SoundListener::isAfterEarlierCut(const SoundFrame& frame, double contrast) {
  if (!earlier_) return false;
  if (earlier_->judged > 0) {
    if (static_cast<double>(count_ - earlier_->judged) >= AIR * rate_) judgeEarlierCut(count_);
    return false;
  }
  earlier_->samples += frame.samples;
  earlier_->clipped += frame.clipped;
  const bool fell = quiet_.size() >= LEAST_QUIET && contrast * frame.loudness < quiet();
  silent_ = fell ? silent_ + 1 : 0;
  if (silent_ < ONSET) return fell;
  earlier_->judged = count_ - silent_ * frame.samples;
  silent_ = 0;
  quiet_.clear();
  return false;
}

/// @param until [samples] end of the air after it
void SoundListener::judgeEarlierCut(std::uint64_t until) {
  std::optional<Cut> cut = std::exchange(earlier_, std::nullopt);
  if (!cut || cut->judged == 0) return;
  const std::uint64_t guard = recent_.back().samples, end = std::exchange(cut->judged, cut->begin);
  cut->number = ++cuts_;
  cut->speed = presentSpeed();
  cut->air = soundOf(end + guard, until);
  endPart(*cut, end > guard ? end - guard : 0, true, true);
  air_from_ = end + guard;
}

void SoundListener::stop(const std::string& reason) {
  if (!state_.silence.empty()) return;
  std::string line = "no sound: " + reason;
  if (cut_) {
    line += formatted(", in a cut: the %.1f s that were heard are judged", newest_ - cut_->begin_time);
    endCut(count_);
  }
  state_.kind = SoundState::Kind::no_sound;
  state_.level = state_.quiet_level = RecordingVerdict::UNKNOWN;
  state_.clipped = 0.0;
  rate_ = 0.0;
  state_.silence = line;
  note(line);
}

// Speed and settings

double SoundListener::presentSpeed() const {
  return controller_speed_ > 0.0 && newest_ - controller_stamp_ < CONTROLLER_AGE ? controller_speed_
                                                                                 : stated_speed_;
}

void SoundListener::push(const CncState& state) {
  controller_speed_ = state.connected ? state.spindle_speed : 0.0;
  controller_stamp_ = state.stamp;
  followSpeed();
}

/// Another speed is another cut.
void SoundListener::followSpeed() {
  state_.speed = presentSpeed();
  if (!cut_ || state_.speed == 0.0) return;
  if (cut_->speed > 0.0 && std::abs(state_.speed / cut_->speed - 1.0) > OTHER_SPEED) {
    endCut(count_);
    begin(count_);
  } else if (cut_->speed == 0.0) {
    cut_->speed = state_.speed;
  }
}

void SoundListener::set(const CutSetting& setting) {
  constexpr int MOST_TEETH = SoundParameters::MOST_TEETH;
  if (setting.teeth && (*setting.teeth < 1 || *setting.teeth > MOST_TEETH))
    throw Error(formatted("teeth: %d: expected 1 to %d", *setting.teeth, MOST_TEETH));
  if (setting.range) setting.range->validate();
  const SpeedRange range = setting.range.value_or(state_.range);
  if (setting.speed) {
    const double speed = *setting.speed;
    if (!(speed >= 0.0) || !std::isfinite(speed))
      throw Error(formatted("speed: %g rad/s: expected a value above 0, or 0 for an unknown speed", speed));
    if (speed > 0.0 && range.high > 0.0 && (speed < range.low || speed > range.high))
      throw Error(formatted("speed: %.0f rpm: expected %.0f to %.0f rpm, the range of the spindle",
                            units::rpmFromRadPerSec(speed), units::rpmFromRadPerSec(range.low),
                            units::rpmFromRadPerSec(range.high)));
  }
  const bool other_tool = setting.teeth && *setting.teeth != state_.teeth;
  if (setting.teeth) state_.teeth = *setting.teeth;
  if (setting.restart || other_tool) {
    forgetTries();
  } else if (setting.discard_last) {
    discardLast();
  }
  recompute_ = recompute_ || setting.range.has_value();
  state_.range = range;
  if (setting.speed) stated_speed_ = *setting.speed;
  followSpeed();
}

void SoundListener::forgetTries() {
  ++generation_;
  tries_.clear();
  parts_.clear();
  result_.reset();
  state_.advice = {};
  recompute_ = false;
  dropCut();
  updateTries();
}

void SoundListener::discardLast() {
  ++generation_;
  recompute_ = true;
  if (state_.running) {
    result_.reset();
    parts_.clear();
    dropCut();
  } else if (!tries_.empty()) {
    tries_.pop_back();
  }
  updateTries();
}

void SoundListener::dropCut() {
  if (!cut_) return;
  cut_.reset();
  loud_ = 0;
  state_.kind = SoundState::Kind::idle;
}

void SoundListener::updateTries() {
  state_.tries = tries_;
  state_.running = result_ && result_->parts > 0;
  if (state_.running) state_.tries.push_back(*result_);
  state_.advice.used.resize(state_.tries.size(), false);
}

// Judgement

std::optional<SoundListener::Job> SoundListener::nextJob() {
  if (busy_ || (parts_.empty() && !recompute_)) return std::nullopt;
  Job job;
  job.generation = generation_;
  job.teeth = state_.teeth;
  job.range = state_.range;
  job.tries = tries_;
  job.advice = state_.advice;
  if (!parts_.empty()) {
    Part part = std::move(parts_.front());
    parts_.pop_front();
    job.cut = part.cut;
    job.sound = std::move(part.sound);
    job.last = part.last;
    job.chatter_only = part.chatter_only;
    job.result = result_.value_or(SoundTry());
    job.result.begin = part.begin;
    job.result.end = part.end;
    job.result.clipped = part.clipped;
    job.before = result_;
  }
  job.recompute = std::exchange(recompute_, false);
  busy_ = true;
  return job;
}

SoundListener::Outcome SoundListener::Job::run() const {
  Outcome outcome{cut, generation, last, false, result, advice, {}};
  try {
    if (sound) {
      const RecordingVerdict verdict = judgeCut(*sound);
      if (!chatter_only || verdict.kind == Kind::chatter) outcome.result.add(verdict);
      outcome.part_is_cut = verdict.kind != Kind::no_cut;
    }
    std::vector<SoundTry> all = tries;
    if (outcome.result.parts > 0) all.push_back(outcome.result);
    if (recompute || (outcome.result.parts > 0 && differs(outcome.result, before)))
      outcome.advice = adviseSpeeds(teeth, range, all);
  } catch (const Error& error) {
    outcome.error = error.what();
  }
  return outcome;
}

void SoundListener::finish(const Outcome& outcome) {
  busy_ = false;
  if (outcome.generation != generation_) return;
  if (!outcome.error.empty()) note(outcome.error);
  state_.advice = outcome.advice;
  if (outcome.cut == 0) return updateTries();
  bool last = outcome.last;
  if (!last && !outcome.part_is_cut) {
    // The running cut has ended, or was none: its level is that of the air.
    last = true;
    parts_.erase(std::remove_if(parts_.begin(), parts_.end(),
                                [&](const Part& part) { return part.cut == outcome.cut; }),
                 parts_.end());
    if (cut_ && cut_->number == outcome.cut) {
      dropCut();
      air_from_ = count_ - std::min(count_, recent_.size() * recent_.back().samples);
      quiet_.clear();
      for (const SoundFrame& frame : recent_) quiet_.push_back(frame.loudness);
    }
  }
  result_ = outcome.result;
  if (last) {
    if (!result_->text.empty()) note(result_->text);
    if (result_->parts > 0) tries_.push_back(*result_);
    result_.reset();
  }
  updateTries();
}

std::vector<SoundFeatures> SoundListener::takeFeatures() {
  return std::exchange(features_, {});
}

std::vector<std::string> SoundListener::takeLines() {
  return std::exchange(lines_, {});
}

void SoundListener::note(const std::string& line) {
  state_.text = line;
  lines_.push_back(line);
}

}  // namespace smartmill::stability
