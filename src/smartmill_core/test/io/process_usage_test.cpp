#include "smartmill_core/io/process_usage.h"

#include <sys/resource.h>
#include <unistd.h>

#include <condition_variable>
#include <fstream>
#include <mutex>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace smartmill {
namespace {

// getrusage(2): user and system time.
double cpuTime() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * t.tv_usec; };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

TEST(ProcessUsage, CountsWhatTheProcessHas) {
  const ProcessUsage before = processUsage();
  std::vector<std::ifstream> files;
  for (int k = 0; k < 7; ++k) files.emplace_back("/proc/self/stat");
  std::vector<char> memory(64u << 20u, 1);
  std::mutex mutex;
  std::unique_lock<std::mutex> lock(mutex);
  std::vector<std::thread> threads;
  for (int k = 0; k < 3; ++k) threads.emplace_back([&] { const std::lock_guard<std::mutex> wait(mutex); });
  while (cpuTime() < 0.1) memory[static_cast<std::size_t>(cpuTime() * 1e6)] += 1;
  const double least = cpuTime();
  const ProcessUsage now = processUsage(::getpid());
  const double most = cpuTime();
  lock.unlock();
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(now.descriptors - before.descriptors, 7u);
  EXPECT_EQ(now.threads - before.threads, 3u);
  EXPECT_NEAR(now.memory - before.memory, 64.0 * (1u << 20u), 4.0 * (1u << 20u));
  EXPECT_GE(now.cpu_time, least - 0.021);  // two ticks of 10 ms
  EXPECT_LE(now.cpu_time, most + 0.021);
}

TEST(ProcessUsage, IsZeroOfAProcessThatIsNotThere) {
  const ProcessUsage none = processUsage(99999999);
  EXPECT_EQ(none.cpu_time, 0.0);
  EXPECT_EQ(none.threads, 0u);
}

}  // namespace
}  // namespace smartmill
