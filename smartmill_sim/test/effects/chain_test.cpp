// Effects of sensor, spindle and measuring chain against their closed forms (catalogue of effects).

#include <algorithm>
#include <cmath>
#include <complex>
#include <set>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_sim/twin/cutting_machine.h"

#include "effects_rig.h"

namespace smartmill::sim {
namespace {

using units::PI;
using units::TWO_PI;

MachineModel sensorMill() {
  MachineModel model = mill(4, 30.0);
  model.force_sensor.axis[0].modes = {{1000.0, 0.03, 0.9}};
  model.force_sensor.axis[0].direct = 0.1;
  model.force_sensor.axis[2].modes = {{2000.0, 0.02, 0.95}};
  model.force_sensor.axis[2].direct = 0.05;
  return model;
}

/// Measured over applied force at a frequency, from a long sine on the sensor while the spindle turns in air.
std::complex<double> sensorResponse(const MachineModel& model, std::size_t axis, double frequency,
                                    double speed) {
  const double dt = 1.0 / 204800.0;
  CuttingMachine machine(model, dt);
  CuttingMachine::Input input;
  input.motion.speed = speed;
  std::complex<double> sum;
  const int period = static_cast<int>(std::lround(1.0 / (frequency * dt))), settle = 400 * period;
  for (int i = 0; i < settle + 100 * period; ++i) {
    const double a = TWO_PI * i / period;
    input.sensor_force[axis] = std::cos(a);
    const double indicated = machine.step(input).sensor[axis];
    if (i >= settle) sum += indicated * std::polar(1.0, -a);
  }
  return sum * (2.0 / (100.0 * period));
}

void expectResponse(const MachineModel& model, std::size_t axis, const ModalModel& expected, double speed) {
  for (const double frequency : {800.0, 1024.0, 1600.0}) {
    const std::complex<double> measured = sensorResponse(model, axis, frequency, speed);
    EXPECT_NEAR(std::abs(measured - expected.response(frequency)), 0.0,
                3e-3 * std::abs(expected.response(frequency)))
        << frequency;
  }
}

TEST(Effects, extraModeTakesItsGainFromTheDirectShare) {
  const MachineModel model =
      with(sensorMill(),
           {effectEntry("extra_mode", {{"frequency_hz", 1640.0}, {"damping_ratio", 0.04}, {"gain", 0.06}},
                        {{"axis", "x"}})});
  ModalModel expected = sensorMill().force_sensor.axis[0];
  expected.modes.push_back({1640.0, 0.04, 0.06});
  expected.direct = 0.04;
  EXPECT_NEAR(expected.staticGain(), 1.0, 1e-12);
  expectResponse(model, 0, expected, 0.0);
}

TEST(Effects, massLoadingLowersTheFirstModes) {
  const MachineModel model = with(sensorMill(), {effectEntry("mass_loading", {{"mass_ratio", 0.21}})});
  ModalModel expected = sensorMill().force_sensor.axis[0];
  expected.modes[0].frequency /= 1.1;
  expectResponse(model, 0, expected, 0.0);
  expected = sensorMill().force_sensor.axis[2];
  expected.modes[0].frequency /= 1.1;
  expectResponse(model, 2, expected, 0.0);
}

TEST(Effects, speedDependentModeFallsLinearlyWithSpeed) {
  const MachineModel model =
      with(sensorMill(), {effectEntry("speed_dependent_mode", {{"softening_per_krpm", 0.01}})});
  ModalModel expected = sensorMill().force_sensor.axis[0];
  expectResponse(model, 0, expected, 0.0);
  expected.modes[0].frequency *= 0.88;
  expectResponse(model, 0, expected, units::radPerSecFromRpm(12000.0));
}

TEST(Effects, unbalanceTurnsWithTheSpindleOnTheSensorOnly) {
  MachineModel model = with(
      mill(4, 30.0), {effectEntry("unbalance", {{"mass_eccentricity_g_mm", 12.0}, {"angle_deg", 30.0}})});
  model.tool_tip.x.modes = {{900.0, 0.05, 1.0 / 30e6}};
  CampaignTest test = airCut(EVEN_RPM);
  Record plan;
  for (int i = 0; i < 2000; ++i) plan.time.push_back(i / RATE);
  for (const char* c : {"fx", "fy", "fz", "tool_x"}) plan.add(c).assign(2000, 0.0);
  SimulationOptions options;
  options.noise = false;
  options.phase = 0.4;
  const Record record = simulateTest(model, test, plan, options);
  const double size = 12e-6 * EVEN_SPEED * EVEN_SPEED;
  for (const std::size_t i : {77u, 777u, 1777u}) {
    const double a = 0.4 + EVEN_SPEED * record.time[i] + units::radFromDeg(30.0);
    EXPECT_NEAR(record.column("fx")[i], size * std::sin(a), 1e-9);
    EXPECT_NEAR(record.column("fy")[i], size * std::cos(a), 1e-9);
    EXPECT_EQ(record.column("fz")[i], 0.0);
    EXPECT_EQ(record.column("tool_x")[i], 0.0);
  }
}

double steadyVoltage(double torque, double speed) {
  return 4e-4 * torque * speed;
}

TEST(Effects, stribeckFrictionFadesWithSpeed) {
  const MachineModel model =
      with(mill(4, 30.0), {effectEntry("stribeck_friction", {{"breakaway_nm", 0.4}, {"speed_rpm", 2500.0}})});
  for (const double rpm : {1000.0, 2500.0, 9000.0}) {
    const double speed = units::radPerSecFromRpm(rpm);
    const double torque = 4e-4 * speed + 0.05 + 0.4 * std::exp(-std::pow(rpm / 2500.0, 2));
    const Record record = run(model, airCut(rpm), 0.1);
    EXPECT_NEAR(record.column("load_meter").front(), steadyVoltage(torque, speed), 1e-12);
    EXPECT_NEAR(record.column("load_meter").back(), steadyVoltage(torque, speed), 1e-12);
  }
}

TEST(Effects, frictionWarmupMultipliesAllFriction) {
  const MachineModel model =
      with(mill(4, 30.0), {effectEntry("friction_warmup", {{"cold_ratio", 0.5}, {"time_constant_s", 200.0}}),
                           effectEntry("stribeck_friction", {{"breakaway_nm", 0.4}, {"speed_rpm", 2500.0}})});
  const double speed = units::radPerSecFromRpm(2500.0);
  const double torque = (4e-4 * speed + 0.05 + 0.4 * std::exp(-1.0)) * (1.0 + 0.5 * std::exp(-0.5));
  EXPECT_NEAR(run(model, airCut(2500.0), 0.1).column("load_meter").back(), steadyVoltage(torque, speed),
              1e-12);
  CampaignTest timeless = airCut(2500.0);
  timeless.start_time.reset();
  EXPECT_THROW(run(model, timeless, 0.1), Error);
}

TEST(Effects, loadMeterLagIsTheMetersBandwidth) {
  const MachineModel model = with(mill(4, 30.0), {effectEntry("load_meter_lag", {{"bandwidth_hz", 3.0}})});
  CampaignTest test = slotCut(EVEN_RPM);
  test.engage_time = 0.1;
  const std::vector<double> v = run(model, test, 1.5).column("load_meter");
  // 63.2 % of the step after 1 / (2 pi f); the ripple of the teeth through 3 Hz stays below 1 %.
  const auto i = static_cast<std::size_t>(std::lround((0.1 + 1.0 / (TWO_PI * 3.0)) * RATE));
  EXPECT_NEAR((v[i] - v[0]) / (v.back() - v[0]), 1.0 - std::exp(-1.0), 0.01);
}

TEST(Effects, crossTalkAddsSharesOfTheOtherAxes) {
  const Record pure = run(sensorMill(), slotCut(EVEN_RPM), 0.05);
  const Record record =
      run(with(sensorMill(),
               {effectEntry("cross_talk",
                            {{"xy", 0.05}, {"xz", -0.02}, {"yx", 0.04}, {"zx", 0.03}, {"zy", -0.01}})}),
          slotCut(EVEN_RPM), 0.05);
  for (const std::size_t i : {50u, 500u, 1111u}) {
    const double x = pure.column("fx")[i], y = pure.column("fy")[i], z = pure.column("fz")[i];
    EXPECT_NEAR(record.column("fx")[i], x + 0.05 * y - 0.02 * z, 1e-9);
    EXPECT_NEAR(record.column("fy")[i], y + 0.04 * x, 1e-9);
    EXPECT_NEAR(record.column("fz")[i], z + 0.03 * x - 0.01 * y, 1e-9);
  }
}

TEST(Effects, gainErrorIsOfOneChannel) {
  const Record pure = run(sensorMill(), slotCut(EVEN_RPM), 0.05);
  const Record record =
      run(with(sensorMill(), {effectEntry("gain_error", {{"gain", 1.08}}, {{"channel", "fy"}}),
                              effectEntry("gain_error", {{"gain", 0.9}}, {{"channel", "load_meter"}})}),
          slotCut(EVEN_RPM), 0.05);
  EXPECT_NEAR(record.column("fy")[777], 1.08 * pure.column("fy")[777], 1e-9);
  EXPECT_NEAR(record.column("load_meter")[777], 0.9 * pure.column("load_meter")[777], 1e-12);
  EXPECT_EQ(record.column("fx")[777], pure.column("fx")[777]);
}

TEST(Effects, channelDelayShiftsTheChannel) {
  // Delays of two samples and of a fraction of a sample.
  const Record pure = run(sensorMill(), slotCut(EVEN_RPM), 0.05);
  const Record late =
      run(with(sensorMill(), {effectEntry("channel_delay", {{"delay_us", 2e6 / RATE}}, {{"channel", "fx"}})}),
          slotCut(EVEN_RPM), 0.05);
  EXPECT_NEAR(late.column("fx")[777], pure.column("fx")[775], 1e-9);
  EXPECT_EQ(late.column("fx")[1], 0.0);
  EXPECT_EQ(late.column("fy")[777], pure.column("fy")[777]);
  const Record turning = run(
      with(mill(4, 30.0), {effectEntry("unbalance", {{"mass_eccentricity_g_mm", 10.0}, {"angle_deg", 0.0}}),
                           effectEntry("channel_delay", {{"delay_us", 73.0}}, {{"channel", "fx"}})}),
      airCut(EVEN_RPM), 0.05);
  const double size = 10e-6 * EVEN_SPEED * EVEN_SPEED;
  EXPECT_NEAR(turning.column("fx")[800], size * std::sin(EVEN_SPEED * (800 / RATE - 73e-6)), 1e-5 * size);
}

TEST(Effects, chargeDriftRisesFromTheStartOfEachRecord) {
  const Record record =
      run(with(mill(4, 30.0), {effectEntry("charge_drift", {{"rate_n_per_min", 300.0}, {"y_ratio", -0.4}})}),
          airCut(3000.0), 0.2);
  EXPECT_NEAR(record.column("fx")[2560], 0.5, 1e-9);
  EXPECT_NEAR(record.column("fy")[2560], -0.2, 1e-9);
  EXPECT_EQ(record.column("fz")[2560], 0.0);
}

TEST(Effects, mainsHumHasItsOwnPhaseEachRecord) {
  const MachineModel model =
      with(mill(4, 30.0),
           {effectEntry("mains_hum", {{"frequency_hz", 50.0}, {"amplitude_n", 4.0}, {"y_ratio", 0.5}}),
            effectEntry("saturation", {{"limit_n", 300.0}})});
  SimulationOptions options;
  options.noise = false;
  options.phase = 0.3;
  std::set<double> first;
  for (options.seed = 1; options.seed < 6; ++options.seed) {
    const Record air = simulateTest(model, airCut(3000.0), 0.2, options);
    first.insert(air.column("fx")[0]);
    const double s = air.column("fx")[64], c = air.column("fx")[192];  // a quarter of a period apart
    EXPECT_NEAR(std::hypot(s, c), 4.0, 1e-9);
    EXPECT_NEAR(air.column("fy")[64], 0.5 * s, 1e-12);
    EXPECT_EQ(air.column("fz")[64], 0.0);
    // Given the record, the twin estimates its phase: in air and in a cut that clips.
    for (const CampaignTest& test : {airCut(3000.0), slotCut(4200.0, 2e-3)}) {
      const Record recorded = simulateTest(model, test, 0.2, options);
      const Record again = simulateTest(model, test, recorded, options);
      for (const std::size_t i : {1000u, 3333u})
        EXPECT_NEAR(again.column("fx")[i], recorded.column("fx")[i], 1e-6);
    }
  }
  EXPECT_EQ(first.size(), 5u);
}

TEST(Effects, saturationClipsTheForces) {
  const Record pure = run(sensorMill(), slotCut(EVEN_RPM), 0.1);
  const Record record =
      run(with(sensorMill(), {effectEntry("saturation", {{"limit_n", 150.0}})}), slotCut(EVEN_RPM), 0.1);
  bool clipped = false;
  for (std::size_t i = 0; i < record.size(); ++i) {
    for (const char* c : {"fx", "fy", "fz"})
      ASSERT_EQ(record.column(c)[i], std::clamp(pure.column(c)[i], -150.0, 150.0));
    clipped = clipped || std::abs(pure.column("fy")[i]) > 150.0;
  }
  EXPECT_TRUE(clipped);
  // The lower of two limits applies; no other channel has a limit.
  const ChannelValues limits =
      EffectSet(with(mill(4, 30.0), {effectEntry("saturation", {{"limit_n", 150.0}}),
                                     effectEntry("saturation", {{"limit_n", 120.0}})}))
          .limits();
  for (const std::size_t c : {FX, FY, FZ}) EXPECT_EQ(limits[c], 120.0);
  for (const std::size_t c : {LOAD_METER, TOOL_X, ACCELERATION}) EXPECT_TRUE(std::isinf(limits[c]));
}

TEST(Effects, spindleOrderIsLockedToTheSpindle) {
  const EffectEntry entry = effectEntry(
      "spindle_order", {{"order", 2.5}, {"x_n", 4.0}, {"z_n", 1.5}, {"x_deg", 20.0}, {"z_deg", -90.0}});
  const MachineModel model = with(mill(4, 30.0), {entry});
  const Record record = run(model, airCut(EVEN_RPM), 0.1, 0.2);
  for (const std::size_t i : {3u, 400u}) {
    const double a = 2.5 * (0.2 + EVEN_SPEED * record.time[i]);
    EXPECT_NEAR(record.column("fx")[i], 4.0 * std::sin(a + units::radFromDeg(20.0)), 1e-9);
    EXPECT_EQ(record.column("fy")[i], 0.0);
    EXPECT_NEAR(record.column("fz")[i], -1.5 * std::cos(a), 1e-9);
  }
}

// A force on the sensor: each channel has the size and lag of the sensor's response at the tone's frequency.
TEST(Effects, bearingTonePassesTheSensorWithItsOwnPhaseEachRecord) {
  MachineModel model = mill(4, 30.0);
  for (ModalModel& axis : model.force_sensor.axis) {
    axis.modes = {{1000.0, 0.05, 1.0}};
    axis.direct = 0.0;
  }
  model.force_sensor.axis[1].modes = {{700.0, 0.05, 1.0}};
  const double order = 5.4, rpm = 9000.0, f = order * rpm / 60.0;  // 810 Hz, between the modes
  model = with(model, {effectEntry("bearing_tone", {{"order", order}, {"x_n", 4.0}, {"y_n", -2.0}})});
  const auto factor = [&](double mode) {  // of a mode with unit gain, and its lag
    const std::complex<double> h =
        1.0 / std::complex<double>(1.0 - f * f / mode / mode, 2.0 * 0.05 * f / mode);
    return std::pair(std::abs(h), std::arg(h));
  };
  SimulationOptions options;
  options.noise = false;
  std::set<double> first;
  for (options.seed = 1; options.seed < 4; ++options.seed) {
    const Record air = simulateTest(model, airCut(rpm), 0.2, options);
    first.insert(air.column("fx")[0]);
    // Complex amplitude over 162 periods of the record of 0.2 s.
    const auto amplitude = [&](const char* name) {
      std::complex<double> sum = 0.0;
      for (std::size_t i = 0; i < air.size(); ++i)
        sum += air.column(name)[i] * std::polar(1.0, -units::TWO_PI * f * air.time[i]);
      return 2.0 / static_cast<double>(air.size()) * sum;
    };
    const auto [x_factor, x_lag] = factor(1000.0);
    const auto [y_factor, y_lag] = factor(700.0);
    EXPECT_NEAR(std::abs(amplitude("fx")), 4.0 * x_factor, 0.01 * 4.0 * x_factor);
    EXPECT_NEAR(std::abs(amplitude("fy")), 2.0 * y_factor, 0.01 * 2.0 * y_factor);
    EXPECT_NEAR(std::remainder(std::arg(-amplitude("fy") / amplitude("fx")) - (y_lag - x_lag), units::TWO_PI),
                0.0, 0.01);
    EXPECT_EQ(air.column("fz")[64], 0.0);
    const Record again = simulateTest(model, airCut(rpm), air, options);
    for (const std::size_t i : {1000u, 3333u}) EXPECT_NEAR(again.column("fx")[i], air.column("fx")[i], 1e-6);
  }
  EXPECT_EQ(first.size(), 3u);
}

TEST(Effects, zeroOffsetIsOnEverySample) {
  const Record record = run(with(mill(4, 30.0), {effectEntry("zero_offset", {{"x_n", 2.5}, {"z_n", -1.0}})}),
                            airCut(3000.0), 0.1);
  EXPECT_EQ(record.column("fx")[0], 2.5);
  EXPECT_EQ(record.column("fy")[99], 0.0);
  EXPECT_EQ(record.column("fz")[2000], -1.0);
}

// Drawn values are valid for the effect.
TEST(Effects, everyDrawnEntryMakesAnEffect) {
  EffectKind::Random random(5);
  for (const EffectKind& kind : effectCatalogue())
    EXPECT_NO_THROW(makeEffect(drawEffect(kind.name, sensorMill(), random))) << kind.name;
}

// At the null coordinates of a fit an effect changes nothing.
TEST(Effects, nullValuesChangeNothing) {
  const MachineModel model = sensorMill();
  EffectScope scope{model, {"fx", "fy", "fz", "load_meter"}, {"x", "y", "z"}};
  scope.largest_force = 1000.0;
  const Record pure = run(model, slotCut(4200.0), 0.03);
  for (const EffectKind& kind : effectCatalogue()) {
    for (const EffectForm& form : formsOf(kind, scope)) {
      EffectForm::Values null;
      for (const Coordinate& c : form.coordinates) null.push_back(c.null);
      const Record record = run(with(model, {form.entry(null)}), slotCut(4200.0), 0.03);
      for (const char* c : {"fx", "fy", "fz", "load_meter"})
        EXPECT_NEAR(record.column(c)[700], pure.column(c)[700], 1e-9) << form.title() << " " << c;
    }
  }
}

TEST(Effects, orderInTheListDoesNotMatter) {
  std::vector<EffectEntry> effects{effectEntry("saturation", {{"limit_n", 200.0}}),
                                   effectEntry("charge_drift", {{"rate_n_per_min", 900.0}, {"y_ratio", 0.3}}),
                                   effectEntry("gain_error", {{"gain", 1.1}}, {{"channel", "fx"}}),
                                   effectEntry("cross_talk", {{"yx", 0.1}}),
                                   effectEntry("tool_wear", {{"edge_growth_per_min", 1.0}}),
                                   effectEntry("edge_forces", {{"Kte_n_per_mm", 5.0}})};
  const Record forward = run(with(sensorMill(), effects), slotCut(4200.0), 0.05);
  std::reverse(effects.begin(), effects.end());
  const Record backward = run(with(sensorMill(), effects), slotCut(4200.0), 0.05);
  for (const char* c : {"fx", "fy", "fz"}) EXPECT_EQ(forward.column(c), backward.column(c)) << c;
}

TEST(Effects, entriesAreChecked) {
  MachineModel model = mill(4, 30.0);
  model.effects.push_back({});
  model.effects[0].name = "runout";
  EXPECT_THROW(run(model, slotCut(3000.0), 0.1), Error);
}

}  // namespace
}  // namespace smartmill::sim
