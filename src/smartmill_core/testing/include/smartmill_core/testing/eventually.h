#pragma once

#include <chrono>
#include <thread>

namespace smartmill {

/// Waits until a condition holds; at most 200 s, for a busy computer. @param meanwhile called before each
/// check, as ros::spinOnce @return the condition at the end
template <class Condition, class Meanwhile>
bool eventually(Condition condition, Meanwhile meanwhile) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(200);
  for (meanwhile(); !condition(); meanwhile()) {
    if (std::chrono::steady_clock::now() > end) return condition();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

template <class Condition>
bool eventually(Condition condition) {
  return eventually(condition, [] {});
}

}  // namespace smartmill
