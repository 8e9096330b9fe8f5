#include "smartmill_core/model/machine_model.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/testing/refusals.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;

constexpr const char* MODEL = R"(format: smartmill-model/1
tool:
  teeth: 4
  diameter_mm: 19.05
  helix_deg: 30.0
  pitch_deg: [88, 92, 88, 92]
  stickout_mm: 51.0
cutting:
  Ktc_n_per_mm2: 796.0
  Krc_n_per_mm2: 168.0
  Kac_n_per_mm2: 222.0
  Kte_n_per_mm: 27.7
  Kre_n_per_mm: 30.8
  Kae_n_per_mm: 1.4
  Ktc_n_per_mm2_std: 8.0
tool_tip:
  x: [{frequency_hz: 1210.0, damping_ratio: 0.031, stiffness_n_per_um: 28.0, stiffness_n_per_um_std: 1.4}]
  y: [{frequency_hz: 1180.0, damping_ratio: 0.029, stiffness_n_per_um: 31.0}]
force_sensor:
  x: [{frequency_hz: 930.0, damping_ratio: 0.03, gain: 0.9}]
  y: [{frequency_hz: 1080.0, damping_ratio: 0.03, gain: 0.9}]
  noise_rms_n: [1.0, 1.0, 1.5]
  measures: force_on_workpiece
spindle:
  viscous_nm_s_per_rad: 3.70e-4
  coulomb_nm: -0.0647
  load_meter_v_per_w: 3.88e-4
  load_meter_bandwidth_hz: 7.0
  load_meter_resolution_v: 3.0e-4
  friction_zero_below_rpm: 2000
  load_meter_full_scale_v: 8.0
  max_speed_rpm: 20000
  rated_torque_nm: 40
  rated_power_w: 15000
  acceleration_rpm_per_s: 8000
axes:
  x_travel_mm: [0, 500]
  y_travel_mm: [0, 400]
  z_travel_mm: [-300, 0]
  rapid_mm_per_min: 30000
  acceleration_mm_per_s2: 3000
  home_mm: [10, 20, 0]
hammer:
  offset_mm: 12
  opposite: {distance_mm: 40, stroke_mm: 25}
  peak_force_n: 150
  contact_time_us: 300
  force_noise_rms_n: 0.2
  gap_at_zero_volt_um: 250
  gain_v: 10
  range_v: 10
  voltage_noise_rms_v: 1.0e-3
  flute_depth_mm: 2.0
  position_mm: {x: [100, 50, -200], y: [120, 70, -200]}
workpiece:
  material: AL 7050-T7451
  low_mm: [200, 100, -260]
  high_mm: [400, 250, -210]
  modes:
  - {position_mm: 0, y: [{frequency_hz: 400, damping_ratio: 0.01, stiffness_n_per_um: 8}]}
  - {position_mm: 60, y: [{frequency_hz: 520, damping_ratio: 0.02, stiffness_n_per_um: 2, stiffness_n_per_um_std: 0.1}]}
effects:
- {name: runout, offset_um: 8.1, offset_um_std: 0.2, angle_deg: 31.0}
- {name: cross_talk, xy: 0.02}
- {name: uneven_pitch, pitch_deg: [89, 91, 89, 91], pitch_deg_std: [0.01, 0.02, 0.01, 0.02]}
- {name: gain_error, channel: fy, gain: 1.05}
- {name: mains_hum, frequency_hz: 50, amplitude_n: 2, y_ratio: -0.4}
- {name: tool_flexibility, x: [{frequency_hz: 900, damping_ratio: 0.02, stiffness_n_per_um: 12}]}
uncertainty_percent: {cutting: 4, damping: 12}
)";

void expectModel(const MachineModel& m) {
  ASSERT_TRUE(m.tool && m.stickout && m.cutting && m.cutting_std && m.spindle && m.axes && m.hammer &&
              m.workpiece);
  EXPECT_EQ(m.tool->teeth, 4);
  EXPECT_DOUBLE_EQ(m.tool->diameter, 0.01905);
  EXPECT_DOUBLE_EQ(m.tool->pitch[1], units::radFromDeg(92.0));
  EXPECT_DOUBLE_EQ(*m.stickout, 0.051);
  EXPECT_DOUBLE_EQ(m.cutting->ktc, 796e6);
  EXPECT_DOUBLE_EQ(m.cutting->kae, 1400.0);
  EXPECT_DOUBLE_EQ(m.cutting_std->ktc, 8e6);
  EXPECT_TRUE(std::isnan(m.cutting_std->krc));
  EXPECT_DOUBLE_EQ(m.tool_tip.x.modes.at(0).gain, 1.0 / 28e6);
  EXPECT_NEAR(m.tool_tip.x.modes.at(0).gain_std, 0.05 / 28e6, 1e-20);
  EXPECT_TRUE(std::isnan(m.tool_tip.y.modes.at(0).gain_std));
  EXPECT_DOUBLE_EQ(m.force_sensor.axis[0].direct, 0.1);
  EXPECT_DOUBLE_EQ(m.force_sensor.axis[2].direct, 1.0);  // absent: ideal
  EXPECT_DOUBLE_EQ(m.force_sensor.axis[2].response(100.0).real(), 1.0);
  EXPECT_EQ(*m.force_sensor.noise_rms, (Axes3{1.0, 1.0, 1.5}));
  EXPECT_TRUE(m.force_sensor.measures_workpiece);
  EXPECT_DOUBLE_EQ(m.spindle->coulomb, -0.0647);
  EXPECT_NEAR(m.spindle->friction_zero_below, 209.4, 0.1);  // Dunwoody eq. 3.11
  EXPECT_DOUBLE_EQ(*m.spindle->load_meter_full_scale, 8.0);
  EXPECT_DOUBLE_EQ(m.axes->travel[2][0], -0.3);
  EXPECT_DOUBLE_EQ(m.axes->rapid, 0.5);
  EXPECT_DOUBLE_EQ(m.axes->home[1], 0.02);
  ASSERT_TRUE(m.hammer->opposite);
  EXPECT_DOUBLE_EQ(m.hammer->opposite->distance, 0.04);
  EXPECT_DOUBLE_EQ(m.hammer->opposite->stroke, 0.025);
  EXPECT_DOUBLE_EQ(m.hammer->contact_time, 3e-4);
  EXPECT_DOUBLE_EQ(m.hammer->gap_at_zero_volt, 250e-6);
  EXPECT_DOUBLE_EQ(m.hammer->position.at("y")[0], 0.12);
  EXPECT_EQ(m.workpiece->material, "AL 7050-T7451");
  EXPECT_DOUBLE_EQ(m.workpiece->high[2], -0.21);
  ASSERT_EQ(m.workpiece_modes.size(), 2u);
  EXPECT_DOUBLE_EQ(m.workpiece_modes[1].position, 0.06);
  EXPECT_TRUE(m.workpiece_modes[1].x.modes.empty());
  EXPECT_DOUBLE_EQ(m.workpiece_modes[1].y.modes.at(0).gain, 1.0 / 2e6);
  EXPECT_NEAR(m.workpiece_modes[1].y.modes.at(0).gain_std, 0.05 / 2e6, 1e-20);
  ASSERT_EQ(m.effects.size(), 6u);
  EXPECT_DOUBLE_EQ(m.effects[0].numbers.at("offset_um"), 8.1);
  EXPECT_DOUBLE_EQ(m.effects[0].std_devs.at("offset_um"), 0.2);
  EXPECT_DOUBLE_EQ(m.effects[1].numbers.at("xy"), 0.02);
  EXPECT_DOUBLE_EQ(m.effects[1].numbers.at("zy"), 0.0);  // omitted
  EXPECT_EQ(m.effects[2].lists.at("pitch_deg"), (std::vector<double>{89.0, 91.0, 89.0, 91.0}));
  EXPECT_DOUBLE_EQ(m.effects[2].std_devs.at("pitch_deg[1]"), 0.02);
  EXPECT_EQ(m.effects[3].words.at("channel"), "fy");
  EXPECT_DOUBLE_EQ(m.effects[5].flexibility.x.modes.at(0).frequency, 900.0);
  EXPECT_DOUBLE_EQ(m.uncertainty.cutting, 4.0);
  EXPECT_DOUBLE_EQ(m.uncertainty.frequency, 0.5);
}

TEST(MachineModel, readsAndWritesEveryKey) {
  const TemporaryFolder folder;
  const MachineModel model = readMachineModel(folder.write("a.yaml", MODEL));
  expectModel(model);
  writeMachineModel(model, folder.file("b.yaml"));
  expectModel(readMachineModel(folder.file("b.yaml")));
}

TEST(MachineModel, edgesOfATool) {
  const TemporaryFolder folder;
  const std::string text =
      "format: smartmill-model/1\ntool:\n  teeth: 2\n  diameter_mm: 20\n  helix_deg: [35, 38]\n"
      "  corner_radius_mm: 2.5\n  edge_angle_deg: 45\n  serration: {amplitude_mm: 0.2, wavelength_mm: 2}\n"
      "  stickout_mm: 51\n  edge_height_mm: 6\n  holder_diameter_mm: 40\n";
  writeMachineModel(readMachineModel(folder.write("a.yaml", text)), folder.file("b.yaml"));
  for (const char* file : {"a.yaml", "b.yaml"}) {
    const ToolGeometry tool = *readMachineModel(folder.file(file)).tool;
    EXPECT_DOUBLE_EQ(tool.edge.corner_radius, 2.5e-3);
    EXPECT_DOUBLE_EQ(tool.edge.edge_angle, 0.25 * units::PI);
    ASSERT_EQ(tool.edge.helix.size(), 2u);
    EXPECT_DOUBLE_EQ(tool.edge.helix[1], units::radFromDeg(38.0));
    EXPECT_NEAR(std::tan(tool.helix),
                0.5 * (std::tan(units::radFromDeg(35.0)) + std::tan(units::radFromDeg(38.0))), 1e-12);
    EXPECT_DOUBLE_EQ(tool.edge.serration_amplitude, 0.2e-3);
    EXPECT_DOUBLE_EQ(tool.edge.serration_wavelength, 2e-3);
    const MachineModel model = readMachineModel(folder.file(file));
    EXPECT_DOUBLE_EQ(model.edge_height.value_or(0.0), 6e-3);
    EXPECT_DOUBLE_EQ(model.holder_diameter.value_or(0.0), 40e-3);
  }
  const std::string flat =
      "format: smartmill-model/1\ntool: {teeth: 2, diameter_mm: 20, helix_deg: 30, edge_angle_deg: 90}\n";
  EXPECT_TRUE(readMachineModel(folder.write("flat.yaml", flat)).tool->edge.straight());
}

TEST(MachineModel, errorsNameTheEdgesOfATool) {
  const std::string text =
      "format: smartmill-model/1\ntool:\n  teeth: 2\n  diameter_mm: 20\n  helix_deg: [35, 38]\n"
      "  corner_radius_mm: 2.5\n  edge_angle_deg: 90\n  serration: {amplitude_mm: 0.2, wavelength_mm: 2}\n";
  expectRefusals(
      text,
      {{"[35, 38]", "[35, 38, 35]", "tool.helix_deg: a list of 3, expected 2 numbers"},
       {"[35, 38]", "[35, 80]", "tool.helix_deg[1]: 80 is out of range (0 <= value < 80)"},
       {"corner_radius_mm: 2.5", "corner_radius_mm: 10.5",
        "tool.corner_radius_mm: 10.5 is out of range (0 <= value <= 10)"},
       {"corner_radius_mm: 2.5", "corner_radius_mm: -1",
        "tool.corner_radius_mm: -1 is out of range (0 <= value <= 10)"},
       {"edge_angle_deg: 90", "holder_diameter_mm: 40",
        "tool.holder_diameter_mm: needs stickout_mm, where the holder begins"},
       {"edge_angle_deg: 90", "edge_angle_deg: 0",
        "tool.edge_angle_deg: 0 is out of range (0 < value <= 90)"},
       {"edge_angle_deg: 90", "edge_angle_deg: 95",
        "tool.edge_angle_deg: 95 is out of range (0 < value <= 90)"},
       {"amplitude_mm: 0.2", "amplitude_mm: 0", "tool.serration.amplitude_mm: 0 is out of range (> 0)"},
       {", wavelength_mm: 2", "", "tool.serration.wavelength_mm: is missing"},
       {"wavelength_mm: 2", "wave_mm: 2", "tool.serration.wavelength_mm: is missing"}},
      readMachineModel);
}

TEST(MachineModel, anEmptyModelIsValidAndErrorsNameTheMissingSection) {
  const TemporaryFolder folder;
  const MachineModel model = readMachineModel(folder.write("m.yaml", "format: smartmill-model/1\n"));
  EXPECT_EQ(errorOf([&] { model.needTool("predict forces"); }),
            folder.file("m.yaml") + ": tool is missing (needed to predict forces)");
  EXPECT_EQ(errorOf([&] { model.needSpindle("read the load meter"); }),
            folder.file("m.yaml") + ": spindle is missing (needed to read the load meter)");
  const MachineModel part = readMachineModel(
      folder.write("p.yaml", "format: smartmill-model/1\ncutting: {Ktc_n_per_mm2: 800, Kte_n_per_mm: 10}\n"));
  EXPECT_EQ(errorOf([&] { part.needCutting("simulate a cut"); }),
            folder.file("p.yaml") + ": cutting.Krc_n_per_mm2 is missing (needed to simulate a cut)");
}

// A dynamometer turned by 30 degrees on a shifted table: its axes and the lever arm by hand.
TEST(MachineModel, framesCarryForcesAndMoments) {
  const TemporaryFolder folder;
  const std::string head = "format: smartmill-model/1\nframes:\n";
  folder.write("model.yaml", head +
                                 "  table: {position_mm: [100, 0, 0]}\n"
                                 "  dynamometer: {position_mm: [0, 20, 50], about_z_deg: 30}\n");
  const MachineModel model = readMachineModel(folder.file("model.yaml"));
  const PlacedFrame placed = placedFrame(model.frames, "dynamometer", "machine");
  EXPECT_TRUE(placed.isTurned());
  EXPECT_FALSE(placedFrame(model.frames, "hammer", "machine").isTurned());
  Axes3 force{{10.0, 0.0, -3.0}}, moment{{0.0, 0.0, 2.0}};
  placed.carry(force, moment);
  const double fx = 10.0 * std::cos(units::PI / 6.0), fy = 5.0;
  EXPECT_NEAR(force[0], fx, 1e-12);
  EXPECT_NEAR(force[1], fy, 1e-12);
  EXPECT_NEAR(force[2], -3.0, 1e-12);
  // r = (0.1, 0.02, 0.05)
  EXPECT_NEAR(moment[0], 0.02 * -3.0 - 0.05 * fy, 1e-12);
  EXPECT_NEAR(moment[1], 0.05 * fx - 0.1 * -3.0, 1e-12);
  EXPECT_NEAR(moment[2], 2.0 + 0.1 * fy - 0.02 * fx, 1e-12);
  writeMachineModel(model, folder.file("again.yaml"));
  const FramePose again = readMachineModel(folder.file("again.yaml")).frames.at("dynamometer");
  EXPECT_EQ(again.parent, "table");
  EXPECT_NEAR(again.position[2], 0.05, 1e-12);
  EXPECT_NEAR(again.rotation[2], std::sin(units::PI / 12.0), 1e-9);

  const auto refusal = [&](const std::string& entry) {
    folder.write("bad.yaml", head + "  " + entry + "\n");
    return errorOf([&] { readMachineModel(folder.file("bad.yaml")); });
  };
  EXPECT_NE(refusal("dynamometer: {rotation_xyzw: [0, 0, 0.5, 1]}")
                .find("frames.dynamometer.rotation_xyzw: has length 1.118, expected a unit quaternion"),
            std::string::npos);
  EXPECT_NE(
      refusal("dynamometer: {parent: pallet}").find("frames.dynamometer: parent 'pallet' is not a frame"),
      std::string::npos);
  EXPECT_NE(refusal("dynamometer: {parent: hammer}\n  hammer: {parent: dynamometer}").find("a loop"),
            std::string::npos);
  EXPECT_NE(refusal("vice: {about_z_deg: 1}").find("frames.vice: is not a frame"), std::string::npos);
  EXPECT_NE(refusal("table: {about_z_deg: 1, rotation_xyzw: [0, 0, 0, 1]}").find("expected one of them"),
            std::string::npos);
  EXPECT_EQ(errorOf([&] { placedFrame(model.frames, "tool_tip", "machine"); }),
            "frames: no transform from tool_tip to machine: the chain ends at spindle");
}

// The modes alone make a section; the stock is then absent.
TEST(MachineModel, modesOfTheWorkpieceNeedNoStock) {
  const TemporaryFolder folder;
  const std::string text =
      "format: smartmill-model/1\nworkpiece:\n  modes: [{x: [{frequency_hz: 400, damping_ratio: 0.01, "
      "stiffness_n_per_um: 8}]}]\n";
  const MachineModel model = readMachineModel(folder.write("a.yaml", text));
  EXPECT_FALSE(model.workpiece);
  EXPECT_DOUBLE_EQ(model.workpieceModes().x.modes.at(0).frequency, 400.0);
  writeMachineModel(model, folder.file("b.yaml"));
  EXPECT_DOUBLE_EQ(readMachineModel(folder.file("b.yaml")).workpieceModes().x.modes.at(0).frequency, 400.0);
  EXPECT_TRUE(MachineModel().workpieceModes().y.modes.empty());
}

// Half way between two places frequency and damping ratio are the means, and so is the shape w / sqrt(k).
TEST(MachineModel, modesAtAPositionAreInterpolated) {
  const TemporaryFolder folder;
  const MachineModel model = readMachineModel(folder.write("a.yaml", MODEL));
  const Mode middle = atPosition(model, 0.03).workpieceModes().y.modes.at(0);
  EXPECT_DOUBLE_EQ(middle.frequency, 460.0);
  EXPECT_DOUBLE_EQ(middle.damping_ratio, 0.015);
  const double shape = 0.5 * (400.0 / std::sqrt(8e6) + 520.0 / std::sqrt(2e6));
  EXPECT_NEAR(middle.gain * 460.0 * 460.0 / (shape * shape), 1.0, 1e-12);
  EXPECT_TRUE(std::isnan(middle.gain_std));  // one place states none
  for (const std::size_t end : {0u, 1u}) {
    const WorkpieceModes& place = model.workpiece_modes[end];
    const Mode there = atPosition(model, place.position).workpieceModes().y.modes.at(0);
    EXPECT_NEAR(there.gain / place.y.modes[0].gain, 1.0, 1e-12);
    EXPECT_DOUBLE_EQ(there.frequency, place.y.modes[0].frequency);
  }
  EXPECT_THAT(errorOf([&] { atPosition(model, 0.061); }),
              EndsWith("a.yaml: workpiece.modes: position 61 mm is outside the places (0 <= value <= 60)"));
  EXPECT_THAT(errorOf([&] { model.workpieceModes(); }),
              EndsWith("a.yaml: workpiece.modes: 2 places, expected a position along the part"));
  EXPECT_THAT(errorOf([] { atPosition({}, 0.0); }),
              EndsWith("workpiece.modes is missing (needed for a position along the part)"));
}

TEST(MachineModel, errorsNameFileKeyAndValue) {
  const TemporaryFolder folder;
  const std::vector<Refusal> refusals{
      {"diameter_mm: 19.05", "diameter_mm: -19.05", "tool.diameter_mm: -19.05 is out of range (> 0)"},
      {"diameter_mm: 19.05", "diameter_mm: .nan", "tool.diameter_mm: '.nan' is not a finite number"},
      {"diameter_mm: 19.05", "diameter_mm: nan", "tool.diameter_mm: 'nan' is not a finite number"},
      {"diameter_mm: 19.05", "diameter_mm: 1e999", "tool.diameter_mm: '1e999' is not a finite number"},
      {"diameter_mm: 19.05", "diameter_mm: \"19\"", "tool.diameter_mm: '19' is not a number"},
      {"diameter_mm: 19.05", "diameter_mm: wide", "tool.diameter_mm: 'wide' is not a number"},
      {"diameter_mm: 19.05", "diameter_mm: [1]", "tool.diameter_mm: a list of 1 is not a number"},
      {"diameter_mm: 19.05", "diameter: 19.05", "tool.diameter_mm: is missing"},
      {"  stickout_mm: 51.0", "  stickout: 51.0", "tool.stickout: unknown key (its value: '51.0')"},
      {"teeth: 4", "teeth: 21", "tool.teeth: 21 is out of range (1 <= value <= 20)"},
      {"teeth: 4", "teeth: 3.5", "tool.teeth: 3.5 is not an integer"},
      {"helix_deg: 30.0", "helix_deg: 80", "tool.helix_deg: 80 is out of range (0 <= value < 80)"},
      {"[88, 92, 88, 92]", "[88, 92, 88]", "tool.pitch_deg: a list of 3, expected 4 numbers"},
      {"[88, 92, 88, 92]", "[88, 92, 88, 93]", "tool.pitch_deg: the pitches sum to 361.0, expected 360"},
      {"[88, 92, 88, 92]", "[88, -92, 88, 92]", "tool.pitch_deg[1]: -92 is out of range (> 0)"},
      {"Kre_n_per_mm: 30.8", "Kre_n_per_mm: -1", "cutting.Kre_n_per_mm: -1 is out of range (>= 0)"},
      {"damping_ratio: 0.031", "damping_ratio: 1.0",
       "tool_tip.x[0].damping_ratio: 1 is out of range (0 < value < 1)"},
      {"stiffness_n_per_um: 31.0", "stiffness: 31.0", "tool_tip.y[0].stiffness_n_per_um: is missing"},
      {"gain: 0.9", "gain: 1.1", "force_sensor.x: the gains sum to 1.1, out of range (<= 1)"},
      {"[1.0, 1.0, 1.5]", "[1.0, 1.0]", "force_sensor.noise_rms_n: a list of 2, expected 3 numbers"},
      {"force_on_workpiece", "force_on_table",
       "force_sensor.measures: 'force_on_table' is not one of force_on_tool | force_on_workpiece"},
      {"viscous_nm_s_per_rad: 3.70e-4", "viscous_nm_s_per_rad: -1.0e-4",
       "spindle.viscous_nm_s_per_rad: -0.0001 is out of range (>= 0)"},
      {"x_travel_mm: [0, 500]", "x_travel_mm: [500, 0]",
       "axes.x_travel_mm: 500.0..0.0 is out of range (min < max)"},
      {"high_mm: [400, 250, -210]", "high_mm: [100, 250, -210]",
       "workpiece.high_mm: expected a value above low_mm in x"},
      {"position_mm: 0, y:", "position_mm: 0, z:",
       "workpiece.modes[0].x: is missing, and y too: expected modes along one axis at least"},
      {"position_mm: 60,", "position_mm: -60,",
       "workpiece.modes[1].position_mm: -60.0, expected a value above 0.0"},
      {"position_mm: 60, y:", "y:", "workpiece.modes[1].position_mm: is missing (there are several places)"},
      {"position_mm: 60, y:", "position_mm: 60, x:",
       "workpiece.modes[1].position_mm: 60.0: expected as many modes in x and in y as at the first place"},
      {"name: runout", "name: run_out", "effects[0].name: 'run_out' is not an effect of the catalogue"},
      {"offset_um: 8.1", "offset: 8.1", "effects[0].offset_um: is missing"},
      {"xy: 0.02", "xx: 0.02", "effects[1].xx: unknown key (its value: '0.02')"},
      {"channel: fy", "channel: fq",
       "effects[3].channel: 'fq' is not one of fx | fy | fz | load_meter | tool_x | tool_y | displacement | "
       "acceleration"},
      {"frequency_hz: 50", "frequency_hz: 55", "effects[4].frequency_hz: 55.0 is out of range (50 or 60)"},
      {"cutting: 4,", "cutting: -4,", "uncertainty_percent.cutting: -4 is out of range (>= 0)"},
      {"smartmill-model/1", "smartmill-model/2",
       "format: 'smartmill-model/2' is not one of smartmill-model/1"},
      {"workpiece:", "work:", "work: unknown key (its value: a map)"},
      {"spindle:\n", "tool:\n", "tool: the key occurs twice"},
      {"tool:\n", "tool: 4\ntools:\n", "tool: '4' is not a map of keys"},
      {"effects:\n", "effects: {}\nmore:\n", "effects: a map is not a list"},
  };
  expectRefusals(MODEL, refusals, readMachineModel);
  const std::string broken = folder.write("broken.yaml", "format: [smartmill\n");
  const std::string message = errorOf([&] { readMachineModel(broken); });
  EXPECT_THAT(message, HasSubstr(broken + ": not a YAML file: "));
  EXPECT_EQ(message.find('\n'), std::string::npos);
  EXPECT_THAT(errorOf([&] { readMachineModel(folder.file("none.yaml")); }),
              EndsWith("none.yaml: cannot be read"));
  EXPECT_THAT(errorOf([&] { writeMachineModel({}, "/nowhere/m.yaml"); }), HasSubstr("cannot be written"));
}

TEST(StrictYaml, writesNumbersThatEveryReaderParsesAsNumbers) {
  EXPECT_EQ(yamlNumber(1e-5), "1.0e-05");
  EXPECT_EQ(yamlNumber(0.1), "0.1");
  EXPECT_EQ(yamlNumber(25600), "25600.0");
  EXPECT_EQ(yamlWord("slot_1"), "slot_1");
  EXPECT_EQ(yamlWord("1018"), "\"1018\"");
  EXPECT_EQ(yamlWord("AL 7050: T"), "\"AL 7050: T\"");
}

}  // namespace
}  // namespace smartmill
