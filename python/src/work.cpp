#include "work.h"

#include <chrono>
#include <csignal>
#include <list>

namespace smartmill::python {
namespace {

constexpr std::chrono::milliseconds SIGNAL_PERIOD{50};  // between two checks for signals

/// Threads whose caller has gone. Used with the GIL held.
std::list<std::thread>& abandonedThreads() {
  static std::list<std::thread> threads;
  return threads;
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

void Work::run(const std::function<void()>& body) {
  std::exception_ptr failure;
  try {
    body();
  } catch (...) {
    failure = std::current_exception();
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    failure_ = failure;
    done_ = true;
  }
  changed_.notify_one();
}

bool Work::handleNext(const py::object& progress) {
  std::deque<Message> messages;
  bool done = false;
  {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait_for(lock, SIGNAL_PERIOD, [&] { return done_ || !messages_.empty(); });
    messages.swap(messages_);
    done = done_;
  }
  const py::gil_scoped_acquire acquired;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  if (!progress.is_none()) {
    for (const Message& message : messages)
      if (progress(message.share, message.line).is(py::bool_(false))) stopped_ = true;
  }
  return !done;
}

void Work::wait(std::thread thread, const py::object& progress) {
  try {
    const py::gil_scoped_release released;
    while (handleNext(progress)) {
    }
    thread.join();
  } catch (...) {
    abandoned_ = true;
    abandonedThreads().push_back(std::move(thread));
    throw;
  }
  if (failure_) std::rethrow_exception(failure_);
}

void waitForAbandoned() {
  std::list<std::thread> threads;
  threads.swap(abandonedThreads());
  if (threads.empty()) return;
  PyOS_setsig(SIGINT, SIG_DFL);
  const py::gil_scoped_release released;
  for (std::thread& thread : threads) thread.join();
}

}  // namespace smartmill::python
