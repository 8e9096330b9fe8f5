#include "node/worker.h"

#include <exception>

#include <ros/console.h>

namespace smartmill::panel {

Worker::Worker() : thread_([this] { run(); }) {
}

void Worker::stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    end_ = true;
    works_.clear();
  }
  news_.notify_one();
  if (thread_.joinable()) thread_.join();
}

bool Worker::post(std::function<void()> work) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (end_ || works_.size() >= MOST) return false;
    works_.push_back(std::move(work));
  }
  news_.notify_one();
  return true;
}

bool Worker::busy() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return runs_ || !works_.empty();
}

void Worker::run() {
  for (;;) {
    std::function<void()> work;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      runs_ = false;
      news_.wait(lock, [this] { return end_ || !works_.empty(); });
      if (end_) return;
      work = std::move(works_.front());
      works_.pop_front();
      runs_ = true;
    }
    try {
      work();
    } catch (const std::exception& error) {
      ROS_ERROR("panel: %s", error.what());
    }
  }
}

}  // namespace smartmill::panel
