#pragma once

#include <cstdint>
#include <deque>
#include <variant>
#include <vector>

#include "smartmill_exchange/items/observation.h"

namespace smartmill::exchange {

/// One observation of the agent's buffer.
struct Record {
  std::uint64_t sequence = 0;
  std::size_t item = 0;
  double time = 0.0;  ///< [s]
  std::variant<Unavailable, double, Text, DataSet, ConditionChange> content;
};

/// The last observation of each item; of a condition all active ones, or the last normal or unavailable one.
class Snapshot {
 public:
  explicit Snapshot(std::size_t items) : records_(items) {}
  void apply(const Record& record);
  const std::vector<Record>& of(std::size_t item) const { return records_[item]; }

 private:
  std::vector<std::vector<Record>> records_;
};

/// Ring buffer of observations with consecutive sequence numbers from 1.
class ObservationBuffer {
 public:
  /// Begins with all items unavailable. @param capacity [1] observations @param now [s]
  ObservationBuffer(std::size_t items, std::size_t capacity, double now);

  void push(const Observation& observation);

  std::uint64_t first() const { return records_.front().sequence; }
  std::uint64_t last() const { return next_ - 1; }
  std::uint64_t next() const { return next_; }
  std::size_t capacity() const { return capacity_; }
  const Record& at(std::uint64_t sequence) const { return records_[sequence - first()]; }

  const Snapshot& now() const { return now_; }
  /// State after the observation with a sequence number from first() to last().
  Snapshot stateAt(std::uint64_t sequence) const;

 private:
  void add(std::size_t item, double time, decltype(Record::content) content);

  std::size_t capacity_;
  std::uint64_t next_ = 1;
  std::deque<Record> records_;
  std::vector<Value> values_;  // last value of each item
  Snapshot now_, oldest_;      // oldest_: before the first record
};

}  // namespace smartmill::exchange
