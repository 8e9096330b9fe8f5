#include "smartmill_cnc/linuxcnc/servo_stream.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "smartmill_cnc/linuxcnc/silence_timer.h"

namespace smartmill::cnc::linuxcnc {
namespace {

constexpr double PERIOD = 1e-3;

ServoBlock blockOf(std::uint32_t first, std::size_t count) {
  ServoBlock block;
  block.first = first;
  block.samples.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    block.samples[i].revolutions = static_cast<double>(first + i);
  }
  return block;
}

/// [s] delay on a busy computer: exponential with mean 3 ms, 80 ms in 1 % of the cases.
double late(std::mt19937& random) {
  const double usual = std::exponential_distribution<double>(1.0 / 3e-3)(random);
  return std::bernoulli_distribution(0.01)(random) ? 0.08 : usual;
}

TEST(ServoClock, TimesFollowTheEarliestArrivals) {
  std::mt19937 random(3);
  ServoClock clock(PERIOD);
  for (std::uint64_t n = 0; n < 60'000; n += 3) {
    clock.addArrival(n, 100.0 + PERIOD * static_cast<double>(n) + late(random));
    if (n > 10'000) {
      ASSERT_NEAR(clock.timeOf(n), 100.0 + PERIOD * static_cast<double>(n), 1e-4);
    }
  }
}

TEST(ServoClock, TracksAFastOrSlowClockWithoutSteps) {
  for (const double drift : {5e-5, -5e-5}) {
    std::mt19937 random(4);
    ServoClock clock(PERIOD);
    double before = 0.0;
    for (std::uint64_t n = 0; n < 300'000; n += 3) {
      const double taken = 100.0 + PERIOD * (1.0 + drift) * static_cast<double>(n);
      clock.addArrival(n, taken + late(random));
      if (n > 60'000) {
        // The earliest arrival of the last two windows of 10 s is at most 20 s old.
        EXPECT_NEAR(clock.timeOf(n), taken, 20.0 * std::abs(drift) + 1e-4) << n;
        EXPECT_NEAR(clock.timeOf(n) - before, 3.0 * PERIOD, 3.0 * PERIOD * 0.01 + 1e-4 * 0.1);
      }
      before = clock.timeOf(n);
    }
  }
}

TEST(ServoStream, ReturnsSegmentsAndCountsLostSamples) {
  ServoStream stream("/nowhere");
  std::vector<ServoSegment> all;
  std::uint32_t next = 4'294'966'000u;  // overflows during the test
  double now = 50.0;
  const auto feed = [&](std::uint32_t count) {
    now += PERIOD * count;
    for (ServoSegment& s : stream.addBlock(blockOf(next, count), now)) {
      all.push_back(std::move(s));
    }
    next += count;
  };
  for (int i = 0; i < 1000; ++i) {
    feed(3);
  }
  next += 7;
  now += 7 * PERIOD;
  for (int i = 0; i < 100; ++i) {
    feed(3);
  }
  const ServoStatistics statistics = stream.statistics();
  EXPECT_EQ(statistics.samples, 3300u);
  EXPECT_EQ(statistics.lost, 7u);
  EXPECT_EQ(statistics.restarts, 0u);
  EXPECT_LE(statistics.late_worst, 3.1 * PERIOD);  // samples wait for the end of their block
  ASSERT_GT(all.size(), 100u);
  std::uint64_t lost = 0;
  for (std::size_t i = 1; i < all.size(); ++i) {
    EXPECT_LE(all[i].samples.size(), ServoStreamOptions().segment_length);
    const std::uint64_t expected = all[i - 1].first + all[i - 1].samples.size();
    lost += all[i].first - expected;
    EXPECT_NEAR(all[i].stamp - all[i - 1].stamp,
                PERIOD * static_cast<double>(all[i].first - all[i - 1].first), 1e-5);
  }
  EXPECT_EQ(lost, 7u);
  ASSERT_TRUE(stream.latest());
  EXPECT_EQ(stream.latest()->revolutions, static_cast<double>(next - 1));
  EXPECT_EQ(stream.count(), 3300u);
}

TEST(ServoStream, RestartOfTheControllerIsNoLoss) {
  ServoStream stream("/nowhere");
  for (std::uint32_t i = 0; i < 100; ++i) {
    stream.addBlock(blockOf(100'000 + 10 * i, 10), 1.0 + 0.01 * i);
  }
  for (std::uint32_t i = 0; i < 100; ++i) {
    stream.addBlock(blockOf(10 * i, 10), 5.0 + 0.01 * i);
  }
  EXPECT_EQ(stream.statistics().lost, 0u);
  EXPECT_EQ(stream.statistics().restarts, 1u);
}

// A computer that stands still for 1.3 s: the controller catches up in a burst of cycles that contain the
// load from before, then the load meter delivers what it measured in between.
TEST(ServoStream, ALateLoadIsNotKnown) {
  ServoStreamOptions options;
  options.load_timeout = 0.1;
  ServoStream stream("/nowhere", options);
  std::uint32_t next = 0;
  double now = 50.0;
  // Whether the load of the last of some samples is known.
  const auto known = [&](std::uint32_t count) {
    ServoBlock block = blockOf(next, count);
    for (ServoSample& sample : block.samples) sample.spindle_load = 0.4;
    next += count;
    stream.addBlock(block, now);
    return std::isfinite(stream.latest()->spindle_load);
  };
  for (int i = 0; i < 100; ++i) {
    now += 0.01;
    stream.setLoad(now - 0.02, 0.4);
    EXPECT_TRUE(known(10));
  }
  EXPECT_EQ(stream.statistics().without_load, 0u);
  now += 1.3;
  EXPECT_FALSE(known(1300));
  stream.setLoad(now - 0.5, 0.4);
  EXPECT_FALSE(known(10));
  stream.setLoad(now - 0.09, 0.4);
  EXPECT_TRUE(known(10));
  EXPECT_EQ(stream.statistics().without_load, 1310u);
}

TEST(ServoStream, TheLoadOfADriveIsAlwaysKnown) {
  ServoStream stream("/nowhere");
  stream.addBlock(blockOf(0, 10), 50.0);
  EXPECT_EQ(stream.latest()->spindle_load, 0.0);
  EXPECT_EQ(stream.statistics().without_load, 0u);
}

TEST(SilenceTimer, PausesOfTheObserverDoNotCount) {
  SilenceTimer timer;
  double now = 10.0;
  EXPECT_EQ(timer.update(true, now), 0.0);
  for (int i = 0; i < 20; ++i) {
    timer.update(false, now += 0.01);
  }
  EXPECT_NEAR(timer.silent(), 0.2, 1e-12);
  EXPECT_NEAR(timer.update(false, now += 30.0), 0.2 + LivenessOptions().longest_step, 1e-12);
  EXPECT_NEAR(timer.update(false, now -= 5.0), 0.2 + LivenessOptions().longest_step, 1e-12);
  EXPECT_EQ(timer.update(true, now + 0.01), 0.0);
}

}  // namespace
}  // namespace smartmill::cnc::linuxcnc
