#include "smartmill_daq/acquisition/acquisition.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "smartmill_daq_testing/scripted_device.h"

namespace smartmill::daq {
namespace {

using ::testing::HasSubstr;
using testing::ScriptedDevice;

constexpr double RATE = 10000.0;           // [Hz]
constexpr std::size_t BATCH = 100;         // 10 ms
constexpr double ANNOUNCED = 0.2;          // [s] within which a fault is announced
constexpr double START = 1000.0;           // [s]
constexpr std::uint64_t INJECTED = 20000;  // sample at which the faults of the table begin

Instrument instrument() {
  Instrument instrument;
  instrument.name = "test";
  instrument.driver = "scripted";
  instrument.sample_rate = RATE;
  Channel fx, acceleration;
  fx.input = "1";
  fx.name = "fx";
  fx.unit = "N";
  fx.sensitivity = 0.01;
  fx.stuck = 0.1;
  acceleration.input = "2";
  acceleration.name = "x";
  acceleration.unit = "m/s2";
  acceleration.sensitivity = -0.1;
  acceleration.range = 5.0;
  acceleration.coupling = Coupling::iepe;
  acceleration.stuck = 0.1;
  instrument.streams = {{"daq/dynamometer", "dynamometer", {fx}}, {"daq/vibration", "", {acceleration}}};
  return instrument;
}

/// [V] of a sample: never twice the same in succession
double volts(std::uint64_t index, std::size_t channel) {
  return 2.0 * std::sin(0.05 * static_cast<double>(index) + static_cast<double>(channel)) +
         1e-3 * static_cast<double>(index % 7);
}

RawBatch batchOf(std::uint64_t first, bool counted = true, std::size_t samples = BATCH) {
  RawBatch batch;
  if (counted) batch.first_index = first;
  for (std::size_t i = 0; i < samples; ++i) {
    batch.values.push_back(volts(first + i, 0));
    batch.values.push_back(volts(first + i, 1));
  }
  return batch;
}

double complete(std::uint64_t count) {
  return START + static_cast<double>(count) / RATE;
}

/// What came out.
struct Observed {
  std::vector<SampleBlock> force, vibration;
  std::vector<Fault> faults;
  InstrumentState state;

  static std::uint64_t marked(const std::vector<SampleBlock>& blocks) {
    std::uint64_t count = 0;
    for (const SampleBlock& block : blocks)
      for (const double sample : block.samples) count += std::isnan(sample) ? 1 : 0;
    return count;
  }
  static std::uint64_t samples(const std::vector<SampleBlock>& blocks) {
    std::uint64_t count = 0;
    for (const SampleBlock& block : blocks) count += block.size();
    return count;
  }
  const Fault* first(FaultKind kind) const {
    for (const Fault& fault : faults)
      if (fault.kind == kind) return &fault;
    return nullptr;
  }
};

Observed run(ScriptedDevice& device, const Instrument& described = instrument()) {
  Observed observed;
  Acquisition::Outputs outputs;
  outputs.block = [&](const Stream& stream, const SampleBlock& block) {
    (stream.topic == "daq/dynamometer" ? observed.force : observed.vibration).push_back(block);
  };
  outputs.fault = [&](const Fault& fault) { observed.faults.push_back(fault); };
  Acquisition acquisition(described, device.driver(), outputs, [&] { return device.now(); });
  while (acquisition.step()) {
  }
  observed.state = acquisition.state();
  return observed;
}

/// Every sample that is neither lost nor marked is the one that was taken, in its place.
void expectTrueValues(const Observed& observed) {
  std::uint64_t next = 0;
  for (const SampleBlock& block : observed.force) {
    EXPECT_GE(block.first_index, next);
    EXPECT_LE(block.size(), 50u);
    next = block.first_index + block.size();
    for (std::size_t i = 0; i < block.size(); ++i) {
      // A constant is one only after its time.
      if (!std::isnan(block.samples[i]) && block.samples[i] != 12.5) {
        ASSERT_NEAR(block.samples[i], volts(block.first_index + i, 0) / 0.01, 1e-9) << block.first_index + i;
      }
    }
  }
  const SampleAccount& account = observed.state.account;
  EXPECT_EQ(account.delivered, Observed::samples(observed.force));
  EXPECT_EQ(account.delivered, Observed::samples(observed.vibration));
  EXPECT_EQ(account.blocks, observed.force.size() + observed.vibration.size());
}

TEST(Acquisition, blocksHaveTheSamplesTheUnitsAndTheTimes) {
  ScriptedDevice device;
  for (std::uint64_t first = 0; first < 30000; first += BATCH)
    device.add(complete(first + BATCH), batchOf(first));
  const Observed observed = run(device);
  EXPECT_TRUE(observed.faults.empty());
  ASSERT_EQ(observed.force.size(), 600u);
  expectTrueValues(observed);
  EXPECT_NEAR(observed.vibration[3].samples[7], volts(157, 1) / -0.1, 1e-9);
  EXPECT_EQ(observed.force[0].channels, std::vector<std::string>{"fx"});
  EXPECT_EQ(observed.vibration[0].units, std::vector<std::string>{"m/s2"});
  // Sample i is complete at (i + 1) / rate, and taken then.
  for (const SampleBlock& block : observed.force)
    EXPECT_NEAR(block.stamp, complete(block.first_index + 1), 1e-6);
}

/// A fault of the table: how the batch that has sample INJECTED, or what comes in its place, is changed.
struct Injection {
  std::string name;
  FaultKind kind;
  std::function<void(ScriptedDevice&, std::uint64_t first)> inject;  // called for every batch
  std::uint64_t lost = 0, estimated = 0, withheld = 0;
  std::uint64_t marked_force = 0, marked_vibration = 0;
  std::string text;
  double delay = 0.0;  // [s] that the fault needs to be one
};

std::vector<Injection> injections() {
  const auto plain = [](ScriptedDevice& device, std::uint64_t first) {
    device.add(complete(first + BATCH), batchOf(first));
  };
  const auto changed = [](std::uint64_t first, std::uint64_t from, std::uint64_t to, std::size_t channel,
                          double value) {
    RawBatch batch = batchOf(first);
    for (std::size_t i = 0; i < BATCH; ++i) {
      if (first + i >= from && first + i < to) batch.values[2 * i + channel] = value;
    }
    return batch;
  };
  return {
      {"gap that the device counts", FaultKind::gap,
       [=](ScriptedDevice& device, std::uint64_t first) {
         if (first < INJECTED || first >= INJECTED + 300) return plain(device, first);
         if (first == INJECTED)
           device.add(complete(first + BATCH), batchOf(first, true, 37));  // then 263 are missing
       },
       263, 0, 0, 0, 0, "263 samples are missing", 0.03},
      {"gap without a count", FaultKind::interruption,
       [=](ScriptedDevice& device, std::uint64_t first) {
         if (first >= INJECTED && first < INJECTED + 500) return;
         RawBatch batch = batchOf(first, false);
         batch.interrupted = first == INJECTED + 500;
         device.add(complete(first + BATCH), batch);
       },
       0, 500, 0, 0, 0, "about 500 samples are missing", 0.05},
      {"clipping", FaultKind::clipping,
       [=](ScriptedDevice& device, std::uint64_t first) {
         device.add(complete(first + BATCH), changed(first, INJECTED + 10, INJECTED + 23, 0, 10.0));
       },
       0, 0, 0, 13, 0, "fx: clipped at 10 V of 10 V", 0.0},
      {"overload that the device reports", FaultKind::clipping,
       [=](ScriptedDevice& device, std::uint64_t first) {
         RawBatch batch = batchOf(first);
         if (first == INJECTED) batch.overloaded = 2;
         device.add(complete(first + BATCH), batch);
       },
       0, 0, 0, 0, 100, "x: clipped", 0.0},
      {"stuck", FaultKind::stuck,
       [=](ScriptedDevice& device, std::uint64_t first) {
         // Of 3000 equal values the first 999 may be a constant.
         device.add(complete(first + BATCH), changed(first, INJECTED, INJECTED + 3000, 0, 0.125));
       },
       0, 0, 0, 3000 - 999, 0, "fx: stuck at 0.125 V for 0.1 s", 0.1},
      {"IEPE cable open", FaultKind::bias,
       [=](ScriptedDevice& device, std::uint64_t first) {
         device.add(complete(first + BATCH), changed(first, INJECTED, INJECTED + 3000, 1, 5.0));
       },
       0, 0, 0, 0, 3000, "x: at the end of its range: IEPE cable open", 0.1},
      {"IEPE cable shorted", FaultKind::bias,
       [=](ScriptedDevice& device, std::uint64_t first) {
         device.add(complete(first + BATCH), changed(first, INJECTED, INJECTED + 3000, 1, 0.0));
       },
       0, 0, 0, 0, 3000 - 999, "x: one value only: IEPE cable shorted", 0.1},
      {"IEPE fault that the device reports", FaultKind::bias,
       [=](ScriptedDevice& device, std::uint64_t first) {
         RawBatch batch = batchOf(first);
         if (first == INJECTED) batch.bias_fault = 2;
         device.add(complete(first + BATCH), batch);
       },
       0, 0, 0, 0, 100, "x: the device reports a fault of the IEPE supply", 0.0},
      {"no number", FaultKind::not_finite,
       [=](ScriptedDevice& device, std::uint64_t first) {
         device.add(complete(first + BATCH),
                    changed(first, INJECTED, INJECTED + 5, 0, std::numeric_limits<double>::infinity()));
       },
       0, 0, 0, 5, 0, "fx: value is no number", 0.0},
      {"silence", FaultKind::silent,
       [=](ScriptedDevice& device, std::uint64_t first) {
         const bool held = first >= INJECTED && first < INJECTED + 10000;
         device.add(complete(held ? INJECTED + 10000 : first + BATCH), batchOf(first));
       },
       0, 0, 0, 0, 0, "no samples for", 0.0},
      {"unplugged and back, the counter running on", FaultKind::unplugged,
       [=](ScriptedDevice& device, std::uint64_t first) {
         if (first == INJECTED) device.lose(complete(first), "unplugged");
         if (first < INJECTED || first >= INJECTED + 20000) plain(device, first);
       },
       20000, 0, 0, 0, 0, "unplugged", 0.0},
      {"unplugged and back, without a count", FaultKind::unplugged,
       [=](ScriptedDevice& device, std::uint64_t first) {
         if (first == INJECTED) device.lose(complete(first), "unplugged");
         if (first < INJECTED || first >= INJECTED + 20000)
           device.add(complete(first + BATCH), batchOf(first, false));
       },
       0, 20000, 0, 0, 0, "unplugged", 0.0},
      {"another rate that the device states", FaultKind::rate,
       [=](ScriptedDevice& device, std::uint64_t first) {
         RawBatch batch = batchOf(first);
         batch.sample_rate = first >= INJECTED && first < INJECTED + 10000 ? 12800.0 : RATE;
         device.add(complete(first + BATCH), batch);
       },
       0, 0, 10000, 0, 0, "12800 samples per second, expected 10000", 0.0},
      {"no frames", FaultKind::malformed,
       [=](ScriptedDevice& device, std::uint64_t first) {
         if (first == INJECTED) device.malformed(complete(first), "frame: begins with other bytes than SMD1");
         if (first < INJECTED || first >= INJECTED + 20000) plain(device, first);
       },
       20000, 0, 0, 0, 0, "other bytes", 0.0},
  };
}

TEST(Acquisition, faultsAreAnnouncedCountedAndMarkedToTheSample) {
  constexpr std::uint64_t ALL = 60000;
  for (const Injection& injection : injections()) {
    SCOPED_TRACE(injection.name);
    ScriptedDevice device;
    for (std::uint64_t first = 0; first < ALL; first += BATCH) injection.inject(device, first);
    const Observed observed = run(device);
    const Fault* fault = observed.first(injection.kind);
    ASSERT_NE(fault, nullptr);
    EXPECT_THAT(fault->text, HasSubstr(injection.text));
    // Its batch is there a batch later.
    const double after = fault->time - complete(INJECTED);
    EXPECT_LE(after, ANNOUNCED + 0.01) << fault->text;
    EXPECT_GE(after, injection.delay);
    EXPECT_EQ(observed.state.faults.count(injection.kind).events, 1u);
    const SampleAccount& account = observed.state.account;
    EXPECT_EQ(account.lost, injection.lost);
    EXPECT_EQ(account.estimated_lost, injection.estimated);
    EXPECT_EQ(account.withheld, injection.withheld);
    EXPECT_EQ(account.delivered + account.lost + account.estimated_lost + account.withheld, ALL);
    EXPECT_EQ(Observed::marked(observed.force), injection.marked_force);
    EXPECT_EQ(Observed::marked(observed.vibration), injection.marked_vibration);
    expectTrueValues(observed);
    std::printf("%-45s announced after %.3f s, %llu lost, %llu by the clock, %llu withheld, %llu marked\n",
                injection.name.c_str(), after, static_cast<unsigned long long>(account.lost),
                static_cast<unsigned long long>(account.estimated_lost),
                static_cast<unsigned long long>(account.withheld),
                static_cast<unsigned long long>(Observed::marked(observed.force) +
                                                Observed::marked(observed.vibration)));
  }
}

TEST(Acquisition, aRateThatOnlyTheClockShowsIsFound) {
  for (const double rate : {0.98 * RATE, 1.005 * RATE, 2.0 * RATE, 0.5 * RATE}) {
    ScriptedDevice device;
    for (std::uint64_t first = 0; first < 60000; first += BATCH)
      device.add(START + static_cast<double>(first + BATCH) / rate, batchOf(first));
    const Observed observed = run(device);
    const Fault* fault = observed.first(FaultKind::rate);
    ASSERT_NE(fault, nullptr) << rate;
    EXPECT_LT(fault->time - START, 3.0) << rate;
    const SampleAccount& account = observed.state.account;
    EXPECT_EQ(account.delivered + account.withheld, 60000u);
    EXPECT_EQ(observed.state.rate_wrong, true);
  }
}

// A front end that is synchronous with the computer says when its samples were taken.
TEST(Acquisition, theDevicesOwnTimesAreKeptToTheLastDigit) {
  Instrument described = instrument();
  described.clock = ClockSource::device;
  ScriptedDevice device;
  std::vector<double> times;
  for (std::uint64_t first = 0; first < 1000; first += 50) {
    RawBatch batch = batchOf(first, true, 50);
    times.push_back(1.8e9 + 1.00001234567e-4 * static_cast<double>(first));
    batch.time = times.back();
    device.add(complete(first + 50), batch);
  }
  const Observed observed = run(device, described);
  ASSERT_EQ(observed.force.size(), times.size());
  for (std::size_t i = 0; i < times.size(); ++i) EXPECT_EQ(observed.force[i].stamp, times[i]);
}

// Its clock is the reference: batches that arrive late, in steps or all at once are no faults.
TEST(Acquisition, arrivalsDoNotMatterWithTheDevicesOwnTimes) {
  Instrument described = instrument();
  described.clock = ClockSource::device;
  described.silence = 10.0;
  ScriptedDevice device;
  for (std::uint64_t first = 0; first < 60000; first += BATCH) {
    RawBatch batch = batchOf(first);
    batch.time = 1.8e9 + static_cast<double>(first) / RATE;
    const double late = first < 20000 ? 0.5 : first < 40000 ? 1.5 : 0.1;
    device.add(complete(first + BATCH) + late, batch);
  }
  const Observed observed = run(device, described);
  EXPECT_TRUE(observed.faults.empty()) << observed.faults.front().text;
  EXPECT_EQ(observed.state.account.delivered, 60000u);
  EXPECT_NEAR(observed.state.clock.drift, 0.0, 1e-9);
}

}  // namespace
}  // namespace smartmill::daq
