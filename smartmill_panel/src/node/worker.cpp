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
    tasks_.clear();
  }
  wake_.notify_one();
  if (thread_.joinable()) thread_.join();
}

bool Worker::post(std::function<void()> task) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (end_ || tasks_.size() >= MAX_QUEUED) return false;
    tasks_.push_back(std::move(task));
  }
  wake_.notify_one();
  return true;
}

bool Worker::busy() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return running_ || !tasks_.empty();
}

void Worker::run() {
  for (;;) {
    std::function<void()> task;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      running_ = false;
      wake_.wait(lock, [this] { return end_ || !tasks_.empty(); });
      if (end_) return;
      task = std::move(tasks_.front());
      tasks_.pop_front();
      running_ = true;
    }
    try {
      task();
    } catch (const std::exception& error) {
      ROS_ERROR("panel: %s", error.what());
    }
  }
}

}  // namespace smartmill::panel
