#include "smartmill_exchange/mtconnect/observation_buffer.h"

#include <algorithm>

#include "smartmill_exchange/items/catalogue.h"

namespace smartmill::exchange {

void Snapshot::apply(const Record& record) {
  using Level = ConditionChange::Level;
  std::vector<Record>& records = records_[record.item];
  const auto* change = std::get_if<ConditionChange>(&record.content);
  const bool all = !change || change->level == Level::unavailable || change->code.empty();
  if (all) {
    records.assign(1, record);
    return;
  }
  const auto replaced = [&](const Record& other) {
    const auto* old = std::get_if<ConditionChange>(&other.content);
    return !old || old->level == Level::unavailable || old->level == Level::normal ||
           old->code == change->code;
  };
  records.erase(std::remove_if(records.begin(), records.end(), replaced), records.end());
  if (change->level != Level::normal) {
    records.push_back(record);
  } else if (records.empty()) {
    // The last activation has been cleared: normal, without a code.
    Record normal = record;
    normal.content = ConditionChange{Level::normal, {}, {}};
    records.push_back(normal);
  }
}

ObservationBuffer::ObservationBuffer(std::size_t items, std::size_t capacity, double now)
    : capacity_(std::max(capacity, items)), values_(items), now_(items), oldest_(items) {
  for (std::size_t i = 0; i < items; ++i) {
    if (catalogue()[i].category == Category::condition) {
      add(i, now, ConditionChange{});
    } else {
      add(i, now, Unavailable{});
    }
  }
}

void ObservationBuffer::push(const Observation& observation) {
  const Value before = values_[observation.item];
  values_[observation.item] = observation.value;
  if (catalogue()[observation.item].category == Category::condition) {
    for (ConditionChange& change : changesOf(before, observation.value))
      add(observation.item, observation.time, std::move(change));
    return;
  }
  std::visit(
      [&](const auto& value) {
        if constexpr (!std::is_same_v<std::decay_t<decltype(value)>, Activations>)
          add(observation.item, observation.time, value);
      },
      observation.value);
}

Snapshot ObservationBuffer::stateAt(std::uint64_t sequence) const {
  Snapshot state = oldest_;
  for (const Record& record : records_) {
    if (record.sequence > sequence) break;
    state.apply(record);
  }
  return state;
}

void ObservationBuffer::add(std::size_t item, double time, decltype(Record::content) content) {
  if (records_.size() == capacity_) {
    oldest_.apply(records_.front());
    records_.pop_front();
  }
  records_.push_back({next_++, item, time, std::move(content)});
  now_.apply(records_.back());
}

}  // namespace smartmill::exchange
