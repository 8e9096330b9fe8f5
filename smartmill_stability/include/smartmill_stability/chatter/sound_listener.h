#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_stability/chatter/sound_features.h"
#include "smartmill_stability/chatter/speed_advice.h"

namespace smartmill::stability {

struct SoundParameters {
  static constexpr int MOST_TEETH = 40;
  std::string channel;
  int teeth = 0;
  double speed_low = 0.0, speed_high = 0.0, speed = 0.0;

  void declare(ParameterTable& table) {
    table.text("channel", channel, "channel of the microphone; empty: the first one");
    table.number("teeth", teeth, "1", Range::closed(0, MOST_TEETH),
                 "of the tool; 0: set by sound/set_cut, before that no cut is judged");
    table.number("speed_low", speed_low, "rad/s", Range::notNegative(),
                 "lowest spindle speed to try; 0: half the speed of the first cut that chatters");
    table.number("speed_high", speed_high, "rad/s", Range::notNegative(),
                 "highest spindle speed to try; 0: twice the speed of the first cut that chatters");
    table.number("speed", speed, "rad/s", Range::notNegative(),
                 "spindle speed of the first cut, unless cnc/state or sound/set_cut state it; 0: found from "
                 "the harmonics");
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// What the operator states; fields that are empty stay.
struct CutSetting {
  std::optional<int> teeth;         ///< another number is another tool: the tries are forgotten
  std::optional<SpeedRange> range;  ///< [rad/s]
  std::optional<double> speed;      ///< [rad/s] of the next cut; 0: unknown
  bool restart = false;             ///< another tool, depth or material: the tries are forgotten
  bool discard_last = false;        ///< the last try was no cut
};

struct SoundState {
  enum class Kind { no_sound, idle, cutting };
  Kind kind = Kind::no_sound;
  double stamp = 0.0;                              ///< [s] newest sample
  double level = RecordingVerdict::UNKNOWN;        ///< [unit] RMS from 50 Hz to 20 kHz; NaN: no sound
  double quiet_level = RecordingVerdict::UNKNOWN;  ///< [unit] the same before the cut
  std::string unit;
  double clipped = 0.0;  ///< [1] share of the samples of the last second
  int teeth = 0;         ///< 0: not set
  double speed = 0.0;    ///< [rad/s] of the next or the running cut; 0: unknown
  SpeedRange range;
  std::vector<SoundTry> tries;  ///< in the order in which they were made; the last one may still run
  bool running = false;         ///< the last try is not complete
  SpeedAdvice advice;           ///< from the tries
  std::string silence;          ///< why there is no sound, one line; empty: there is
  std::string text;             ///< last event, one line
};

/// Finds the cuts in the sound of a microphone, has them judged, and proposes spindle speeds from them.
///
/// A cut begins where the band of chatter detection is CutFinderOptions::contrast times as loud as before for
/// a third of a second, and ends where it no longer is. Each two seconds (48 revolutions) of it are judged; a
/// part without a sign of teeth ends the cut, and its level is then that of the air: a spindle that starts,
/// coolant. A cut that ran when the sound began is heard by its end: its last part is judged against the air
/// after it and counts if it chatters, since a spindle that stops sounds like a stable cut that ends. A cut
/// chatters if one of its parts does. The speed is that of cnc/state, or the stated one; another speed begins
/// another cut.
///
/// Judging and the search take up to seconds: nextJob() returns the work, whose run() may be called in
/// another thread; finish() takes its outcome. The sound itself is kept for seconds only.
class SoundListener {
 public:
  /// @throws Error of SoundParameters::validate().
  explicit SoundListener(const SoundParameters& parameters);

  /// @throws Error on a missing channel.
  void push(const SampleBlock& block);
  void push(const CncState& state);
  /// The microphone is silent. @param reason for the log, one line
  void stop(const std::string& reason);
  /// @throws Error on values out of bounds; nothing is changed then.
  void set(const CutSetting& setting);

  struct Outcome;
  /// Part of a cut to be judged, with what is known so far.
  struct Job {
    /// Does not refer to the listener.
    Outcome run() const;

    std::uint64_t cut = 0, generation = 0;  // cut 0: the search only
    std::optional<CutSound> sound;          // empty: nothing more of the cut
    SoundTry result;                        // of the earlier parts
    std::optional<SoundTry> before;         // the same, if there are any
    bool last = false, recompute = false, chatter_only = false;
    int teeth = 0;
    SpeedRange range;
    std::vector<SoundTry> tries;
    SpeedAdvice advice;
  };
  struct Outcome {
    std::uint64_t cut = 0, generation = 0;
    bool last = false;
    bool part_is_cut = false;
    SoundTry result;
    SpeedAdvice advice;
    std::string error;
  };
  /// Empty: nothing to do. One job at a time: the next one follows finish().
  std::optional<Job> nextJob();
  void finish(const Outcome& outcome);

  const SoundState& state() const { return state_; }
  std::vector<SoundFeatures> takeFeatures();
  /// Lines for the log since the last call.
  std::vector<std::string> takeLines();

 private:
  struct Cut {
    std::uint64_t number = 0;
    std::uint64_t begin = 0, judged = 0;  // [samples]
    double begin_time = 0.0;              // [s]
    double speed = 0.0;                   // [rad/s]
    Recording air;
    std::size_t samples = 0, clipped = 0;
  };
  struct Part {
    std::uint64_t cut = 0;
    std::optional<CutSound> sound;
    bool last = false, chatter_only = false;
    double begin = 0.0, end = 0.0, clipped = 0.0;  // [s], [s], [1] of the cut so far
  };
  void reset(const SampleBlock& block);
  void pushSample(double time, double value, bool clipped);
  void endFrame();
  double partLength(double speed) const;
  double quiet() const;
  Recording soundOf(std::uint64_t from, std::uint64_t to) const;
  void begin(std::uint64_t sample);
  void endPart(Cut& cut, std::uint64_t end, bool last, bool chatter_only = false);
  void endCut(std::uint64_t end);
  bool isAfterEarlierCut(const SoundFrame& frame, double contrast);
  void judgeEarlierCut(std::uint64_t until);
  void dropCut();
  double presentSpeed() const;
  void followSpeed();
  void forgetTries();
  void discardLast();
  void updateTries();
  void note(const std::string& line);

  std::string channel_;
  SoundState state_;
  std::vector<std::string> lines_;
  std::vector<SoundFeatures> features_;

  // Stream
  double rate_ = 0.0;    // [Hz]; 0: begins anew
  double newest_ = 0.0;  // [s] end of the newest sample
  std::uint64_t next_index_ = 0, count_ = 0, air_from_ = 0;
  double last_ = 0.0;
  std::deque<double> sound_;  // newest samples, up to count_
  SoundFrames frames_;
  FeatureMaker maker_;
  std::deque<SoundFrame> recent_;      // without their power
  std::deque<double> quiet_;           // [unit2] loudness of frames in air
  std::size_t loud_ = 0, silent_ = 0;  // frames in succession
  std::optional<Cut> earlier_;         // that may run since the sound began; judged: its end, 0: not heard
  double stated_speed_ = 0.0, controller_speed_ = 0.0, controller_stamp_ = 0.0;

  std::optional<Cut> cut_;
  std::deque<Part> parts_;          // to be judged
  std::optional<SoundTry> result_;  // of the earlier parts of a cut
  std::vector<SoundTry> tries_;     // complete ones
  std::uint64_t cuts_ = 0, generation_ = 0;
  bool busy_ = false, recompute_ = false;
};

}  // namespace smartmill::stability
