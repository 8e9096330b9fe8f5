#pragma once

#include <chrono>
#include <future>

namespace smartmill {

/// Whether work was begun and has ended: get() does not wait.
template <class Result>
bool isReady(const std::future<Result>& work) {
  return work.valid() && work.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

}  // namespace smartmill
