#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/error.h"

namespace smartmill {

/// Error in the data of a stream, which may be thrown while an item of another stream arrives.
class StreamError : public Error {
 public:
  StreamError(std::string stream, const std::string& what) : Error(what), stream_(std::move(stream)) {}
  const std::string& stream() const { return stream_; }

 private:
  std::string stream_;
};

/// Puts several streams into stamp order. roscpp does not preserve order across topics; with this class a
/// node and an offline tool process the same sequence, so that live, replay and offline results agree to the
/// last digit.
///
/// An item of stamp t is delivered once every regular stream has passed t + hold_back. Regular streams
/// (sensor blocks, controller state) are continuous and delay the others; events (goals, conditions) are rare
/// and are awaited only for the hold-back. Items of equal stamp are delivered in the order in which the
/// streams were added, then in order of arrival. An item older than the last delivered one is delivered at
/// once and counted in late().
///
/// When the stamps of a sampled stream jump back, a recording was restarted, and all state is reset. Each
/// stream is compared with its own stamps only, since under load one topic may arrive seconds after another.
/// Not thread-safe; deliver functions run inside push() and flush(). An Error that one throws becomes a
/// StreamError with the name of its own stream, which need not be the one that releases it.
class StreamSorter {
 public:
  using Stream = std::size_t;
  using Deliver = std::function<void()>;

  /// [s] A stamp this far behind the newest of its stream is a backward jump of time.
  static constexpr double RESTART = 1.0;

  /// @param hold_back [s] >= 0, time that an event may arrive after its stamp and still be in order
  explicit StreamSorter(double hold_back);

  /// @param patience [s] > 0; once the stream is behind the newest sample of all streams by more, it is not
  /// awaited until it continues, as after setRegular(stream, false). The order is that of the stamps unless
  /// the stream arrives later than that.
  Stream addRegular(std::string name, double patience = std::numeric_limits<double>::infinity());
  /// Sampled, but possibly absent: regular from its first item on, until setRegular(stream, false).
  Stream addOptional(std::string name) { return add(std::move(name), false, true, true, false); }
  /// Sampled, but never awaited.
  Stream addUnawaited(std::string name) { return add(std::move(name), false, false, true, false); }
  Stream addEvents(std::string name) { return add(std::move(name), false, false, false, false); }
  /// Events of which the last one remains valid (a latched topic). It is normally older than the data around
  /// it. The event of a new run may arrive before the run's first sample, and is then delivered again after
  /// the restart.
  Stream addLatched(std::string name) { return add(std::move(name), false, false, false, true); }

  /// @param forget called after a backward jump of time, before anything of the new run is delivered
  void onRestart(std::function<void()> forget) { forget_ = std::move(forget); }

  /// A stream that has ended no longer delays the others: items that waited for it are delivered.
  void setRegular(Stream stream, bool regular);

  /// @param stamp [s], finite. @throws Error naming the stream when it is not.
  void push(Stream stream, double stamp, Deliver deliver);

  /// An event without a stamp: ordered after all samples received so far; delivered at once before the first
  /// sample.
  void pushNow(Stream stream, Deliver deliver);

  /// End of data: delivers all remaining items in order.
  void flush();

  /// Drops all remaining items and all stamps.
  void reset();

  /// [s] newest stamp of the sampled streams; -inf before any.
  double newest() const;

  /// [1] items that arrived too late to be in order.
  std::size_t late() const { return late_; }

  /// Name of the regular stream that delays the others; empty if none does. For diagnostics.
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
    std::optional<Item> held;                                   // last item of a latched stream
    double patience = std::numeric_limits<double>::infinity();  // [s]
  };
  Stream add(std::string name, bool regular, bool optional, bool sampled, bool latched);
  void restart(double stamp);
  void release(double up_to);
  double passed() const;
  bool isAwaited(const Source& source) const;

  double hold_back_;
  std::vector<Source> sources_;
  std::map<Key, Deliver> waiting_;
  std::uint64_t arrivals_ = 0;
  double delivered_;
  double first_ = std::numeric_limits<double>::infinity();  // [s] oldest stamp of the sampled streams
  std::size_t late_ = 0;
  std::function<void()> forget_;
};

}  // namespace smartmill
