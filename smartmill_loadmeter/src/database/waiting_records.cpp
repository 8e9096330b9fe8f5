#include "smartmill_loadmeter/database/waiting_records.h"

#include <utility>

#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

bool WaitingRecords::add(Store store) {
  waiting_.push_back(std::move(store));
  retry();
  if (waiting_.size() > most_) {
    waiting_.pop_front();
    ++lost_;
  }
  return waiting_.empty();
}

std::size_t WaitingRecords::retry() {
  std::size_t stored = 0;
  problem_.clear();
  while (!waiting_.empty()) {
    try {
      waiting_.front()();
    } catch (const Error& error) {
      problem_ = error.what();
      break;
    }
    waiting_.pop_front();
    ++stored;
  }
  return stored;
}

}  // namespace smartmill::loadmeter
