#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>

#include <pybind11/pybind11.h>

namespace smartmill::python {

namespace py = pybind11;

/// Thrown in work whose caller has gone.
struct Abandoned : std::exception {
  const char* what() const noexcept override { return "abandoned"; }
};

/// State shared by long work and the Python thread that waits for it. The work runs in a thread of its own,
/// without the GIL and without Python objects.
class Work {
 public:
  /// Called by the work now and then. @throws Abandoned when the caller has gone
  void check() const {
    if (abandoned_) throw Abandoned();
  }
  /// The progress callback returned False: the work ends and returns what it has found.
  bool stopped() const { return stopped_; }
  /// @param share [1] done, 0..1 @param line may be empty. @throws Abandoned as check()
  void progress(double share, const std::string& line = {});

  /// Runs the work's body; in its thread.
  void run(const std::function<void()>& body);
  /// Waits for the thread with the GIL released and checks for signals 20 times a second: Ctrl-C raises
  /// KeyboardInterrupt at once, the abandoned thread ends at its next check(). Rethrows the body's exception.
  /// @param progress called in the waiting thread as progress(share, line), or None
  void wait(std::thread thread, const py::object& progress);

 private:
  struct Message {
    double share;
    std::string line;
  };
  bool handleNext(const py::object& progress);

  std::atomic<bool> abandoned_{false}, stopped_{false};
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Message> messages_;
  bool done_ = false;
  std::exception_ptr failure_;
};

/// Value of a function of Work& that runs as interruptible work. The function owns what it captures: it may
/// outlive the call.
template <typename Function>
auto interruptible(const py::object& progress, Function function) {
  using Result = std::invoke_result_t<Function, Work&>;
  const auto work = std::make_shared<Work>();
  const auto result = std::make_shared<std::optional<Result>>();
  std::thread thread([work, result, function = std::move(function)]() mutable {
    work->run([&] { result->emplace(function(*work)); });
  });
  work->wait(std::move(thread), progress);
  return std::move(**result);
}

/// Waits for abandoned threads before the interpreter ends. Ctrl-C then ends the process at once.
void waitForAbandoned();

}  // namespace smartmill::python
