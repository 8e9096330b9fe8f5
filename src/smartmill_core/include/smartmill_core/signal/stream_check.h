#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/signal/streams.h"

namespace smartmill {

/// Finds the faults of a sampled stream that the stream alone shows, within 0.5 s of its stamps, and keeps
/// wrong values from the estimators. Healthy data pass unchanged.
///
/// | fault | what happens to the data |
/// |---|---|
/// | sample not finite, or beyond every sensor (1e9 in SI units) | NaN: not measured |
/// | channel of a sensor that had noise and then repeats one value for 0.2 s | NaN until it changes |
/// | samples lost, index restarted | pass; the estimators see the index |
/// | block or reading received twice | dropped |
/// | stated rate differs from that of the stamps by more than 3 % | dropped from the second window of 0.2 s |
/// | stamps jump against the index or the angle | pass |
/// | block of more than five times the usual length | pass |
/// | angle does not advance by the stated speed | dropped |
/// | angle or speed out of range | dropped |
///
/// A wrong scale, sign or order of channels is not visible in sample blocks alone.
class StreamCheck {
 public:
  enum class Kind : std::uint8_t { value, stuck, gap, duplicate, rate, jump, angle, length };
  static constexpr std::size_t KINDS = 8;

  /// Where the samples come from: values of a controller are digital and repeat at rest.
  enum class Source : std::uint8_t { sensor, controller };
  explicit StreamCheck(Source source = Source::sensor) : source_(source) {}

  /// @return whether the block is to be used
  bool check(SampleBlock& block);
  /// @return whether the reading is to be used
  bool check(const SpindleAngle& reading);

  /// Lines of faults that began since the last call; one that lasts is repeated every 5 s of the stamps.
  std::vector<std::string> takeLines();
  /// Line of a fault within the last second of the stamps; empty: none.
  std::string present() const;
  /// [s] newest stamp; -inf before any
  double newest() const { return newest_; }
  /// The channel that has repeated its value for longest.
  struct Unchanged {
    std::string channel;
    double duration = 0.0;  ///< [s]
  };
  Unchanged longestUnchanged() const;
  /// [1] faults of a kind since the start: samples of value and stuck, readings of angle, else blocks
  std::size_t count(Kind kind) const { return episodes_[static_cast<std::size_t>(kind)].count; }
  /// [1] samples since the start that are missing in the running index
  std::uint64_t lostSamples() const { return lost_samples_; }

 private:
  static constexpr double NEVER = -std::numeric_limits<double>::infinity();  // [s]
  struct Episode {
    double seen = NEVER, announced = NEVER;  // [s]
    std::string line;
    std::size_t count = 0;
  };
  struct Channel {
    std::string name;
    double last = NOT_A_NUMBER;
    std::size_t run = 0;                        // samples that repeat the last value
    std::size_t changes = 0;                    // in the present window
    std::array<bool, 2> noisy{{false, false}};  // in the window before the last one, in the last one
    bool stuck = false, was_noisy = false;
  };
  /// Sums over a window of at least WINDOW.
  struct Window {
    double time = 0.0;      // [s] by index and rate, or of readings
    double error = 0.0;     // [s] or [rad], sum
    double largest = 0.0;   // [s] of one block
    double expected = 0.0;  // [rad]
    double allowed = 0.0;   // [rad]
    std::size_t count = 0;
  };

  void reset();
  void note(Kind kind, double stamp, std::size_t count, const std::string& text);
  bool isRepeated(const SampleBlock& block);
  void checkStamps(const SampleBlock& block);
  void endStampWindow(const SampleBlock& block);
  void checkLength(const SampleBlock& block);
  void checkValues(SampleBlock& block);
  void checkAdvance(const SpindleAngle& reading);

  Source source_;
  std::array<Episode, KINDS> episodes_;
  std::vector<std::string> lines_;
  double newest_ = NEVER;

  // Of the last block.
  std::optional<std::uint64_t> next_index_;
  std::uint64_t lost_samples_ = 0;
  std::uint64_t first_index_ = 0;
  double rate_ = 0.0;    // [Hz]
  double length_ = 0.0;  // [s] mean
  std::vector<Channel> channels_;
  std::size_t window_samples_ = 0;
  int wrong_windows_ = 0;

  // Of the last reading.
  std::optional<SpindleAngle> reading_;
  double period_ = 0.0;  // [s] mean time between readings
  bool disagrees_ = false;

  Window window_;
};

/// Compares the speed of spindle/angle with that of the controller: a tachometer of another gear or number of
/// pulses is consistent in itself.
class SpeedAgreement {
 public:
  /// @param speed [rad/s] of the controller; 0 or NaN: not known
  void setController(double stamp, double speed);
  /// @return one line when both have been steady for 0.25 s and differ by more than 10 %, every 5 s; else
  /// empty
  std::string check(const SpindleAngle& reading);
  bool disagrees() const { return disagrees_; }

 private:
  double controller_stamp_ = 0.0, controller_ = 0.0;             // [s], [rad/s]
  double since_ = 0.0, first_ = 0.0, first_controller_ = 0.0;    // [s], [rad/s] since when both are steady
  double announced_ = -std::numeric_limits<double>::infinity();  // [s]
  bool disagrees_ = false;
};

}  // namespace smartmill
