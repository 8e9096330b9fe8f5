#include "work.h"

#include <chrono>
#include <list>
#include <thread>

namespace smartmill::python {
namespace {

constexpr std::chrono::milliseconds LOOK{50};  // between two looks at signals

/// Threads whose caller has gone.
class AbandonedThreads {
 public:
  void add(std::thread thread) {
    const std::lock_guard<std::mutex> lock(mutex_);
    threads_.push_back(std::move(thread));
  }
  void join() {
    std::list<std::thread> threads;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      threads.swap(threads_);
    }
    for (std::thread& thread : threads) thread.join();
  }

 private:
  std::mutex mutex_;
  std::list<std::thread> threads_;
};

AbandonedThreads& abandonedThreads() {
  static AbandonedThreads threads;
  return threads;
}

/// @return whether the callback wants the work to end
bool call(const py::object& progress, double share, const std::string& line) {
  if (progress.is_none()) return false;
  const py::object answer = progress(share, line);
  return answer.is(py::bool_(false));
}

}  // namespace

void Work::progress(double share, const std::string& line) {
  check();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    messages_.push_back({share, line});
  }
  changed_.notify_one();
}

void runAndWait(const std::shared_ptr<Work>& work, const std::function<void()>& body,
                const py::object& progress) {
  std::thread thread([work, body] {
    std::exception_ptr failure;
    try {
      body();
    } catch (...) {
      failure = std::current_exception();
    }
    const std::lock_guard<std::mutex> lock(work->mutex_);
    work->failure_ = failure;
    work->done_ = true;
    work->changed_.notify_one();
  });
  try {
    const py::gil_scoped_release released;
    for (bool done = false; !done;) {
      std::deque<Work::Message> messages;
      {
        std::unique_lock<std::mutex> lock(work->mutex_);
        work->changed_.wait_for(lock, LOOK, [&] { return work->done_ || !work->messages_.empty(); });
        messages.swap(work->messages_);
        done = work->done_;
      }
      const py::gil_scoped_acquire acquired;
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      for (const Work::Message& message : messages) {
        if (call(progress, message.share, message.line)) work->stopped_ = true;
      }
    }
  } catch (...) {
    work->abandoned_ = true;
    abandonedThreads().add(std::move(thread));
    throw;
  }
  {
    const py::gil_scoped_release released;
    thread.join();
  }
  if (work->failure_) std::rethrow_exception(work->failure_);
}

void waitForAbandoned() {
  const py::gil_scoped_release released;
  abandonedThreads().join();
}

}  // namespace smartmill::python
