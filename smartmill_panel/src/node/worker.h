#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace smartmill::panel {

/// A thread for blocking calls: services of other nodes, the master.
class Worker {
 public:
  Worker();
  ~Worker() { stop(); }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  static constexpr std::size_t MAX_QUEUED = 256;
  /// @return false if the queue is full or the worker has ended
  bool post(std::function<void()> task);
  bool busy();  ///< a task runs or is queued
  /// Waits for the running task and discards queued ones.
  void stop();

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> tasks_;
  bool end_ = false, running_ = false;
  std::thread thread_;
};

}  // namespace smartmill::panel
