#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace smartmill {

/// Puts several streams into stamp order. roscpp keeps no order across topics; a node and an offline tool
/// that both feed this class hand the same sequence to the thinking, so live, replay and offline agree to the
/// last digit.
///
/// An item of stamp t is delivered once every regular stream has passed t + hold_back. Regular streams
/// (sensor blocks, controller state) come all the time and hold the others back; events (goals, conditions)
/// come seldom and are waited for only by the hold-back. Equal stamps: in the order the streams were added,
/// then as they came. An item older than the last delivered one is delivered at once and counted in late().
///
/// A sampled stream whose stamps jump back tells that a recording was started again: everything is forgotten.
/// Each is judged by its own stamps, for under load one topic may come seconds after another.
/// Not thread-safe; deliver functions run inside push() and flush().
class StreamSorter {
 public:
  using Stream = std::size_t;
  using Deliver = std::function<void()>;

  /// A stamp this far behind the newest of its stream: time has jumped back. [s]
  static constexpr double RESTART = 1.0;

  /// @param hold_back [s] >= 0, time that an event may arrive after its stamp and still be in order
  explicit StreamSorter(double hold_back);

  Stream addRegular(std::string name) { return add(std::move(name), true, false, true, false); }
  /// Sampled, but it may be absent: regular from its first item on, until setRegular() says that it has died.
  Stream addOptional(std::string name) { return add(std::move(name), false, true, true, false); }
  /// Sampled, but never waited for.
  Stream addUnawaited(std::string name) { return add(std::move(name), false, false, true, false); }
  Stream addEvents(std::string name) { return add(std::move(name), false, false, false, false); }
  /// Events of which the last one holds on (a latched topic). It is older than the data around it by nature;
  /// that of a new run may come before the run's first sample, and is then delivered again after the restart.
  Stream addLatched(std::string name) { return add(std::move(name), false, false, false, true); }

  /// @param forget called when time has jumped back, before anything of the new run is delivered
  void onRestart(std::function<void()> forget) { forget_ = std::move(forget); }

  /// One that has died must not hold the others back any longer: what waited for it is delivered.
  void setRegular(Stream stream, bool regular);

  /// @param stamp [s], finite. @throws Error naming the stream when it is not.
  void push(Stream stream, double stamp, Deliver deliver);

  /// An event without a stamp of its own: behind all samples that have come, at once before any.
  void pushNow(Stream stream, Deliver deliver);

  /// Delivers everything left, in order: end of data.
  void flush();

  /// Drops everything left and forgets all stamps.
  void reset();

  /// [s] newest stamp of the sampled streams; -inf before any.
  double newest() const;

  /// [1] items that came too late to be in order.
  std::size_t late() const { return late_; }

  /// Name of the regular stream that holds the others back, empty when none waits; for diagnostics.
  std::string waitingFor() const;

 private:
  using Key = std::pair<std::pair<double, Stream>, std::uint64_t>;
  struct Item {
    double stamp;
    Deliver deliver;
  };
  struct Source {
    std::string name;
    bool regular, optional, sampled, latched;
    double newest;
    std::optional<Item> held;  // the last one of a latched stream
  };
  Stream add(std::string name, bool regular, bool optional, bool sampled, bool latched);
  void restart(double stamp);
  void release(double up_to);
  double passed() const;

  double hold_back_;
  std::vector<Source> sources_;
  std::map<Key, Deliver> waiting_;
  std::uint64_t arrivals_ = 0;
  double delivered_;
  std::size_t late_ = 0;
  std::function<void()> forget_;
};

}  // namespace smartmill
