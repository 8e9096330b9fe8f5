// Temperatures of a session: used where complete and plausible, refused with the reason elsewhere.
#include "smartmill_loadmeter/identification/temperature_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "../session.h"
#include "smartmill_core/error.h"
#include "smartmill_loadmeter/identification/identification.h"
#include "smartmill_loadmeter/identification/identification_pipeline.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;

MachineTemperature at(double stamp, double spindle, double x = 300.0) {
  return {stamp, {"X", "Y", "Z"}, {x, 301.0, NOT_A_NUMBER}, {299.0, 299.0, 299.0}, spindle};
}

void rotate(TemperatureWatch& watch, double from, double to) {
  for (double t = from; t < to; t += 0.5) {
    LoadSample sample;
    sample.stamp = t;
    sample.spindle_speed = 300.0;
    watch.handle(sample);
  }
}

TEST(TemperatureWatch, meanOfTheReadingsDuringATest) {
  TemperatureWatch watch({});
  for (int i = 0; i < 10; ++i) watch.handle(at(100.0 + 5.0 * i, 310.0 + i, 300.0 + 2.0 * i));
  // Readings at 110, 115, 120: 312, 313, 314 K.
  EXPECT_DOUBLE_EQ(watch.spindle(109.0, 121.0).value, 313.0);
  EXPECT_DOUBLE_EQ(watch.axis(0, 109.0, 121.0).value, 306.0);
  EXPECT_DOUBLE_EQ(watch.axis(1, 109.0, 121.0).value, 301.0);
  // Between two readings: the last one before.
  EXPECT_DOUBLE_EQ(watch.spindle(111.0, 113.0).value, 312.0);
  EXPECT_EQ(watch.fault(146.0), "");
}

// A node that runs for weeks needs the readings of the running test only.
TEST(TemperatureWatch, readingsOlderThanFourHoursAreForgotten) {
  TemperatureWatch watch({});
  for (double t = 0.0; t < 18000.0; t += 5.0) watch.handle(at(t, 310.0));
  EXPECT_DOUBLE_EQ(watch.spindle(4000.0, 17000.0).value, 310.0);
  EXPECT_FALSE(watch.spindle(1000.0, 2000.0).known());
}

TEST(TemperatureWatch, missingIsUnknownAndNotAFault) {
  TemperatureWatch watch({});
  EXPECT_FALSE(watch.spindle(100.0, 110.0).known());
  EXPECT_EQ(watch.fault(100.0), "");
  watch.handle(at(105.0, NOT_A_NUMBER));  // a controller without number 403
  EXPECT_FALSE(watch.spindle(100.0, 110.0).known());
  EXPECT_EQ(watch.spindle(100.0, 110.0).fault, "");
  EXPECT_DOUBLE_EQ(watch.axis(0, 100.0, 110.0).value, 300.0);
  EXPECT_FALSE(watch.axis(2, 100.0, 110.0).known());
}

TEST(TemperatureWatch, lateReadingsAreRefused) {
  TemperatureWatch watch({});
  watch.handle(at(100.0, 310.0));
  EXPECT_DOUBLE_EQ(watch.spindle(120.0, 130.0).value, 310.0);
  const TemperatureReading old = watch.spindle(120.0, 131.0);
  EXPECT_FALSE(old.known());
  EXPECT_EQ(old.fault, "spindle motor temperature late: no reading in the last 30 s");
  EXPECT_THAT(watch.fault(200.0), HasSubstr("late"));
  watch.handle(at(180.0, 311.0));  // a gap of 80 s within the test
  EXPECT_THAT(watch.spindle(90.0, 185.0).fault, HasSubstr("late: no reading for 80 s"));
  EXPECT_DOUBLE_EQ(watch.spindle(181.0, 185.0).value, 311.0);
}

TEST(TemperatureWatch, implausibleReadingsAreRefused) {
  for (const double bad : {273.15, 528.15, -1.0, 1e300}) {
    TemperatureWatch watch({});
    watch.handle(at(100.0, bad));
    watch.handle(at(105.0, 310.0));
    const TemperatureReading reading = watch.spindle(99.0, 106.0);
    EXPECT_FALSE(reading.known()) << bad;
    EXPECT_THAT(reading.fault, HasSubstr("spindle motor temperature implausible"));
    EXPECT_THAT(reading.fault, HasSubstr("expected 274 to 453 K"));
  }
}

TEST(TemperatureWatch, aReadingThatNeverChangesIsStuck) {
  TemperatureParameters parameters;
  parameters.stuck_time = 600.0;
  TemperatureWatch watch(parameters);
  const auto run = [&](double from, double to, bool turning) {
    for (double t = from; t < to; t += 5.0) {
      if (turning) rotate(watch, t, t + 5.0);
      watch.handle(at(t + 5.0, 310.0));
    }
  };
  run(0.0, 2000.0, false);  // at rest a motor keeps the temperature of the shop
  EXPECT_TRUE(watch.spindle(1990.0, 2000.0).known());
  run(2000.0, 2595.0, true);
  EXPECT_TRUE(watch.spindle(2585.0, 2595.0).known());
  run(2595.0, 2700.0, true);
  EXPECT_FALSE(watch.spindle(2690.0, 2700.0).known());
  EXPECT_THAT(watch.fault(2700.0), HasSubstr("stuck: 310.0 K"));
  watch.handle(at(2705.0, 311.0));
  watch.handle(at(2740.0, 311.0));
  EXPECT_EQ(watch.fault(2741.0), "");
}

/// A session whose controller reports temperatures every 5 s. @param spindle [K] at a time since the start
IdentifyResult identifyWith(const std::function<std::optional<double>(double)>& spindle,
                            std::vector<CoefficientRecord>* cuts = nullptr) {
  Session session(3, 2e-4);
  IdentificationPipeline pipeline(model(), {}, 0.05);
  IdentifyResult result;
  IdentificationOutputs& outputs = pipeline.identification().outputs();
  outputs.result = [&](const IdentifyResult& r) { result = r; };
  outputs.cut = [&](const CoefficientRecord& r) {
    if (cuts) cuts->push_back(r);
  };
  double next = session.now();
  const double began = session.now();
  session.state = [&](const CncState& s) { pipeline.push(s); };
  session.load = [&](const LoadSample& l) {
    pipeline.push(l);
    if (l.stamp < next) return;
    next = l.stamp + 5.0;
    if (const auto kelvin = spindle(l.stamp - began)) pipeline.push(at(l.stamp, *kelvin));
  };
  session.condition = [&](const CuttingCondition& c) { pipeline.push(c); };
  runStandardTests(session);
  pipeline.push(IdentifyGoal{session.now(), "endmill", "aluminium", false, 0});
  pipeline.flush();
  return result;
}

TEST(SessionTemperature, isRecordedWithTheCoefficients) {
  std::vector<CoefficientRecord> cuts;
  const IdentifyResult r = identifyWith([](double t) { return 300.0 + 0.5 * t; }, &cuts);
  ASSERT_EQ(r.code, IdentifyResult::Code::ok) << r.message;
  // Air cuts in the first 10 s, three cuts of 4 s and their ways in the following 16 s.
  EXPECT_GT(r.record.temperature, 305.0);
  EXPECT_LT(r.record.temperature, 316.0);
  EXPECT_THAT(r.message, HasSubstr("spindle motor at 3"));
  EXPECT_THAT(r.message, HasSubstr("in the air cuts (friction)"));
  ASSERT_EQ(cuts.size(), 3u);
  EXPECT_LT(cuts[0].temperature, cuts[2].temperature);
  EXPECT_NEAR((cuts[0].temperature + cuts[1].temperature + cuts[2].temperature) / 3.0, r.record.temperature,
              1e-9);
  // The coefficients do not depend on it.
  const IdentifyResult without = identifyWith([](double) { return std::nullopt; });
  EXPECT_EQ(r.coefficients.value.ktc, without.coefficients.value.ktc);
  EXPECT_TRUE(std::isnan(without.record.temperature));
  EXPECT_EQ(without.message.find("temperature"), std::string::npos);
}

TEST(SessionTemperature, faultsAreStatedAndNothingIsRecorded) {
  const IdentifyResult broken = identifyWith([](double t) { return t < 12.0 ? 300.0 : 273.15; });
  ASSERT_EQ(broken.code, IdentifyResult::Code::ok) << broken.message;
  EXPECT_TRUE(std::isnan(broken.record.temperature));
  EXPECT_THAT(broken.message, HasSubstr("temperature not recorded: test 'slot_"));
  EXPECT_THAT(broken.message, HasSubstr("implausible: 273.1 K"));
}

}  // namespace
}  // namespace smartmill::loadmeter
