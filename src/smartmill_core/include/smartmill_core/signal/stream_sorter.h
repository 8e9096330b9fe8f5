#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace smartmill {

/// Puts several streams into stamp order. roscpp keeps no order across topics; a node and an offline tool that both
/// feed this class hand the same sequence to the thinking, so live, replay and offline agree to the last digit.
///
/// An item of stamp t is delivered once every regular stream has passed t + hold_back. Regular streams (sensor
/// blocks, controller state) come all the time and hold the others back; events (goals, conditions) come seldom
/// and are waited for only by the hold-back. Equal stamps: in the order the streams were added, then as they came.
/// An item older than the last delivered one is delivered at once and counted in late().
/// Not thread-safe; deliver functions run inside push() and flush().
class StreamSorter {
 public:
  using Stream = std::size_t;
  using Deliver = std::function<void()>;

  /// @param hold_back [s] >= 0, time that an event may arrive after its stamp and still be in order
  explicit StreamSorter(double hold_back);

  Stream addRegular(std::string name);
  Stream addEvents(std::string name);

  /// A stream that may be absent is added as events and becomes regular with its first item; one that has died must
  /// not hold the others back any longer: what waited for it is delivered.
  void setRegular(Stream stream, bool regular);

  /// @param stamp [s], finite. @throws Error naming the stream when it is not.
  void push(Stream stream, double stamp, Deliver deliver);

  /// Delivers everything left, in order: end of data.
  void flush();

  /// Drops everything left and forgets all stamps: a bag was restarted.
  void reset();

  /// [1] items that came too late to be in order.
  std::size_t late() const { return late_; }

  /// Name of the regular stream that holds the others back, empty when none waits; for diagnostics.
  std::string waitingFor() const;

 private:
  using Key = std::pair<std::pair<double, Stream>, std::uint64_t>;
  struct Source {
    std::string name;
    bool regular;
    double newest;
  };
  void release(double up_to);
  double passed() const;

  double hold_back_;
  std::vector<Source> sources_;
  std::map<Key, Deliver> waiting_;
  std::uint64_t arrivals_ = 0;
  double delivered_;
  std::size_t late_ = 0;
};

}  // namespace smartmill
