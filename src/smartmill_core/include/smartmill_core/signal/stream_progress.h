#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace smartmill {

/// Compares the stamps of the streams that a node receives: one that is silent or arrives late falls behind
/// the others. Two others have to be ahead, where there are two, so that one whose clock is ahead blames
/// none.
class StreamProgress {
 public:
  using Stream = std::size_t;

  /// @param limit [s] of stamps by which a silent stream may be behind; one that arrives may be late by half
  /// of it. Infinite: it may pause.
  Stream add(double limit);
  /// A backward jump of the stamps begins anew for all streams.
  void heard(Stream stream, double stamp);

  /// Live. A stream is not behind while it only waits in a queue: it has been silent for the limit, or has
  /// been late for half of it while the others were current. @param period [s] since the last call @param now
  /// [s]
  void tick(double period, double now);
  /// In a replay: all data up to the newest stamp have been delivered, so that the stamps alone decide.
  void step();

  /// [s] behind the others; 0: not behind
  double behind(Stream stream) const { return streams_.at(stream).behind; }
  /// Lines of streams that have fallen behind since the last call.
  std::vector<std::pair<Stream, std::string>> takeLines() { return std::exchange(lines_, {}); }

 private:
  static constexpr double NEVER = -std::numeric_limits<double>::infinity();
  struct State {
    double limit = 0.0;                     // [s]
    double newest = NEVER, silent = 0.0;    // [s] stamp, ticks since it was heard
    double late_since = NEVER, late = 0.0;  // [s] stamp, ticks; NEVER: it is not late
    double behind = 0.0;                    // [s]
  };
  double lead(Stream stream) const;
  void set(Stream stream, bool behind, bool silent, double lead);

  std::vector<State> streams_;
  std::vector<std::pair<Stream, std::string>> lines_;
};

}  // namespace smartmill
