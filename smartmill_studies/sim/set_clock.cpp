// A shared library for LD_PRELOAD: the wall clock of a program is ahead of that of the computer by the
// seconds (a double) in the file SET_CLOCK_OFFSET, which may change at any time, as when someone sets the
// clock. The monotonic clock stays. Used by clock_steps.py.

#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdlib>

namespace {

constexpr long SECOND = 1000000000;           // [ns]
constexpr double SLICE = 0.05;                // [s] after which a wait notices that the clock was set
constexpr time_t LATEST_UPTIME = 1000000000;  // [s] a deadline beyond it is of the wall clock

const std::atomic<double>* offsetOfFile() {
  static const double none = 0.0;
  const char* const name = std::getenv("SET_CLOCK_OFFSET");
  const int file = name == nullptr ? -1 : open(name, O_RDONLY | O_CLOEXEC);
  void* const bytes = file < 0 ? MAP_FAILED : mmap(nullptr, sizeof(double), PROT_READ, MAP_SHARED, file, 0);
  if (file >= 0) close(file);
  return static_cast<const std::atomic<double>*>(bytes == MAP_FAILED ? static_cast<const void*>(&none)
                                                                     : bytes);
}

double offset() {
  static const std::atomic<double>* const value = offsetOfFile();
  return value->load(std::memory_order_relaxed);
}

template <class Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

int realTime(clockid_t clock, timespec* time) {
  static const auto call = next<int (*)(clockid_t, timespec*)>("clock_gettime");
  return call(clock, time);
}

timespec later(timespec time, double seconds) {
  const double whole = std::floor(seconds);
  time.tv_sec += static_cast<time_t>(whole);
  time.tv_nsec += static_cast<long>((seconds - whole) * static_cast<double>(SECOND));
  if (time.tv_nsec >= SECOND) ++time.tv_sec, time.tv_nsec -= SECOND;
  return time;
}

bool before(const timespec& a, const timespec& b) {
  return a.tv_sec != b.tv_sec ? a.tv_sec < b.tv_sec : a.tv_nsec < b.tv_nsec;
}

/// Waits in slices until a deadline of the set clock. @param wait until a time of the computer's clock
template <class Wait>
int waitUntil(const timespec& deadline, Wait wait) {
  for (;;) {
    timespec now{};
    realTime(CLOCK_REALTIME, &now);
    const timespec real = later(deadline, -offset()), slice = later(now, SLICE);
    const int code = wait(before(real, slice) ? real : slice);
    if (code != ETIMEDOUT || before(real, slice)) return code;
  }
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* time) {
  const int code = realTime(clock, time);
  if (code == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE))
    *time = later(*time, offset());
  return code;
}

int gettimeofday(timeval* value, void* /*zone*/) {
  timespec time{};
  clock_gettime(CLOCK_REALTIME, &time);
  value->tv_sec = time.tv_sec;
  value->tv_usec = time.tv_nsec / 1000;
  return 0;
}

time_t time(time_t* value) {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  if (value != nullptr) *value = now.tv_sec;
  return now.tv_sec;
}

int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* deadline) {
  static const auto call =
      next<int (*)(pthread_cond_t*, pthread_mutex_t*, const timespec*)>("pthread_cond_timedwait");
  if (deadline->tv_sec < LATEST_UPTIME) return call(condition, mutex, deadline);
  return waitUntil(*deadline, [&](const timespec& until) { return call(condition, mutex, &until); });
}

int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex, clockid_t clock,
                           const timespec* deadline) {
  static const auto call =
      next<int (*)(pthread_cond_t*, pthread_mutex_t*, clockid_t, const timespec*)>("pthread_cond_clockwait");
  if (clock != CLOCK_REALTIME) return call(condition, mutex, clock, deadline);
  return waitUntil(*deadline, [&](const timespec& until) { return call(condition, mutex, clock, &until); });
}

}  // extern "C"
