// Inertia force of the moving force sensor against its closed form.

#include <cmath>
#include <complex>

#include <gtest/gtest.h>

#include "effects_rig.h"

namespace smartmill::sim {
namespace {

constexpr double MASS = 37.3, AMPLITUDE = 4e-3;  // [kg], [m] of the axis

EffectEntry inertiaOf(const char* axis) {
  return effectEntry("axis_inertia", {{"mass_kg", MASS}}, {{"axis", axis}});
}

// Position AMPLITUDE sin(2 pi f t) of the y axis, as a controller records it.
Record moveOfY(double frequency, bool as_velocity) {
  Record record;
  for (int i = 0; i < 10000; ++i) {
    const double t = i / 10000.0, w = units::TWO_PI * frequency;
    record.time.push_back(t);
    if (as_velocity) {
      record.add("axis_vy").push_back(AMPLITUDE * w * std::cos(w * t));
    } else {
      record.add("axis_y").push_back(AMPLITUDE * std::sin(w * t));
    }
    for (const char* name : {"fx", "fy", "fz"}) record.add(name).push_back(0.0);
  }
  return record;
}

Record simulated(const MachineModel& model, const Record& recorded) {
  CampaignTest test;
  test.name = "move";
  test.kind = TestKind::move;
  test.sample_rate = 10000.0;
  SimulationOptions options;
  options.noise = false;
  return simulateTest(model, test, recorded, options);
}

// Away from the ends of the record, where the acceleration is not defined.
TEST(AxisInertia, isMinusMassTimesAcceleration) {
  const double w = units::TWO_PI * 2.0, peak = MASS * AMPLITUDE * w * w;
  for (const bool as_velocity : {true, false}) {
    MachineModel model = with(mill(4, 30.0), {inertiaOf("y")});
    const Record recorded = moveOfY(2.0, as_velocity), on_tool = simulated(model, recorded);
    model.force_sensor.measures_workpiece = true;
    const Record on_workpiece = simulated(model, recorded);
    for (const std::size_t i : {500u, 3333u, 9000u}) {
      const double force = peak * std::sin(w * recorded.time[i]);  // -m a
      EXPECT_NEAR(on_tool.column("fy")[i], force, 1e-4 * peak);
      EXPECT_NEAR(on_workpiece.column("fy")[i], -force, 1e-4 * peak);
      EXPECT_EQ(on_tool.column("fx")[i], 0.0);
      EXPECT_EQ(on_tool.column("fz")[i], 0.0);
    }
  }
}

TEST(AxisInertia, passesTheModesOfTheSensor) {
  constexpr double FREQUENCY = 8.0;
  MachineModel model = with(mill(4, 30.0), {inertiaOf("y")});
  ModalModel& sensor = model.force_sensor.axis[1];
  sensor.modes = {{20.0, 0.2, 0.9}};
  sensor.direct = 0.1;
  const Record recorded = moveOfY(FREQUENCY, true);
  const std::vector<double> fy = simulated(model, recorded).column("fy");
  // Half a second, four periods, after the transient.
  const double w = units::TWO_PI * FREQUENCY;
  std::complex<double> line;
  for (std::size_t i = 4000; i < 9000; ++i) line += fy[i] * std::polar(2.0 / 5000.0, -w * recorded.time[i]);
  const std::complex<double> expected =
      MASS * AMPLITUDE * w * w * std::complex<double>(0.0, -1.0) * sensor.response(FREQUENCY);
  EXPECT_NEAR(std::abs(line - expected), 0.0, 2e-3 * std::abs(expected));
}

TEST(AxisInertia, needsTheMotionOfItsAxis) {
  const EffectKind& kind = *findEffect("axis_inertia");
  std::vector<std::string> keys;
  for (const EffectParameter& p : kind.parameters) keys.push_back(p.key);
  EXPECT_EQ(keys, (std::vector<std::string>{"axis", "mass_kg"}));
  const MachineModel model = mill(4, 30.0);
  EXPECT_EQ(missingNeed(kind, {model, {"fx", "fy"}}), std::string());
  const std::vector<EffectForm> forms = formsOf(kind, {model, {"fx", "fy"}, {"y", "z"}});
  ASSERT_EQ(forms.size(), 1u);
  EXPECT_EQ(forms.front().variant, "y");
  const Record still = simulated(with(model, {inertiaOf("x")}), moveOfY(2.0, true));
  for (const char* name : {"fx", "fy", "fz"}) EXPECT_EQ(still.column(name)[5000], 0.0);
}

}  // namespace
}  // namespace smartmill::sim
