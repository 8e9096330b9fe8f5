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
#include <type_traits>
#include <utility>

#include <pybind11/pybind11.h>

namespace smartmill::python {

namespace py = pybind11;

/// Ends work whose caller has gone.
struct Abandoned : std::exception {
  const char* what() const noexcept override { return "abandoned"; }
};

/// What long work and the Python thread that waits for it share. The work runs in a thread of its own,
/// without the GIL and without Python objects.
class Work {
 public:
  /// To be called by the work now and then. @throws Abandoned when nobody waits any more.
  void check() const {
    if (abandoned_) throw Abandoned();
  }
  /// The progress callback returned False: end with what has been found.
  bool stopped() const { return stopped_; }
  /// @param share [1] done, 0..1 @param line may be empty. @throws Abandoned as check()
  void progress(double share, const std::string& line = {});

 private:
  friend void runAndWait(const std::shared_ptr<Work>&, const std::function<void()>&, const py::object&);
  struct Message {
    double share;
    std::string line;
  };
  std::atomic<bool> abandoned_{false}, stopped_{false};
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Message> messages_;
  bool done_ = false;
  std::exception_ptr failure_;
};

/// Runs `body` in a thread and waits with the GIL released. Signals are looked at 20 times a second: Ctrl-C
/// raises KeyboardInterrupt at once, the work ends by itself at its next Work::check().
/// @param progress called in the waiting thread as progress(share, line), or None
void runAndWait(const std::shared_ptr<Work>& work, const std::function<void()>& body,
                const py::object& progress);

/// The same for a function of Work& that returns a value. What it captures must be its own: it may outlive
/// the call.
template <typename Function>
auto interruptible(const py::object& progress, Function function) {
  using Result = std::invoke_result_t<Function, Work&>;
  const auto work = std::make_shared<Work>();
  const auto result = std::make_shared<std::optional<Result>>();
  runAndWait(
      work,
      [work = work.get(), result, function = std::make_shared<Function>(std::move(function))] {
        result->emplace((*function)(*work));
      },
      progress);
  return std::move(**result);
}

/// Waits for abandoned work: before the interpreter ends.
void waitForAbandoned();

}  // namespace smartmill::python
