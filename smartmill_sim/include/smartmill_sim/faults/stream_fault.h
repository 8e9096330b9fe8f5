#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/signal/streams.h"

namespace smartmill::sim {

enum class FaultKind : std::uint8_t {
  off,           ///< nothing arrives
  stuck,         ///< the values before the fault are repeated
  garbage,       ///< NaN, infinity and 1e30 in turn
  scale,         ///< values times `value`; of an angle its advance
  sign,          ///< values, or direction of rotation, inverted
  swapped,       ///< values of the first two channels exchanged
  slow,          ///< `value` blocks arrive as one; of an angle every `value`-th reading arrives
  delayed,       ///< arrives `value` seconds of stamps later
  intermittent,  ///< arrives and is lost in turn, half a period of `value` seconds each
  duplicated,    ///< arrives twice
  wrong_rate,    ///< stated sample rate times `value`
  clock_step     ///< stamps plus `value` seconds
};
/// Names as in commands and parameters, in the order of FaultKind.
const std::vector<std::string>& faultNames();

/// A fault over a span of a stream's stamps.
struct StreamFault {
  FaultKind kind = FaultKind::off;
  double begin = 0.0;                                         ///< [s] after the first stamp of the stream
  double duration = std::numeric_limits<double>::infinity();  ///< [s]
  double value = 0.0;                                         ///< by kind, see FaultKind
};
/// @param duration [s] 0: without end @param value 0: the default of the kind
/// @throws Error on an unknown name or a number that the fault cannot have
StreamFault makeFault(const std::string& name, double begin, double duration, double value);

struct TopicFault {
  std::string topic;
  StreamFault fault;
};
/// Reads "TOPIC FAULT BEGIN DURATION [VALUE]; ...", empty: none. @throws Error naming the entry
std::vector<TopicFault> readFaults(const std::string& text);

/// A stream of SampleBlock or SpindleAngle with faults. Time is that of the stamps; a backward jump of the
/// healthy stream begins anew.
template <class Data>
class FaultyStream {
 public:
  /// @throws Error if the stream cannot have the fault: swapped and wrong_rate need sample blocks
  void add(const StreamFault& fault);
  /// Adds a fault that begins with the next item. @throws Error as add()
  void begin(StreamFault fault);
  void clear() { faults_.clear(); }

  /// @return what arrives in place of an item, in order
  std::vector<Data> push(const Data& data);
  /// @return what a delay has held back, at the end of the data
  std::vector<Data> flush();

 private:
  const StreamFault* active(double since) const;
  void distort(const StreamFault& fault, Data& data);

  std::vector<StreamFault> faults_;
  const StreamFault* last_fault_ = nullptr;
  std::optional<double> first_;  // [s]
  std::optional<Data> healthy_;  // last healthy item
  std::optional<Data> before_;   // last healthy item before the present fault
  std::deque<Data> held_;
  std::vector<Data> merged_;
  std::size_t count_ = 0;  // items of the present fault
  double turned_ = 0.0;    // [rad] reported angle, of scale and sign
};

}  // namespace smartmill::sim
