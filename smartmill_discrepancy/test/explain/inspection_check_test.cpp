// Inspected dimensions next to the closed forms of effects.md.
#include "smartmill_discrepancy/explain/inspection_check.h"

#include <cmath>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/mill.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

using testing::HasSubstr;

std::vector<CampaignTest> cuts() {
  std::vector<CampaignTest> tests(2);
  for (std::size_t k = 0; k < tests.size(); ++k) {
    tests[k].name = k == 0 ? "early" : "late";
    tests[k].spindle_speed = 600.0;
    tests[k].start_time = k == 0 ? 0.0 : 400.0;
    Engagement engagement;
    engagement.axial_depth = 1e-3;
    engagement.feed_per_tooth = 1e-4;
    engagement.entry = 0.0;
    engagement.exit = units::PI;
    tests[k].engagement = engagement;
  }
  return tests;
}

InspectionFile inspected(const std::string& features) {
  const TemporaryFolder folder;
  const std::string file = folder.file("parts.yaml");
  std::ofstream(file) << "format: smartmill-inspection/1\nstamp_s: 1763700000.0\ncuts:\n"
                         "- {name: early, tool: end_mill, material: al7050, diameter_mm: 19.05}\n"
                         "- {name: late, tool: end_mill, material: al7050, diameter_mm: 19.05}\n"
                         "- {name: other, tool: end_mill, material: al7050, diameter_mm: 19.05}\n"
                         "features:\n"
                      << features;
  return readInspectionFile(file);
}

TEST(InspectionCheck, ComparesFacesWithThermalGrowth) {
  const MachineModel stated = mill();
  MachineModel improved = stated;
  EffectEntry growth;
  growth.name = "thermal_growth";
  growth.numbers = {{"growth_um", 60.0}, {"time_constant_s", 200.0}};
  improved.effects = {growth};
  const double expected = -60e-6 * (1.0 - std::exp(-2.0));
  // The part has 30 deg C: 1 mm of aluminium is 0.23 um longer than at 20 deg C.
  const InspectionCheck check = checkInspection(
      inspected(
          "- {cut: early, kind: step_position, direction: z, nominal_mm: -1.0, measured_mm: -1.001, std_um: "
          "2.0}\n"
          "- {cut: late, kind: step_position, direction: z, nominal_mm: -1.0, measured_mm: -1.0520, std_um: "
          "2.0,"
          " part_temperature_c: 30.0, part_expansion_um_per_m_k: 23.0}\n"
          "- {cut: late, kind: step_position, direction: x, nominal_mm: 5.0, measured_mm: 5.0, std_um: 2.0}\n"
          "- {cut: other, kind: step_position, direction: z, nominal_mm: -1.0, measured_mm: -1.0, std_um: "
          "2.0}\n"),
      cuts(), stated, improved);
  ASSERT_EQ(check.dimensions.size(), 2U);
  EXPECT_DOUBLE_EQ(check.dimensions[0].after, 0.0);
  EXPECT_TRUE(check.dimensions[0].agreesBefore() && check.dimensions[0].agreesAfter());
  EXPECT_DOUBLE_EQ(check.dimensions[1].before, 0.0);
  EXPECT_NEAR(check.dimensions[1].after, expected, 1e-12);
  EXPECT_NEAR(check.dimensions[1].measured, -1.0520e-3 / (1.0 + 23e-6 * 10.0) + 1e-3, 1e-12);
  EXPECT_FALSE(check.dimensions[1].agreesBefore());
  EXPECT_TRUE(check.dimensions[1].agreesAfter());
  EXPECT_THAT(check.text(),
              HasSubstr("2 inspected dimensions: the stated model agrees with 1, the improved one with 2"));
  EXPECT_THAT(check.notes, testing::ElementsAre(HasSubstr("along x"), HasSubstr("'other' is no cut")));
}

// effects.md, runout: the outermost of four teeth is at the angle of the offset.
TEST(InspectionCheck, ASlotIsAsWideAsTheOutermostTooth) {
  const MachineModel stated = mill();
  MachineModel improved = stated;
  EffectEntry runout;
  runout.name = "runout";
  runout.numbers = {{"offset_um", 8.0}, {"angle_deg", 0.0}};
  improved.effects = {runout};
  const InspectionCheck check =
      checkInspection(inspected("- {cut: late, kind: slot_width, direction: y, nominal_mm: 19.05, "
                                "measured_mm: 19.066, std_um: 2.0}\n"),
                      cuts(), stated, improved);
  ASSERT_EQ(check.dimensions.size(), 1U);
  EXPECT_NEAR(check.dimensions[0].before, 0.0, 1e-15);
  EXPECT_NEAR(check.dimensions[0].after, 16e-6, 1e-12);
}

}  // namespace
}  // namespace smartmill::discrepancy
