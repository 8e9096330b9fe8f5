// Which measured dimensions are accepted, of which cut they are, and how they come from a file into the
// database.
#include "smartmill_loadmeter/inspection/inspection_record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "smartmill_core/command.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/refusals.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/commands.h"
#include "smartmill_loadmeter/inspection/inspection_file.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;
using units::UM;

CuttingCondition cutOf(const std::string& name, double stamp) {
  CuttingCondition c;
  c.stamp = stamp;
  c.kind = CuttingCondition::Kind::cut;
  c.name = name;
  c.material = "6061";
  c.tool_name = "endmill 12";
  c.tool = {3, 12e-3, units::radFromDeg(35.0), {}};
  c.engagement = {0.0, units::PI, 2e-3, 6e-5};
  c.spindle_speed = units::radPerSecFromRpm(6000.0);
  return c;
}

CuttingCondition none(double stamp) {
  CuttingCondition c;
  c.stamp = stamp;
  return c;
}

InspectionFeature slotOf(const std::string& name) {
  InspectionFeature f;
  f.stamp = 5000.0;
  f.condition = name;
  f.kind = SLOT_WIDTH;
  f.direction = "y";
  f.nominal = 12e-3;
  f.measured = 11.984e-3;
  f.std_dev = 1.5e-6;
  return f;
}

InspectionFeature stepOf(const std::string& name) {
  InspectionFeature f = slotOf(name);
  f.kind = STEP_POSITION;
  f.direction = "z";
  f.nominal = -5e-3;
  f.measured = -5.012e-3;
  return f;
}

/// Cuts slot_1 at 1000 s, slot_2 twice, at 1100 and 1200 s, and an air cut; the spindle motor warms up by 0.1
/// K/s from 300 K at 1000 s.
class Inspection : public ::testing::Test {
 protected:
  Inspection() {
    for (double t = 990.0; t < 1400.0; t += 5.0)
      watch_.handle(MachineTemperature{t, {"X"}, {298.0}, {NAN}, 300.0 + 0.1 * (t - 1000.0)});
    const auto make = [&](const CuttingCondition& c) { cuts_.handle(c, watch_, production_); };
    make(cutOf("slot_1", 1000.0));
    make(none(1020.0));
    make(cutOf("slot_2", 1100.0));
    make(cutOf("slot_2", 1200.0));
    CuttingCondition air = cutOf("air", 1300.0);
    air.kind = CuttingCondition::Kind::air;
    make(air);
  }
  std::string refusal(const InspectionFeature& feature) const { return inspect(feature, cuts_, {}).refusal; }

  TemperatureWatch watch_{{}};
  ProductionRun production_{1800.0};
  CutHistory cuts_;
};

TEST_F(Inspection, takesToolAndTemperatureFromTheCut) {
  const InspectionResult slot = inspect(slotOf("slot_1"), cuts_, {});
  EXPECT_EQ(slot.refusal, "");
  EXPECT_EQ(slot.record.tool, "endmill 12");
  EXPECT_EQ(slot.record.material, "6061");
  EXPECT_EQ(slot.record.diameter, 12e-3);
  EXPECT_EQ(slot.record.cut_time, 1000.0);
  EXPECT_NEAR(slot.record.deviation(), -16e-6, 1e-12);
  EXPECT_EQ(slot.condition.engagement.axial_depth, 2e-3);
  // Readings at 1000, 1005 .. 1020 s.
  InspectionFeature step = stepOf("slot_1");
  EXPECT_NEAR(inspect(step, cuts_, {}).record.machine_temperature, 301.0, 1e-9);
  step.direction = "x";
  EXPECT_NEAR(inspect(step, cuts_, {}).record.machine_temperature, 298.0, 1e-9);
  step.machine_temperature = 310.0;
  EXPECT_EQ(inspect(step, cuts_, {}).record.machine_temperature, 310.0);
  step = stepOf("slot_1");
  step.direction = "y";
  const InspectionResult without = inspect(step, cuts_, {});
  EXPECT_EQ(without.refusal, "");
  EXPECT_EQ(without.note, "not used for thermal growth: no temperature reported");
}

TEST_F(Inspection, findsTheCutByNameAndTime) {
  EXPECT_EQ(refusal(slotOf("slot_3")),
            "'slot_3': no cut of this name since the start; newest cuts: slot_2, slot_2, slot_1");
  EXPECT_EQ(refusal(slotOf("air")),
            "'air': no cut of this name since the start; newest cuts: slot_2, slot_2, slot_1");
  EXPECT_EQ(refusal(slotOf("")), "'': condition: empty, expected the name of a cut");
  InspectionFeature twice = slotOf("slot_2");
  EXPECT_EQ(refusal(twice), "'slot_2': 2 cuts have this name, expected cut_stamp, the time of the cut");
  twice.cut_time = 1150.0;
  EXPECT_EQ(inspect(twice, cuts_, {}).record.cut_time, 1100.0);
  twice.cut_time = 1250.0;
  EXPECT_EQ(inspect(twice, cuts_, {}).record.cut_time, 1200.0);
  twice.cut_time = 1350.0;
  EXPECT_EQ(refusal(twice),
            "'slot_2': cut_stamp 1350.000 s is in no cut of this name, the last one is from 1200.000 to "
            "1300.000 s");
  // A latched condition that is received again is no other cut.
  cuts_.handle(cutOf("slot_9", 1390.0), watch_, production_);
  cuts_.handle(cutOf("slot_9", 1390.0), watch_, production_);
  EXPECT_EQ(refusal(slotOf("slot_9")), "");
}

TEST_F(Inspection, refusesWhatCannotBe) {
  const double infinite = std::numeric_limits<double>::infinity();
  struct Case {
    std::function<void(InspectionFeature&)> edit;
    const char* reason;
  };
  const Case cases[] = {
      {[](auto& f) { f.kind = "hole"; }, "kind: 'hole', expected slot_width or step_position"},
      {[](auto& f) { f.kind = ""; }, "kind: '', expected slot_width or step_position"},
      {[](auto& f) { f.direction = "w"; }, "direction: 'w', expected x, y or z"},
      {[](auto& f) { f.direction = "z"; }, "direction: 'z', expected x or y of a slot's width"},
      {[](auto& f) { f.stamp = NAN; }, "stamp: nan is out of range (> 0 s)"},
      {[](auto& f) { f.stamp = 900.0; }, "stamp: inspected at 900.000 s, before its cut at 1000.000 s"},
      {[](auto& f) { f.nominal = NAN; }, "nominal: nan is out of range (> 0 m)"},
      {[](auto& f) { f.measured = NAN; }, "measured: nan is out of range (> 0 m)"},
      {[=](auto& f) { f.measured = infinite; }, "measured: inf is out of range (> 0 m)"},
      {[](auto& f) { f.measured = 0.0; }, "measured: 0 is out of range (> 0 m)"},
      {[](auto& f) { f.std_dev = NAN; }, "std_dev: nan is out of range (0 < value <= 0.001 m)"},
      {[](auto& f) { f.std_dev = 0.0; }, "std_dev: 0 is out of range (0 < value <= 0.001 m)"},
      {[](auto& f) { f.std_dev = 0.0015; }, "std_dev: 0.0015 is out of range (0 < value <= 0.001 m)"},
      {[](auto& f) { f.measured = 11.984; },
       "measured: 11972.0000 mm from nominal, expected at most 1.0000 mm (wrong feature or unit?)"},
      {[](auto& f) { f.nominal = 11.9e-3; }, "nominal: 11.9000 mm, narrower than the tool of 12.0000 mm"},
      {[](auto& f) { f.cut_time = 6000.0; },
       "cut_stamp 6000.000 s is in no cut of this name, the last one is from 1000.000 to 1020.000 s"},
      {[](auto& f) { f.machine_temperature = 31.0; },
       "machine_temperature: 31 is out of range (253.15 <= value <= 453.15 K)"},
      {[](auto& f) { f.part_temperature = 22.0; },
       "part_temperature: 22 is out of range (253.15 <= value <= 353.15 K)"},
      {[](auto& f) { f.part_temperature = 295.0; },
       "part_temperature and part_expansion: one without the other, expected both or none"},
      {[](auto& f) { f.part_temperature = 295.0, f.part_expansion = 23.1; },
       "part_expansion: 23.1 is out of range (0 < value <= 0.0001 1/K)"}};
  for (const Case& one : cases) {
    InspectionFeature f = slotOf("slot_1");
    one.edit(f);
    const std::string found = refusal(f);
    EXPECT_EQ(found, std::string("'slot_1': ") + one.reason);
    EXPECT_EQ(found.find('\n'), std::string::npos);
  }
}

TEST_F(Inspection, deflectionNeedsModesAndCoefficientsOfTheTool) {
  const InspectionResult slot = inspect(slotOf("slot_1"), cuts_, {});
  CoefficientDatabase database("");
  MachineModel model;
  InspectionRecord record = slot.record;
  const auto why = [&] { return setDeflection(slot.condition, model, database, &record); };
  EXPECT_EQ(why(), "the model states no modes of the tool tip along y");
  model.tool_tip.y.modes.push_back({1200.0, 0.03, 1e-7});
  EXPECT_EQ(why(), "the modes of the tool tip are those of another tool");
  model.tool = slot.condition.tool;
  EXPECT_EQ(why(), "no tangential and radial coefficients of 'endmill 12' in '6061'");
  EXPECT_TRUE(std::isnan(record.deflection));
  model.cutting = CuttingCoefficients{950e6, 300e6, NAN, 17e3, 21e3, NAN};
  EXPECT_EQ(why(), "");
  const double by_model = record.deflection;
  EXPECT_GT(std::abs(by_model), 0.05e-6);
  EXPECT_GT(record.deflection_std, 0.05 * std::abs(by_model) - 1e-12);
  // The database's own coefficients of the pair take precedence: twice the force, twice the deflection.
  CoefficientSet stored;
  stored.tool = "endmill 12";
  stored.material = "6061";
  stored.value = {2 * 950e6, 2 * 300e6, NAN, 2 * 17e3, 2 * 21e3, NAN};
  stored.std_dev = {19e6, 6e6, NAN, 340, 420, NAN};
  database.add(stored);
  EXPECT_EQ(why(), "");
  EXPECT_NEAR(record.deflection, 2.0 * by_model, 1e-3 * std::abs(by_model));
  record.nominal = 30e-3;
  EXPECT_EQ(why(), "no slot as wide as the tool");
  InspectionRecord step = inspect(stepOf("slot_1"), cuts_, {}).record;
  EXPECT_EQ(setDeflection(slot.condition, model, database, &step), "");
  EXPECT_TRUE(std::isnan(step.deflection));
}

const char* const PARTS = R"(format: smartmill-inspection/1
stamp_s: 1763700000.0
cuts:
- {name: slot_1, tool: endmill_12, material: "6061", diameter_mm: 12.0, cut_time_before_s: 240.0}
- {name: slot_2, tool: endmill_12, material: "6061", diameter_mm: 12.0, teeth: 3, helix_deg: 35.0,
   spindle_speed_rpm: 6000.0, feed_per_tooth_mm: 0.06, axial_depth_mm: 2.0}
features:
- {cut: slot_1, kind: slot_width, direction: y, nominal_mm: 12.0, measured_mm: 11.984, std_um: 1.5}
- {cut: slot_2, kind: slot_width, direction: x, nominal_mm: 12.0, measured_mm: 11.986, std_um: 1.5, cut_time_s: 1763600000.0}
- {cut: slot_2, kind: step_position, direction: z, nominal_mm: -5.0, measured_mm: -5.012, std_um: 2.0,
   machine_temperature_c: 31.0, part_temperature_c: 22.0, part_expansion_um_per_m_k: 23.1}
)";

TEST(InspectionFile, isReadIntoTheDatabase) {
  const TemporaryFolder folder;
  const std::string file = folder.write("parts.yaml", PARTS);
  const std::vector<InspectedFeature> read = readInspection(file);
  ASSERT_EQ(read.size(), 3u);
  EXPECT_EQ(read[0].record.edge_age, 240.0);
  EXPECT_NEAR(read[0].record.deviation(), -16e-6, 1e-12);
  EXPECT_EQ(read[0].condition.engagement.axial_depth, 0.0);
  EXPECT_NEAR(read[1].condition.spindle_speed, 628.3185307, 1e-6);
  EXPECT_EQ(read[1].record.cut_time, 1763600000.0);
  EXPECT_NEAR(read[2].record.machine_temperature, 304.15, 1e-9);
  // -5.012 mm shrink to 20 deg C by 23.1e-6 x 2 K.
  EXPECT_NEAR(read[2].record.deviation(), -12e-6 + 0.2316e-6, 1e-10);

  const std::string database = folder.file("m.sqlite");
  const auto run = [&](std::vector<const char*> arguments) {
    arguments.insert(arguments.begin(), "coefficients_db");
    ::testing::internal::CaptureStdout();
    const int code = runCommand(databaseCommand(), static_cast<int>(arguments.size()), arguments.data());
    EXPECT_EQ(code, 0);
    return ::testing::internal::GetCapturedStdout();
  };
  const std::string first = run({database.c_str(), "inspect", file.c_str(), "--machine", "mill 07"});
  EXPECT_THAT(first,
              StartsWith("3 new of 3\nmill 07: endmill_12: effective radius: 5.9925 +- 0.0005 mm, -7.5 um"));
  EXPECT_THAT(
      first,
      HasSubstr(
          "mill 07: endmill_12: thermal growth along z: 1 position with temperature, expected 3 or more"));
  EXPECT_THAT(run({database.c_str(), "inspect", file.c_str(), "--machine", "mill 07"}),
              StartsWith("0 new of 3\n"));
  const std::string shown = run({database.c_str(), "inspections", "--tool", "endmill_12"});
  EXPECT_THAT(
      shown,
      StartsWith("endmill_12 / 6061  slot_1: slot_width along y, 11.9840 mm, -16.0 +- 1.5 um from nominal, "
                 "edge age 4.0 min, stamp 1763700000.000 s, mill 07\n"));
  EXPECT_THAT(shown, HasSubstr("machine at 31.0 degC"));
  EXPECT_THAT(shown, HasSubstr("effective radius: 5.9925"));
  EXPECT_EQ(run({database.c_str(), "inspections", "--since", "1763700001"}), "");
}

TEST(InspectionFile, nameWhatIsWrong) {
  expectRefusals(
      PARTS,
      {{"smartmill-inspection/1", "smartmill-inspection/2",
        "format: 'smartmill-inspection/2' is not one of smartmill-inspection/1"},
       {"stamp_s: 1763700000.0\n", "", "stamp_s: is missing"},
       {"name: slot_2", "name: slot_1", "cuts[1].name: 'slot_1' is the name of two cuts"},
       {"diameter_mm: 12.0, cut", "diameter_mm: 0.0, cut", "cuts[0].diameter_mm: 0 is out of range (> 0)"},
       {"helix_deg: 35.0,", "", "cuts[1].helix_deg: is missing"},
       {"axial_depth_mm: 2.0", "axial_depth: 2.0", "cuts[1].axial_depth_mm: is missing"},
       {"material: \"6061\", diameter_mm: 12.0, cut",
        "material: \"6061\", radius_mm: 6.0, diameter_mm: 12.0, cut",
        "cuts[0].radius_mm: unknown key (its value: '6.0')"},
       {"cut: slot_1", "cut: slot_7", "features[0].cut: 'slot_7' is not among the cuts"},
       {"kind: slot_width", "kind: hole",
        "features[0].kind: 'hole' is not one of slot_width | step_position"},
       {"direction: y", "direction: up", "features[0].direction: 'up' is not one of x | y | z"},
       {"measured_mm: 11.984", "measured_mm: .nan", "features[0].measured_mm: '.nan' is not a finite number"},
       {"measured_mm: 11.984", "measured_mm: wide", "features[0].measured_mm: 'wide' is not a number"},
       {"measured_mm: 11.984", "measured_mm: 11.984, measured_mm: 12.0",
        "features[0].measured_mm: the key occurs twice"},
       {"std_um: 1.5}", "std_um: 0.0}", "features[0].std_um: 0 is out of range (> 0)"},
       {"std_um: 1.5}", "std: 1.5}", "features[0].std_um: is missing"},
       {"measured_mm: 11.984", "measured_mm: 1.1984",
        "features[0]: measured: 10.8016 mm from nominal, expected at most 1.0000 mm (wrong feature or "
        "unit?)"},
       {"nominal_mm: 12.0, measured_mm: 11.984", "nominal_mm: 11.5, measured_mm: 11.49",
        "features[0]: nominal: 11.5000 mm, narrower than the tool of 12.0000 mm"},
       {"cut_time_s: 1763600000.0", "cut_time_s: 1863600000.0",
        "features[1]: cut_stamp: 1863600000 is out of range (0 < value <= 1763700000 s)"},
       {", part_expansion_um_per_m_k: 23.1", "",
        "features[2]: part_temperature and part_expansion: one without the other, expected both or none"}},
      [](const std::string& file) { readInspection(file); });
}

}  // namespace
}  // namespace smartmill::loadmeter
