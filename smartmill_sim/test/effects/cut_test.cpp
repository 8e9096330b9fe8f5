// Effects of geometry, motion, cutting law and structure against their closed forms (catalogue of effects).

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <gtest/gtest.h>

#include "smartmill_core/signal/statistics.h"
#include "smartmill_sim/twin/cutter.h"
#include "smartmill_sim/twin/milling_process.h"

#include "effects_rig.h"

namespace smartmill::sim {
namespace {

using units::PI;
using units::TWO_PI;

// In a slot with a straight edge one tooth of two cuts at a time: Fz = (Kac h + Kae) a, so the chip follows
// from Fz.
double chipOf(double fz, const MachineModel& model, double depth) {
  return (fz / depth - model.cutting->kae) / model.cutting->kac;
}

TEST(Effects, runoutMovesChipFromToothToTooth) {
  const MachineModel model =
      with(mill(3, 0.0), {effectEntry("runout", {{"offset_um", 12.0}, {"angle_deg", 70.0}})});
  const double speed = RATE / 360.0 * TWO_PI, depth = 2e-3, feed = 1e-4;
  const Record record = run(model, slotCut(RATE / 360.0 * 60.0, depth, feed), 0.1);
  const auto radius = [](int j) { return 12e-6 * std::cos(units::radFromDeg(70.0 - 120.0 * (j % 3))); };
  for (int j = 0; j < 3; ++j) {
    // Tooth j, alone in cut, is at 90 degrees; it cuts the surface of tooth j + 1.
    const double angle = units::radFromDeg(90.0 - 120.0 * j + (j > 0 ? 360.0 : 0.0));
    const double chip = chipOf(at(record, "fz", angle, speed), model, depth);
    EXPECT_NEAR(chip, feed + radius(j) - radius(j + 1), 1e-9) << j;
  }
}

TEST(Effects, runoutBeyondTheFeedLeavesTheCutToOneTooth) {
  const MachineModel model =
      with(mill(2, 0.0), {effectEntry("runout", {{"offset_um", 60.0}, {"angle_deg", 0.0}})});
  const Record record = run(model, slotCut(EVEN_RPM, 2e-3, 1e-4), 0.1);
  // Tooth 1 cuts the feed of the whole revolution: its own last pass is the nearest surface.
  EXPECT_NEAR(chipOf(at(record, "fz", 0.5 * PI, EVEN_SPEED), model, 2e-3), 2e-4, 1e-9);
  EXPECT_EQ(at(record, "fz", 1.5 * PI, EVEN_SPEED), 0.0);
}

TEST(Effects, toothRadiusMovesChipFromToothToTooth) {
  const std::vector<double> offsets{-9.0, 4.0, 8.0};  // um; their mean does not act
  const MachineModel model =
      with(mill(3, 0.0), {effectEntry("tooth_radius", {}, {}, {{"offset_um", offsets}})});
  const double speed = RATE / 360.0 * TWO_PI, depth = 2e-3, feed = 1e-4;
  const Record record = run(model, slotCut(RATE / 360.0 * 60.0, depth, feed), 0.1);
  for (std::size_t j = 0; j < 3; ++j) {
    const double angle = units::radFromDeg(90.0 - 120.0 * static_cast<double>(j) + (j > 0 ? 360.0 : 0.0));
    const double chip = chipOf(at(record, "fz", angle, speed), model, depth);
    EXPECT_NEAR(chip, feed + 1e-6 * (offsets[j] - offsets[(j + 1) % 3]), 1e-9) << j;
  }
  // Three teeth: the same as a runout; no record distinguishes them.
  std::vector<double> cosine;
  for (int j = 0; j < 3; ++j) cosine.push_back(7.0 * std::cos(units::radFromDeg(200.0 - 120.0 * j)));
  const EffectEntry runout = effectEntry("runout", {{"offset_um", 7.0}, {"angle_deg", 200.0}}),
                    teeth = effectEntry("tooth_radius", {}, {}, {{"offset_um", cosine}});
  const Record a = run(with(mill(3, 30.0), {runout}), slotCut(EVEN_RPM), 0.1),
               b = run(with(mill(3, 30.0), {teeth}), slotCut(EVEN_RPM), 0.1);
  for (std::size_t i = 0; i < a.size(); i += 97) EXPECT_NEAR(a.column("fx")[i], b.column("fx")[i], 1e-9);
  EXPECT_THROW(run(with(mill(2, 0.0), {teeth}), slotCut(EVEN_RPM), 0.1), std::runtime_error);
}

TEST(Effects, edgeForcesAddToTheMeans) {
  const double depth = 2e-3;
  const Record without = run(mill(4, 30.0), slotCut(EVEN_RPM, depth), 5 * REVOLUTION);
  const Record record =
      run(with(mill(4, 30.0),
               {effectEntry("edge_forces",
                            {{"Kte_n_per_mm", 5.0}, {"Kre_n_per_mm", 7.0}, {"Kae_n_per_mm", 2.0}})}),
          slotCut(EVEN_RPM, depth), 5 * REVOLUTION);
  const auto added = [&](const char* c) { return mean(record.column(c)) - mean(without.column(c)); };
  // Slot: N a Kre / pi and so on (Dunwoody eq. 3.19). 128 samples a tooth leave 1e-4 of the means.
  EXPECT_NEAR(added("fx"), -4 * depth * 7e3 / PI, 0.01);
  EXPECT_NEAR(added("fy"), 4 * depth * 5e3 / PI, 0.01);
  EXPECT_NEAR(added("fz"), 4 * depth * 2e3 / 2.0, 0.01);
  // An omitted key is 0.
  const Record radial_only = run(with(mill(4, 30.0), {effectEntry("edge_forces", {{"Kre_n_per_mm", 7.0}})}),
                                 slotCut(EVEN_RPM, depth), REVOLUTION);
  EXPECT_NEAR(radial_only.column("fz")[100], without.column("fz")[100], 1e-12);
}

TEST(Effects, sizeEffectMakesThinChipsCutHarder) {
  const MachineModel model =
      with(mill(2, 0.0), {effectEntry("size_effect", {{"exponent", 0.3}, {"reference_chip_um", 50.0}})});
  const double depth = 2e-3, feed = 1e-4;
  const Record record = run(model, slotCut(EVEN_RPM, depth, feed), 0.1);
  for (const double angle : {0.125 * PI, 0.25 * PI, 0.5 * PI}) {
    const double h = feed * std::sin(angle);
    const double fz = (200e6 * std::pow(h / 50e-6, -0.3) * h + 3e3) * depth;
    EXPECT_NEAR(at(record, "fz", angle, EVEN_SPEED), fz, 1e-6 * fz);
  }
}

TEST(Effects, chipCoefficientsAddToTheNominal) {
  const MachineModel model =
      with(mill(2, 0.0), {effectEntry("chip_coefficients", {{"Kac_n_per_mm2", -50.0}})});
  const Record record = run(model, slotCut(EVEN_RPM, 2e-3, 1e-4), 0.1);
  EXPECT_NEAR(at(record, "fz", 0.5 * PI, EVEN_SPEED), (150e6 * 1e-4 + 3e3) * 2e-3, 1e-6);
}

// With tables and with the history of passes.
TEST(Effects, edgeBuildupGrowsWithTheChip) {
  MachineModel model = with(mill(2, 0.0), {effectEntry("edge_buildup", {{"chip_um", 30.0}})});
  const auto expected = [](double h) { return (200e6 * h + 3e3 * (1.0 - std::exp(-h / 30e-6))) * 2e-3; };
  const Record record = run(model, slotCut(EVEN_RPM, 2e-3, 1e-4), 0.1);
  for (const double angle : {0.125 * PI, 0.5 * PI})
    EXPECT_NEAR(at(record, "fz", angle, EVEN_SPEED), expected(1e-4 * std::sin(angle)), 1e-6);
  TwinState state;
  state.law.coefficients = *model.cutting;
  EffectSet(model).update({}, state);
  const double speed = 300.0, dt = TWO_PI / speed / 4096.0;
  ToolMotion motion;
  motion.speed = speed;
  motion.velocity[0] = 2e-4 * speed / TWO_PI;
  MillingProcess process(*model.tool, state.law, dt);
  motion.angle = 0.5 * PI;
  process.engage({{0.0, PI, 2e-3}}, motion);
  EXPECT_NEAR(process.step(motion).fz, expected(1e-4), 1e-6);
}

TEST(Effects, toolWearGrowsEveryEdgeForceWithCuttingTime) {
  const MachineModel model = with(mill(2, 0.0), {effectEntry("tool_wear", {{"edge_growth_per_min", 0.5}}),
                                                 effectEntry("edge_forces", {{"Kae_n_per_mm", 2.0}})});
  const Record record = run(model, slotCut(EVEN_RPM, 2e-3, 1e-4), 0.5);
  // 60 s cut before; 24 revolutions and a quarter into the record.
  const double t = 24.25 * REVOLUTION, factor = 1.0 + 0.5 / 60.0 * (60.0 + t);
  const double fz = (200e6 * 1e-4 + 5e3 * factor) * 2e-3;
  EXPECT_NEAR(record.column("fz")[static_cast<std::size_t>(24.25 * 512)], fz, 1e-5 * fz);
}

TEST(Effects, cuttingSpeedScalesTheChipForceOnly) {
  const MachineModel model =
      with(mill(2, 0.0), {effectEntry("cutting_speed", {{"exponent", 0.2}, {"reference_m_per_min", 100.0}})});
  const Record record = run(model, slotCut(EVEN_RPM, 2e-3, 1e-4), 0.1);
  const double v = PI * 0.02 * EVEN_RPM;  // [m/min]
  const double fz = (200e6 * 1e-4 * std::pow(v / 100.0, -0.2) + 3e3) * 2e-3;
  EXPECT_NEAR(at(record, "fz", 0.5 * PI, EVEN_SPEED), fz, 1e-9 * fz);
}

TEST(Effects, unevenPitchDistributesTheFeedByPitch) {
  const EffectEntry pitch = effectEntry("uneven_pitch", {}, {}, {{"pitch_deg", {157.5, 202.5}}});
  const MachineModel model = with(mill(2, 0.0), {pitch});
  const double depth = 2e-3, feed = 1e-4;
  const Record record = run(model, slotCut(EVEN_RPM, depth, feed), 0.1);
  EXPECT_NEAR(chipOf(at(record, "fz", 0.5 * PI, EVEN_SPEED), model, depth), 2 * feed * 157.5 / 360.0, 1e-9);
  // Tooth 2 is 157.5 degrees ahead of tooth 1.
  EXPECT_NEAR(chipOf(at(record, "fz", units::radFromDeg(292.5), EVEN_SPEED), model, depth),
              2 * feed * 202.5 / 360.0, 1e-9);
  EffectEntry wrong = pitch;
  wrong.lists["pitch_deg"] = {100.0, 120.0, 140.0};
  EXPECT_THROW(run(with(mill(2, 0.0), {wrong}), slotCut(EVEN_RPM), 0.1), std::runtime_error);
}

TEST(Effects, helixReplacesThatOfTheTool) {
  const Record record =
      run(with(mill(4, 10.0), {effectEntry("helix", {{"helix_deg", 45.0}})}), slotCut(EVEN_RPM), 0.05);
  const MachineModel other = mill(4, 45.0);
  const MechanisticForce closed(*other.tool, *other.cutting, *slotCut(EVEN_RPM).engagement);
  for (const std::size_t i : {100u, 333u, 500u}) {
    const CuttingForce f = closed.at(record.column("spindle_angle")[i]);
    EXPECT_NEAR(record.column("fx")[i], f.fx, 0.01);
    EXPECT_NEAR(record.column("fz")[i], f.fz, 0.01);
  }
}

// One straight edge of a ball end, engaged over its whole radius: quarter circles in closed form.
TEST(Effects, cornerRadiusTurnsTheForcesOfABallEnd) {
  const MachineModel model = with(mill(2, 0.0), {effectEntry("corner_radius", {{"corner_radius_mm", 10.0}})});
  const double r = 10e-3, c = 1e-4;
  const CuttingCoefficients& k = *model.cutting;
  const Record record = run(model, slotCut(EVEN_RPM, r, c), 0.1);
  const auto indicated = [&](const char* channel) { return at(record, channel, 0.5 * PI, EVEN_SPEED); };
  EXPECT_NEAR(indicated("fy"), k.ktc * c * r + k.kte * r * PI / 2.0, 1e-6);
  EXPECT_NEAR(indicated("fx"), -(k.krc * c * r * PI / 4.0 + k.kre * r - k.kac * c * r / 2.0 - k.kae * r),
              1e-6);
  EXPECT_NEAR(indicated("fz"), k.krc * c * r / 2.0 + k.kre * r + k.kac * c * r * PI / 4.0 + k.kae * r, 1e-6);
}

// A bull-nose mill with helix as a sum over elements of its edge: normal n = (sin kappa, -cos kappa) across
// and along the tool, Fr opposite to n, Fa perpendicular to n.
CuttingForce bullNose(const MachineModel& model, double corner, const CampaignTest& test, double angle,
                      double size_exponent) {
  const CuttingCoefficients& k = *model.cutting;
  const double depth = test.engagement->axial_depth, lag = model.tool->lag();
  CuttingForce sum;
  constexpr int ELEMENTS = 2000;
  for (int i = 0; i < ELEMENTS; ++i) {
    // Finer towards the tip, where the edge per height grows.
    const double t = (i + 0.5) / ELEMENTS, z = depth * t * t, dz = 2.0 * depth * t / ELEMENTS;
    const double up = 1.0 - std::min(z / corner, 1.0);
    const double sine = std::sqrt(1.0 - up * up), length = dz / sine, radius = 0.01 - corner * (1.0 - sine);
    for (int j = 0; j < model.tool->teeth; ++j) {
      const double phi = std::fmod(angle + j * TWO_PI / model.tool->teeth - lag * z + 4.0 * PI, TWO_PI);
      if (phi <= 0.0 || phi >= PI) continue;
      const double h = test.engagement->feed_per_tooth * std::sin(phi) * sine;
      const double chip = h * std::pow(h / 50e-6, -size_exponent);
      const double ft = (k.ktc * chip + k.kte) * length, fr = (k.krc * chip + k.kre) * length,
                   fa = (k.kac * chip + k.kae) * length;
      const double across = fr * sine - fa * up;
      sum.fx += -ft * std::cos(phi) - across * std::sin(phi);
      sum.fy += ft * std::sin(phi) - across * std::cos(phi);
      sum.fz += fr * up + fa * sine;
      sum.torque += ft * radius;
    }
  }
  return sum;
}

TEST(Effects, cornerRadiusIsTheSumOverTheElementsOfTheEdge) {
  for (const auto& [corner, depth, exponent] :
       {std::array<double, 3>{3.0, 5e-3, 0.0}, {3.0, 5e-3, 0.3}, {6.0, 2e-3, 0.0}, {0.0, 2e-3, 0.0}}) {
    MachineModel model = with(mill(3, 35.0), {effectEntry("corner_radius", {{"corner_radius_mm", corner}})});
    if (exponent > 0.0) {
      model.effects.push_back(
          effectEntry("size_effect", {{"exponent", exponent}, {"reference_chip_um", 50.0}}));
    }
    const CampaignTest test = slotCut(EVEN_RPM, depth, 1e-4);
    const Record record = run(model, test, REVOLUTION);
    double most = 0.0, error = 0.0;
    for (std::size_t i = 3; i < record.size(); i += 37) {
      const double angle = record.column("spindle_angle")[i];
      const CuttingForce expected = bullNose(model, std::max(1e-9, 1e-3 * corner), test, angle, exponent);
      most = std::max({most, std::abs(expected.fx), std::abs(expected.fy)});
      error = std::max({error, std::abs(record.column("fx")[i] - expected.fx),
                        std::abs(record.column("fy")[i] - expected.fy),
                        std::abs(record.column("fz")[i] - expected.fz)});
    }
    // Error of twelve slices with a linear lag: largest where an edge enters or exits.
    EXPECT_LT(error, 2.5e-3 * most) << corner << " " << exponent;
  }
}

// Tables and history of passes agree, also for a change of depth within the corner.
TEST(Effects, cornerRadiusIsTheSameWithHistory) {
  MachineModel model = mill(3, 35.0);
  model.tool->edge.corner_radius = 4e-3;
  CuttingLaw law;
  law.coefficients = *model.cutting;
  const double speed = 300.0, dt = TWO_PI / speed / 1024.0;
  Cutter tables(*model.tool, law, dt, {}, 0.0, Cutter::Method::tables),
      history(*model.tool, law, dt, {}, 0.0, Cutter::Method::history);
  ToolMotion motion;
  motion.speed = speed;
  motion.velocity[0] = 3e-4 * speed / TWO_PI;
  tables.engage({{0.0, PI, 1.3e-3}}, motion);
  history.engage({{0.0, PI, 1.3e-3}}, motion);
  double most = 0.0;
  for (int i = 0; i < 3000; ++i) {
    motion.angle = std::fmod(speed * dt * i, TWO_PI);
    motion.centre[0] = 3e-4 * speed * dt * i / TWO_PI;
    if (i == 1100 || i == 2100) {
      const double depth = i == 1100 ? 0.9e-3 : 4.7e-3;
      tables.setDepths({{0.0, PI, depth}});
      history.setDepths({{0.0, PI, depth}});
    }
    const CuttingForce a = tables.step(motion), b = history.step(motion);
    history.endStep({{0.0, 0.0}});
    most = std::max({most, std::abs(a.fx)});
    ASSERT_NEAR(a.fx, b.fx, 1e-4 * most + 1e-9) << i;
    ASSERT_NEAR(a.fz, b.fz, 1e-4 * most + 1e-9) << i;
    ASSERT_NEAR(a.torque, b.torque, 1e-6 * most) << i;
  }
}

TEST(Effects, cornerRadiusIsAtMostTheToolRadius) {
  EXPECT_THROW(run(with(mill(2, 0.0), {effectEntry("corner_radius", {{"corner_radius_mm", 10.5}})}),
                   slotCut(EVEN_RPM), 0.1),
               std::runtime_error);
}

TEST(Effects, feedErrorScalesTheChip) {
  const MachineModel model = with(mill(2, 0.0), {effectEntry("feed_error", {{"ratio", 1.07}})});
  const Record record = run(model, slotCut(EVEN_RPM, 2e-3, 1e-4), 0.1);
  EXPECT_NEAR(chipOf(at(record, "fz", 0.5 * PI, EVEN_SPEED), model, 2e-3), 1.07e-4, 1e-10);
}

TEST(Effects, depthTiltFollowsTheFeedPathFromEngagement) {
  const MachineModel model = with(mill(2, 0.0), {effectEntry("depth_tilt", {{"slope_um_per_mm", -30.0}})});
  CampaignTest test = slotCut(EVEN_RPM, 2e-3, 1e-4);
  test.engage_time = 2.0 * REVOLUTION;
  const Record record = run(model, test, 0.5);
  const auto depthAt = [&](double revolutions) {
    return record.column("fz")[static_cast<std::size_t>(512 * revolutions)] / (200e6 * 1e-4 + 3e3);
  };
  EXPECT_EQ(depthAt(1.25), 0.0);
  // 0.2 mm a revolution from engagement; depth follows every 16 steps of a quarter sample: 1e-4 mm of path.
  EXPECT_NEAR(depthAt(2.25), 2e-3 - 30e-3 * 0.25 * 2e-4, 1e-8);
  EXPECT_NEAR(depthAt(20.25), 2e-3 - 30e-3 * 18.25 * 2e-4, 1e-8);
}

TEST(Effects, thermalGrowthDeepensCutsTowardsItsAsymptote) {
  const MachineModel model =
      with(mill(2, 0.0), {effectEntry("thermal_growth", {{"growth_um", 60.0}, {"time_constant_s", 200.0}})});
  CampaignTest test = slotCut(EVEN_RPM, 2e-3, 1e-4);
  for (const double start : {0.0, 150.0, 1e5}) {
    test.start_time = start;
    const double fz = at(run(model, test, 0.1), "fz", 0.5 * PI, EVEN_SPEED);
    EXPECT_NEAR(fz / (200e6 * 1e-4 + 3e3), 2e-3 + 60e-6 * (1.0 - std::exp(-start / 200.0)), 1e-12) << start;
  }
  test.start_time.reset();
  EXPECT_THROW(run(model, test, 0.1), std::runtime_error);
}

// A flexible tool bends by mean force over stiffness; regeneration does not change the mean chip.
TEST(Effects, toolFlexibilityBendsTheTool) {
  EffectEntry flexible;
  flexible.name = "tool_flexibility";
  flexible.flexibility.y.modes = {{900.0, 0.05, 1.0 / 30e6}};
  CampaignTest test = slotCut(EVEN_RPM, 0.5e-3);
  Record plan;
  for (int i = 0; i < 51200; ++i) plan.time.push_back(i / RATE);
  for (const char* c : {"spindle_angle", "fy", "tool_x", "tool_y"}) plan.add(c).assign(51200, 0.0);
  for (std::size_t i = 0; i < plan.size(); ++i)
    plan.add("spindle_angle")[i] = std::fmod(EVEN_SPEED * plan.time[i], TWO_PI);
  SimulationOptions options;
  options.noise = false;
  const Record record = simulateTest(with(mill(4, 30.0), {flexible}), test, plan, options);
  const auto late = [&](const char* c) {
    const std::vector<double>& all = record.column(c);
    return mean(std::vector<double>(all.end() - 512 * 40, all.end()));
  };
  const double fy = 4 * 0.5e-3 * (1e-4 * 800e6 / 4.0 + 20e3 / PI);
  EXPECT_NEAR(late("fy"), fy, 2e-3 * fy);
  EXPECT_NEAR(late("tool_y"), fy / 30e6, 2e-3 * fy / 30e6);
  EXPECT_EQ(late("tool_x"), 0.0);
}

// Tip that moves into the work at v: radial C v / v_c per length of edge, tangential 0.3 of it.
TEST(Effects, processDampingOpposesTheMotionIntoTheWork) {
  const MachineModel model =
      with(mill(1, 0.0), {effectEntry("process_damping", {{"coefficient_n_per_mm", 120.0}})});
  TwinState damped;
  damped.law.coefficients = *model.cutting;
  CuttingLaw plain = damped.law;
  EffectSet(model).update({}, damped);
  const double dt = 1e-5, speed = 300.0, depth = 2e-3, v = 4e-3;
  // The tooth approaches 90 degrees, x is into the work.
  const auto forceOf = [&](const CuttingLaw& law) {
    MillingProcess process(*model.tool, law, dt);
    ToolMotion motion;
    motion.speed = speed;
    motion.velocity[0] = 1e-4 * speed / TWO_PI;
    motion.angle = 0.5 * PI - speed * dt;
    process.engage({{0.0, PI, depth}}, motion);
    process.step(motion);
    process.endStep({{0.0, 0.0}});
    motion.angle = 0.5 * PI;
    motion.displacement[0] = v * dt;
    motion.rate[0] = v;
    return process.step(motion);
  };
  const CuttingForce a = forceOf(damped.law), b = forceOf(plain);
  const double force = 120e3 * v / (speed * 0.01) * depth;
  EXPECT_NEAR(a.fx - b.fx, -force, 1e-6 * force);
  EXPECT_NEAR(a.fy - b.fy, 0.3 * force, 1e-6 * force);
  EXPECT_EQ(a.fz, b.fz);
}

}  // namespace
}  // namespace smartmill::sim
