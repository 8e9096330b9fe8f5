// Radius of a tool and thermal growth of a machine from dimensions drawn around known ones.
#include "smartmill_loadmeter/inspection/inspection_evidence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "smartmill_core/signal/inspection_feature.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using units::UM;

constexpr double DIAMETER = 12e-3;  // [m] stated

InspectionRecord slotOf(double measured, double std_dev, const std::string& name = "slot") {
  InspectionRecord r;
  r.tool = "endmill 12";
  r.condition = name;
  r.kind = SLOT_WIDTH;
  r.direction = "y";
  r.stamp = 100.0;
  r.diameter = r.nominal = DIAMETER;
  r.measured = measured;
  r.std_dev = std_dev;
  return r;
}

InspectionRecord stepOf(double deviation, double std_dev, double temperature,
                        const std::string& name = "step") {
  InspectionRecord r = slotOf(-5e-3 + deviation, std_dev, name);
  r.kind = STEP_POSITION;
  r.direction = "z";
  r.nominal = -5e-3;
  r.machine_temperature = temperature;
  return r;
}

/// Slots of a worn tool, measured by a CMM and by a caliper.
struct WornTool {
  static constexpr double RADIUS = 5.992e-3;  // [m] 8 um below the stated one
  static std::vector<InspectionRecord> inspected(std::mt19937& random) {
    std::normal_distribution<double> normal;
    std::vector<InspectionRecord> slots;
    for (int i = 0; i < 8; ++i) {
      const double std_dev = i < 5 ? 1.5 * UM : 10.0 * UM;
      slots.push_back(slotOf(2.0 * RADIUS + std_dev * normal(random), std_dev, "slot_" + std::to_string(i)));
    }
    return slots;
  }
};

/// Steps along z while the spindle warms up; the controller reports whole degrees.
struct WarmMachine {
  static constexpr double GROWTH = 3.0 * UM;  // [m/K]
  static std::vector<InspectionRecord> inspected(std::mt19937& random) {
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> warm(295.0, 315.0);
    std::vector<InspectionRecord> steps;
    for (int i = 0; i < 10; ++i) {
      const double std_dev = i % 2 ? 2.0 * UM : 4.0 * UM, temperature = warm(random);
      steps.push_back(stepOf(20.0 * UM + GROWTH * (temperature - 293.15) + std_dev * normal(random), std_dev,
                             std::round(temperature), "step_" + std::to_string(i)));
    }
    return steps;
  }
};

RadiusEvidence radiusOf(const std::vector<InspectionRecord>& records) {
  const InspectionEvidence found = inspectionEvidence(records);
  EXPECT_EQ(found.radii.size(), 1u);
  return found.radii.at(0);
}

GrowthEvidence growthOf(const std::vector<InspectionRecord>& records) {
  const InspectionEvidence found = inspectionEvidence(records);
  EXPECT_EQ(found.growths.size(), 1u);
  return found.growths.at(0);
}

TEST(RadiusEvidence, weightedMeanOfTwoSlotsInClosedForm) {
  // Radii off by -8 and -2 um with 1 and 2 um: weights 1 and 1/4.
  const RadiusEvidence r =
      radiusOf({slotOf(DIAMETER - 16.0 * UM, 2.0 * UM), slotOf(DIAMETER - 4.0 * UM, 4.0 * UM)});
  EXPECT_NEAR(r.deviation.value, (-8.0 - 0.25 * 2.0) / 1.25 * UM, 1e-12);
  // chi square 7.2 of one degree of freedom is beyond 6.63 (99 %).
  EXPECT_NEAR(r.deviation.std_dev, std::sqrt(7.2 / 1.25) * UM, 1e-12);
  EXPECT_THAT(r.notes, ElementsAre("they scatter 2.7 times as much as stated: standard deviation widened"));
  EXPECT_EQ(
      radiusOf({slotOf(DIAMETER - 16.0 * UM, 2.0 * UM)}).text(),
      "endmill 12: effective radius: 5.9920 +- 0.0010 mm, -8.0 um from the stated one, from 1 slot width, "
      "corrected for deflection: none");
}

/// Errors of Coverage::RUNS estimates.
class DrawnErrors {
 public:
  void add(double error, double std_dev) {
    coverage_.add(error, std_dev);
    within_ += std::abs(error) < 1.96 * std_dev;
    beyond_ += std::abs(error) > 3.0 * std_dev;
  }
  void expectCalibrated(const char* what) const {
    EXPECT_TRUE(coverage_.isCalibrated());
    // 95 % of 200, three standard deviations of the binomial distribution on both sides.
    EXPECT_GE(within_, 181);
    EXPECT_LE(within_, 199);
    EXPECT_LE(beyond_, 3);  // 0.5 expected; more than 3 with a probability of 0.2 %
    std::printf("%s: error over standard deviation RMS %.3f, %d of 200 within 1.96, %d beyond 3\n", what,
                coverage_.rms(), within_, beyond_);
  }

 private:
  Coverage coverage_;
  int within_ = 0, beyond_ = 0;
};

TEST(RadiusEvidence, isCalibrated) {
  std::mt19937 random(11);
  DrawnErrors errors;
  for (int run = 0; run < Coverage::RUNS; ++run) {
    const RadiusEvidence r = radiusOf(WornTool::inspected(random));
    ASSERT_EQ(r.problem, "");
    const double error = 0.5 * DIAMETER + r.deviation.value - WornTool::RADIUS;
    // 5 widths of 1.5 um and 3 of 10 um.
    EXPECT_GE(r.deviation.std_dev, 0.5 / std::sqrt(5.0 / 2.25 + 3.0 / 100.0) * UM - 1e-12);
    errors.add(error, r.deviation.std_dev);
  }
  errors.expectCalibrated("radius");
}

TEST(RadiusEvidence, anOutlierIsRefusedAndAnnounced) {
  std::mt19937 random(12);
  std::vector<InspectionRecord> slots = WornTool::inspected(random);
  const RadiusEvidence without = radiusOf(slots);
  slots.push_back(slotOf(2.0 * WornTool::RADIUS + 60.0 * UM, 1.5 * UM, "burr"));
  const RadiusEvidence r = radiusOf(slots);
  EXPECT_NEAR(r.deviation.value, without.deviation.value, 1e-15);
  EXPECT_NEAR(r.deviation.std_dev, without.deviation.std_dev, 1e-15);
  EXPECT_EQ(r.used, 8u);
  ASSERT_EQ(r.notes.size(), 1u);
  EXPECT_THAT(r.notes[0],
              ::testing::AnyOf(HasSubstr("'burr' refused: 29."), HasSubstr("'burr' refused: 30.")));
  EXPECT_THAT(r.notes[0], HasSubstr("um from the others"));
}

TEST(RadiusEvidence, widthsThatDisagreeGiveNoEstimate) {
  const RadiusEvidence two = radiusOf({slotOf(DIAMETER, 1.0 * UM), slotOf(DIAMETER - 30.0 * UM, 1.0 * UM)});
  EXPECT_THAT(two.problem,
              HasSubstr("2 of 2 slot widths deviate from the others by more than 4.0 standard deviations"));
  EXPECT_TRUE(two.used == 0 && two.deviation.std_dev == 0.0);
  std::vector<InspectionRecord> worn;  // the tool wore from slot to slot
  for (int i = 0; i < 8; ++i) worn.push_back(slotOf(DIAMETER - 10.0 * UM * i, 1.0 * UM));
  EXPECT_THAT(radiusOf(worn).text(),
              HasSubstr("expected at most a quarter: state larger standard deviations"));
}

// The uncertainty of the deflections does not fall with their number.
TEST(RadiusEvidence, isCorrectedForDeflection) {
  std::vector<InspectionRecord> slots(4, slotOf(DIAMETER - 10.0 * UM, 2.0 * UM));
  for (InspectionRecord& slot : slots) {
    slot.deflection = -4.0 * UM;
    slot.deflection_std = 1.0 * UM;
  }
  const RadiusEvidence r = radiusOf(slots);
  EXPECT_EQ(r.corrected, 4u);
  EXPECT_NEAR(r.deviation.value, -3.0 * UM, 1e-12);
  EXPECT_NEAR(r.deviation.std_dev, std::hypot(1.0 / 2.0, 0.5) * UM, 1e-12);
  slots[0].deflection = NAN;
  EXPECT_THAT(radiusOf(slots).text(), HasSubstr("corrected for deflection: 3"));
}

// A wide slot of several passes: its deviation is that of both walls.
TEST(RadiusEvidence, ofAWidePocket) {
  InspectionRecord pocket = slotOf(30e-3 - 16.0 * UM, 1.0 * UM);
  pocket.nominal = 30e-3;
  EXPECT_NEAR(radiusOf({pocket}).deviation.value, -8.0 * UM, 1e-12);
}

TEST(GrowthEvidence, isTheSlopeInClosedForm) {
  // Three temperatures at even distances: the slope is (last - first) / range.
  const GrowthEvidence g = growthOf({stepOf(1.0 * UM, 1.0 * UM, 300.0), stepOf(16.0 * UM, 1.0 * UM, 305.0),
                                     stepOf(31.0 * UM, 1.0 * UM, 310.0)});
  EXPECT_NEAR(g.coefficient.value, 3.0 * UM, 1e-13);
  // 1 um, with 0.29 K at 3 um/K; the variance of the temperatures is 50 K2.
  EXPECT_NEAR(g.coefficient.std_dev, std::hypot(1.0, 0.87) / std::sqrt(50.0) * UM, 1e-10);
  EXPECT_EQ(g.text(),
            "endmill 12: thermal growth along z: 3.00 +- 0.19 um/K from 3 positions at 300.0 to 310.0 K");
}

TEST(GrowthEvidence, isCalibrated) {
  std::mt19937 random(13);
  DrawnErrors errors;
  for (int run = 0; run < Coverage::RUNS; ++run) {
    const GrowthEvidence g = growthOf(WarmMachine::inspected(random));
    ASSERT_EQ(g.problem, "");
    errors.add(g.coefficient.value - WarmMachine::GROWTH, g.coefficient.std_dev);
  }
  errors.expectCalibrated("growth");
}

TEST(GrowthEvidence, anOutlierIsRefusedAndAnnounced) {
  std::mt19937 random(14);
  std::vector<InspectionRecord> steps = WarmMachine::inspected(random);
  steps.push_back(stepOf(-300.0 * UM, 2.0 * UM, 310.0, "chip on the datum"));
  const GrowthEvidence g = growthOf(steps);
  EXPECT_NEAR(g.coefficient.value, WarmMachine::GROWTH, 4.0 * g.coefficient.std_dev);
  EXPECT_EQ(g.used, 10u);
  ASSERT_FALSE(g.notes.empty());
  EXPECT_THAT(g.notes[0], HasSubstr("'chip on the datum' refused: -3"));
}

TEST(GrowthEvidence, needsTemperaturesThatDiffer) {
  EXPECT_EQ(growthOf({stepOf(0.0, UM, 300.0), stepOf(0.0, UM, 301.0), stepOf(0.0, UM, 302.0)}).problem,
            "temperatures from 300.0 to 302.0 K differ by 2.0 K, expected 5.0 K or more");
  const GrowthEvidence g = growthOf({stepOf(0.0, UM, 300.0), stepOf(0.0, UM, 310.0), stepOf(0.0, UM, NAN)});
  EXPECT_EQ(g.problem, "2 positions with temperature, expected 3 or more");
  EXPECT_THAT(g.notes, ElementsAre("1 position without temperature not used"));
  // The only warm positions contradict each other: there is no estimate.
  std::vector<InspectionRecord> steps;
  for (int i = 0; i < 8; ++i) steps.push_back(stepOf((i % 2) * UM, UM, 300.0 + 0.2 * i));
  InspectionRecord loose = stepOf(500.0 * UM, UM, 320.0);
  steps.push_back(loose);
  loose.measured -= 900.0 * UM;
  steps.push_back(loose);
  EXPECT_FALSE(growthOf(steps).problem.empty());
}

TEST(InspectionEvidence, machinesToolsAndAxesAreSeparate) {
  InspectionRecord other_tool = slotOf(DIAMETER, UM), other_machine = other_tool,
                   along_x = stepOf(0.0, UM, 300.0);
  other_tool.tool = "endmill 10";
  other_machine.machine = "mill 07";
  along_x.direction = "x";
  const InspectionEvidence found =
      inspectionEvidence({slotOf(DIAMETER, UM), other_tool, other_machine, stepOf(0.0, UM, 300.0), along_x});
  EXPECT_EQ(found.radii.size(), 3u);
  EXPECT_EQ(found.growths.size(), 2u);
  EXPECT_EQ(found.lines().size(), 5u);
  EXPECT_THAT(inspectionEvidence({}).lines(), IsEmpty());
}

}  // namespace
}  // namespace smartmill::loadmeter
