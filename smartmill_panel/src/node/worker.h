#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace smartmill::panel {

/// A thread for what takes its time: services of other nodes, the master.
class Worker {
 public:
  Worker();
  ~Worker() { stop(); }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  static constexpr std::size_t MOST = 256;
  /// @return false: too much waits already, or it has ended
  bool post(std::function<void()> work);
  bool busy();  ///< something runs or waits
  /// What runs is waited for, what waits is forgotten.
  void stop();

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable news_;
  std::deque<std::function<void()>> works_;
  bool end_ = false, runs_ = false;
  std::thread thread_;
};

}  // namespace smartmill::panel
