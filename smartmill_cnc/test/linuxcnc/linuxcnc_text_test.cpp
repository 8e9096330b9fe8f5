#include "smartmill_cnc/linuxcnc/linuxcnc_controller.h"

#include <gtest/gtest.h>

#include "smartmill_cnc/linuxcnc/configuration.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc::linuxcnc {
namespace {

MotionLimits limits() {
  MotionLimits l;
  l.travel = {{{-0.25, 0.25}, {-0.2, 0.2}, {-0.3, 0.0}}};
  l.max_feed = 0.4;
  l.max_spindle_speed = 2000.0;
  return l;
}

std::string textOf(const std::string& program) {
  const NcCheck check = checkProgram(program, {}, limits(), DialectOptions{0, 4});
  EXPECT_EQ(check.verdict, NcVerdict::good) << check.message;
  return linuxCncText(check.text);
}

// RS-274/NGC has dwells in seconds; a Fanuc waits for the spindle to stop, LinuxCNC does so with M66.
TEST(LinuxCncText, IsEquivalentInTheOtherDialect) {
  EXPECT_EQ(textOf("G91 G1 F600 X10.5\nG4 P1500\nG4 X2.5\nS4000 M3\nG0 Z-1\nM30\n"),
            "G21 G94 G61.1 M52 P1\n"
            "G90\n"
            "M67 E0 Q2\nG91 G1 F600.0000 X10.5000\n"
            "G4 P1.5000\n"
            "G4 P2.5000\n"
            "S4000 M3\n"
            "M67 E0 Q6\nG0 Z-1.0000\n"
            "M68 E0 Q0\nM5\nM66 P0 L3 Q30\n"
            "M68 E0 Q0\n");
}

TEST(LinuxCncText, OrientsFromAVariableAsAFanucDoes) {
  const std::string text = textOf(orientProgram(1.5707963267948966, 1133));
  EXPECT_NE(text.find("#1133=1024\nM68 E0 Q0\nM5\nM66 P0 L3 Q30\nM19 R[#1133*360/4096] Q20\n"),
            std::string::npos)
      << text;
}

MachineModel model() {
  MachineModel m;
  m.file = "mill.yaml";
  m.axes = MachineAxes{{{{-0.25, 0.25}, {-0.2, 0.2}, {-0.3, 0.0}}}, 0.4, 5.0, {{0, 0, 0}}};
  m.spindle.emplace();
  m.spindle->max_speed = units::radPerSecFromRpm(20000.0);
  m.spindle->acceleration = units::radPerSecFromRpm(10000.0);
  return m;
}

TEST(LinuxCncConfiguration, HasTheModelsLimits) {
  const auto files = configurationOf(model(), "/somewhere");
  const std::string& ini = files.at("mill.ini");
  for (const char* line :
       {"NML_FILE = /somewhere/mill.nml\n", "MAX_LINEAR_VELOCITY = 400\n", "MAX_LINEAR_ACCELERATION = 5000\n",
        "[AXIS_Z]\nMAX_VELOCITY = 400\nMAX_ACCELERATION = 5000\nMIN_LIMIT = -300.001\nMAX_LIMIT = 0.001\n",
        "SERVO_PERIOD = 1000000\n", "MAX_FORWARD_VELOCITY = 20000\n"}) {
    EXPECT_NE(ini.find(line), std::string::npos) << line;
  }
  EXPECT_NE(files.at("mill.hal").find("setp ramp.maxv 10000\n"), std::string::npos);
}

TEST(LinuxCncConfiguration, NamesAMissingValueOfTheModel) {
  MachineModel m = model();
  m.spindle->acceleration.reset();
  try {
    configurationOf(m, "/somewhere");
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("acceleration_rpm_per_s"), std::string::npos) << e.what();
  }
}

TEST(LinuxCncController, ReportsAMissingGateway) {
  EXPECT_THROW(makeLinuxCncController({}, nullptr, nullptr), Error);
  const auto controller =
      makeLinuxCncController({"/nowhere", 0.1}, std::make_shared<ServoStream>("/nowhere"), nullptr);
  const Result<std::string> connected = controller->connect();
  ASSERT_FALSE(connected);
  EXPECT_EQ(connected.failure().kind, Failure::Kind::lost);
  EXPECT_NE(connected.failure().message.find("/nowhere/gateway.socket"), std::string::npos);
}

}  // namespace
}  // namespace smartmill::cnc::linuxcnc
