// Coefficients from the spindle load in a record of Servo Guide (Dunwoody, section 6.1).
#include "smartmill_loadmeter/identification/servo_load.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using units::radPerSecFromRpm;

const CuttingCoefficients TRUTH{953e6, 357e6, 188e6, 17.3e3, 17.7e3, 0.72e3};
constexpr double FULL_SCALE = 8.0, RATE = 200.0;
constexpr int AIR_BLOCK = 90, FEED_BLOCK = 100;

MachineModel machine() {
  MachineModel model;
  model.file = "model.yaml";
  model.tool = ToolGeometry{3, 0.012, units::radFromDeg(35.0), {}};
  Spindle s;
  s.viscous = 9e-4;  // wrong on purpose: the air cuts correct it
  s.coulomb = 0.5;
  s.load_meter_gain = 3.88e-4;
  s.load_meter_bandwidth = 7.0;
  s.load_meter_resolution = 3e-4;
  s.load_meter_full_scale = FULL_SCALE;
  model.spindle = s;
  return model;
}

ServoTest testOf(const std::string& name, double rpm, double feed) {
  ServoTest one;
  one.block = feed > 0.0 ? FEED_BLOCK : AIR_BLOCK;
  one.test.name = name;
  one.test.kind = feed > 0.0 ? TestKind::cut : TestKind::air;
  one.test.spindle_speed = radPerSecFromRpm(rpm);
  if (feed > 0.0) {
    one.test.engagement = Engagement{0.0, units::PI, 0.002, feed};
    one.test.engage_time = 0.0;
  }
  return one;
}

std::vector<ServoTest> standardTests() {
  std::vector<ServoTest> tests;
  for (const double rpm : {2000.0, 6000.0, 12000.0})
    tests.push_back(testOf("air_" + std::to_string(static_cast<int>(rpm)), rpm, 0.0));
  for (const double feed : {3e-5, 6e-5, 1e-4})
    tests.push_back(testOf("slot_" + std::to_string(static_cast<int>(1e6 * feed)), 6000.0, feed));
  return tests;
}

/// A record with each test as one execution of its block, and another block in between. Mean torque,
/// first-order lag in closed form, noise, rounding.
class Recorder {
 public:
  explicit Recorder(unsigned seed) : random_(seed) {}

  void run(const ServoTest& test, double seconds, double idle_before = 1.0) {
    const double w = test.test.spindle_speed;
    double torque = 4.743e-4 * w + 0.0671;
    volt_ = GAIN * torque * w;  // the load meter has settled in air
    hold(1, idle_before, volt_);
    if (test.test.engagement)
      torque += MechanisticForce(*machine().tool, TRUTH, *test.test.engagement).mean().torque;
    hold(test.block, seconds, GAIN * torque * w);
  }

  /// One sample of a block is lost after `index` samples.
  ServoLoad load(std::size_t lost = 0) const {
    ServoLoad load;
    const std::size_t n = samples_.size() / 3;
    for (std::size_t first = 0; first < n; first += 10) {
      SampleBlock block;
      block.sample_rate = RATE;
      block.first_index = first + (lost > 0 && first >= lost ? 1 : 0);
      block.stamp = 50.0 + static_cast<double>(first) / RATE;
      block.channels = {"spindle_load", "sequence", "trigger"};
      block.units = {"1", "1", "1"};
      const std::size_t last = std::min(n, first + 10);
      block.samples.assign(samples_.begin() + static_cast<std::ptrdiff_t>(3 * first),
                           samples_.begin() + static_cast<std::ptrdiff_t>(3 * last));
      load.add(block);
    }
    return load;
  }
  std::vector<double>& samples() { return samples_; }

 private:
  static constexpr double GAIN = 3.88e-4;

  void hold(int block, double seconds, double steady) {
    const double kept = std::exp(-units::TWO_PI * 7.0 / RATE);
    for (int i = 0; i < std::lround(seconds * RATE); ++i) {
      const double read = 3e-4 * std::round((volt_ + 2e-4 * normal_(random_)) / 3e-4);
      for (const double value : {read / FULL_SCALE, static_cast<double>(block), 1.0})
        samples_.push_back(value);
      volt_ = steady + kept * (volt_ - steady);
    }
  }

  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  double volt_ = 0.0;
  std::vector<double> samples_;
};

Recorder standardRecord(unsigned seed) {
  Recorder recorder(seed);
  for (const ServoTest& test : standardTests()) recorder.run(test, 2.0);
  return recorder;
}

TEST(ServoLoad, coefficientsWithCalibratedDeviations) {
  Coverage ktc, kte;
  for (int run = 0; run < Coverage::RUNS; ++run) {
    const auto records =
        standardRecord(static_cast<unsigned>(run + 1)).load().records(standardTests(), FULL_SCALE, "record");
    const LoadRecordResult found = identifyFromLoadRecords(records, machine(), {}, "record");
    EXPECT_NEAR(found.set.value.ktc, TRUTH.ktc, 0.02 * TRUTH.ktc);  // the document's class is 11 %
    EXPECT_NEAR(found.set.friction_viscous, 4.743e-4, 0.02 * 4.743e-4);
    ktc.add(found.set.value.ktc - TRUTH.ktc, found.set.std_dev.ktc);
    kte.add(found.set.value.kte - TRUTH.kte, found.set.std_dev.kte);
  }
  EXPECT_TRUE(ktc.isCalibrated()) << ktc.rms();
  EXPECT_TRUE(kte.isCalibrated()) << kte.rms();
}

TEST(ServoLoad, aPartOfABlockIsSelected) {
  std::vector<ServoTest> tests = standardTests();
  for (ServoTest& test : tests) test.begin = 0.5, test.end = 1.75, test.test.engage_time.reset();
  const auto records = standardRecord(1).load().records(tests, FULL_SCALE, "record");
  ASSERT_EQ(records.size(), 6u);
  for (const TestRecord& one : records) {
    EXPECT_EQ(one.record.size(), 250u);  // 1.25 s at 200 Hz
    EXPECT_EQ(one.record.time.front(), 0.0);
    EXPECT_EQ(one.test.sample_rate, RATE);
  }
  EXPECT_NEAR(*records[1].test.start_time, 4.0, 1e-9);
  const LoadRecordResult found = identifyFromLoadRecords(records, machine(), {}, "record");
  EXPECT_NEAR(found.set.value.ktc, TRUTH.ktc, 0.02 * TRUTH.ktc);
}

TEST(ServoLoad, whatDoesNotFitIsRefusedByName) {
  const auto refused = [](const ServoLoad& load, const std::vector<ServoTest>& tests,
                          const std::string& why) {
    EXPECT_THAT([&] { load.records(tests, FULL_SCALE, "s.bag"); }, ThrowsMessage<Error>(HasSubstr(why)));
  };
  std::vector<ServoTest> tests = standardTests();
  const ServoLoad load = standardRecord(1).load();
  tests.pop_back();
  refused(load, tests,
          "s.bag: test 'slot_30': block N100 is executed 3 times in the record, expected 2, as listed");
  tests = standardTests();
  tests[0].block = 7;
  refused(load, tests, "test 'air_2000': block N7 is executed 0 times");
  tests = standardTests();
  tests[4].begin = 1.5;
  refused(load, tests, "test 'slot_60': 0.500 s in the record, expected 1 s or more");
  refused(standardRecord(1).load(2900), standardTests(), "test 'slot_60': samples of the record are lost");
  Recorder broken = standardRecord(1);
  broken.samples()[3 * 2900] = std::nan("");
  refused(broken.load(), standardTests(),
          "test 'slot_60': its spindle load has a sample that is not a finite number");
  ServoLoad other;
  SampleBlock block;
  block.sample_rate = RATE;
  block.channels = {"spindle_load"};
  EXPECT_THAT([&] { other.add(block); }, ThrowsMessage<Error>(HasSubstr("sequence")));
}

TEST(ServoLoad, conditionsAreReadStrictly) {
  const TemporaryFolder folder;
  const std::string file = folder.file("cuts.yaml");
  const auto write = [&](const std::string& text) { folder.write("cuts.yaml", text); };
  const std::string head = "format: smartmill-servo-cuts/1\ntests:\n";
  const std::string cut =
      "- {name: slot_60, kind: cut, block: 100, spindle_speed_rpm: 6000, feed_per_tooth_mm: 0.06, "
      "axial_depth_mm: 2, entry_deg: 0, exit_deg: 180";
  write(head + "- {name: air, kind: air, block: 90, spindle_speed_rpm: 3000, begin_s: 0.5}\n" + cut + "}\n" +
        "- {name: slot_settled, kind: cut, block: 101, spindle_speed_rpm: 6000, feed_per_tooth_mm: 0.06, "
        "axial_depth_mm: 2, entry_deg: 0, exit_deg: 90, begin_s: 0.4, end_s: 2.0}\n");
  const std::vector<ServoTest> tests = readServoTests(file);
  ASSERT_EQ(tests.size(), 3u);
  EXPECT_EQ(tests[0].test.kind, TestKind::air);
  EXPECT_EQ(tests[0].begin, 0.5);
  EXPECT_EQ(tests[1].block, 100);
  EXPECT_DOUBLE_EQ(tests[1].test.engagement->feed_per_tooth, 6e-5);
  EXPECT_EQ(tests[1].test.engage_time, 0.0);
  EXPECT_FALSE(tests[2].test.engage_time);
  EXPECT_EQ(tests[2].end, 2.0);
  const auto refused = [&](const std::string& text, const std::string& why) {
    write(text);
    EXPECT_THAT([&] { readServoTests(file); }, ThrowsMessage<Error>(HasSubstr(why)));
  };
  refused(head + cut + ", depth: 3}\n", "depth");
  refused(head + cut + "}\n" + cut + "}\n", "'slot_60' is the name of two tests");
  refused(head + cut + ", begin_s: 2.0, end_s: 1.0}\n", "end_s");
  refused(head + "- {name: a, kind: tap, block: 1, spindle_speed_rpm: 1}\n", "kind");
  refused("format: smartmill-campaign/1\ntests: []\n", "format");
}

}  // namespace
}  // namespace smartmill::loadmeter
