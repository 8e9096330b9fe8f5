// Forces against closed forms of Altintas (Manufacturing Automation, eq. 2.27..2.29) and symmetries of the
// limits.

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/testing/mill.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_program/nc/program_reader.h"
#include "smartmill_program/prediction/tip_deflection.h"
#include "smartmill_program/prediction/wall_errors.h"
#include "smartmill_program/program_analysis.h"
#include "smartmill_stability/chart/surface_error.h"
#include "smartmill_stability/solvers/model_system.h"

namespace smartmill::program {
namespace {

using units::MM;
using units::PI;

constexpr double SPEED = 2 * PI * 50.0;  // [rad/s] 3000 rpm

Contact contactOf(double entry_deg, double exit_deg, double depth) {
  return {{{units::radFromDeg(entry_deg), units::radFromDeg(exit_deg), 0.0, depth, 5 * MM}}, 0.0, 0.0};
}

// A slot with N teeth: Fx = -N a (Krc c / 4 + Kre / pi), Fy = N a (Ktc c / 4 + Kte / pi) on the tool, Fz = N
// a (Kac c / pi + Kae / 2), torque N a R (Ktc c / pi + Kte / 2).
TEST(ForcePredictor, MeanForceOfASlot) {
  const MachineModel model = mill(4);
  const CuttingCoefficients& k = *model.cutting;
  const double a = 2 * MM, c = 0.05 * MM;
  ForcePredictor predictor(*model.tool, k);
  const CuttingForce mean = predictor.predict(contactOf(0, 180, a), c).mean;
  EXPECT_NEAR(mean.fx, -4 * a * (k.krc * c / 4 + k.kre / PI), 1e-9);
  EXPECT_NEAR(mean.fy, 4 * a * (k.ktc * c / 4 + k.kte / PI), 1e-9);
  EXPECT_NEAR(mean.fz, 4 * a * (k.kac * c / PI + k.kae / 2), 1e-9);
  EXPECT_NEAR(mean.torque, 4 * a * model.tool->radius() * (k.ktc * c / PI + k.kte / 2), 1e-9);
}

// One tooth without helix: the peak torque is at phi = 90 deg, R a (Ktc c + Kte).
TEST(ForcePredictor, PeakOfOneStraightTooth) {
  const MachineModel model = mill(1, 0.0);
  const CuttingCoefficients& k = *model.cutting;
  const double a = 2 * MM, c = 0.05 * MM;
  ForcePredictor predictor(*model.tool, k);
  const ForcePrediction& slot = predictor.predict(contactOf(0, 180, a), c);
  EXPECT_NEAR(slot.peak_torque, model.tool->radius() * a * (k.ktc * c + k.kte), 2e-3 * slot.peak_torque);
  EXPECT_NEAR(slot.peak_force, a * std::hypot(k.ktc * c + k.kte, k.krc * c + k.kre), 2e-3 * slot.peak_force);
  // A narrow cut ends below that: sin(30 deg).
  const ForcePrediction& narrow = predictor.predict(contactOf(0, 30, a), c);
  EXPECT_NEAR(narrow.peak_torque, model.tool->radius() * a * (k.ktc * c * 0.5 + k.kte),
              1e-6 * narrow.peak_torque);
}

// With a helix, the peak of a narrow cut of down-milling is where the tip or the top of an edge enters: finer
// sampling of the same model finds no more than 0.02 %.
TEST(ForcePredictor, PeakOfNarrowCuts) {
  const MachineModel model = mill(4);
  for (const double width : {1.0, 3.0, 7.0, 20.0, 60.0})
    for (const bool up : {true, false}) {
      const Contact contact = up ? contactOf(0, width, 0.7 * MM) : contactOf(180 - width, 180, 0.7 * MM);
      ForcePredictor predictor(*model.tool, *model.cutting);
      const double peak = predictor.predict(contact, 0.1 * MM).peak_force;
      const EngagedArc& arc = contact.arcs[0];
      const MechanisticForce force(*model.tool, *model.cutting, {arc.entry, arc.exit, arc.top, 0.1 * MM});
      double finest = 0.0;
      for (int k = 0; k < 90000; ++k) {
        const CuttingForce f = force.at(0.5 * PI * k / 90000);
        finest = std::max(finest, std::hypot(f.fx, f.fy));
      }
      EXPECT_NEAR(peak, finest, 2e-4 * finest) << width;
    }
}

// Two arcs of the same depth that touch are one.
TEST(ForcePredictor, ArcsAdd) {
  const MachineModel model = mill(4);
  ForcePredictor one(*model.tool, *model.cutting), two(*model.tool, *model.cutting);
  Contact split = contactOf(20, 70, 2 * MM);
  split.arcs.push_back(contactOf(70, 150, 2 * MM).arcs[0]);
  const ForcePrediction& whole = one.predict(contactOf(20, 150, 2 * MM), 0.05 * MM);
  const ForcePrediction& parts = two.predict(split, 0.05 * MM);
  EXPECT_NEAR(parts.mean.fy, whole.mean.fy, 1e-9);
  EXPECT_NEAR(parts.peak_force, whole.peak_force, 1e-9);
}

ModalModel modes(double frequency, double stiffness) {
  ModalModel model;
  model.modes.push_back({});
  model.modes.back().frequency = frequency;
  model.modes.back().damping_ratio = 0.03;
  model.modes.back().gain = 1.0 / stiffness;
  return model;
}

// A stiff tool follows the force: its compliance times the peak force. Four straight teeth in a slot without
// edge forces exert a constant force, whatever the mode is: a c |K| / 2 each of two.
TEST(TipDeflection, OfAStiffToolAndOfAConstantForce) {
  MachineModel stiff = mill(4, 30.0);
  stiff.tool_tip.x = stiff.tool_tip.y = modes(60000.0, 1e8);
  const Contact contact = contactOf(60, 180, 2 * MM);
  ForcePredictor forces(*stiff.tool, *stiff.cutting);
  const double peak = forces.predict(contact, 0.1 * MM).peak_force;
  TipDeflection deflection(stiff);
  ASSERT_TRUE(deflection.available());
  EXPECT_NEAR(deflection.largest(forces, contact, EngagementCell::of(contact, 0.0, false), SPEED, 0.1 * MM),
              peak / 1e8, 0.02 * peak / 1e8);

  MachineModel flexible = mill(4, 0.0);
  flexible.cutting->kte = flexible.cutting->kre = 0.0;
  flexible.tool_tip.x = flexible.tool_tip.y = modes(400.0, 2e7);  // the second harmonic of the teeth
  const Contact slot = contactOf(0, 180, 1 * MM);
  ForcePredictor constant(*flexible.tool, *flexible.cutting);
  const double force = 1 * MM * 0.1 * MM * std::hypot(flexible.cutting->ktc, flexible.cutting->krc);
  EXPECT_NEAR(
      TipDeflection(flexible).largest(constant, slot, EngagementCell::of(slot, 0.0, false), SPEED, 0.1 * MM),
      force / 2e7, 0.02 * force / 2e7);
  EXPECT_FALSE(TipDeflection(mill(4)).available());
}

// The equation of motion of a mode in x, integrated in time until it is steady.
TEST(TipDeflection, IsThatOfTheEquationOfMotion) {
  for (const double frequency : {205.0, 430.0, 900.0}) {
    for (const std::vector<double>& pitch :
         {std::vector<double>{}, std::vector<double>{1.5, 1.6, 1.5, 2 * PI - 4.6}}) {
      MachineModel model = mill(4, 20.0);
      model.tool->pitch = pitch;
      model.tool_tip.x = modes(frequency, 2e7);
      const Contact contact = contactOf(90, 180, 2 * MM);
      ForcePredictor forces(*model.tool, *model.cutting);
      const double predicted = TipDeflection(model).largest(
          forces, contact, EngagementCell::of(contact, 0.0, false), SPEED, 0.1 * MM);
      const MechanisticForce force(*model.tool, *model.cutting, {0.5 * PI, PI, 2 * MM, 0.1 * MM});
      const double w = 2 * PI * frequency, dt = 2 * PI / SPEED / 4000, damping = 2 * 0.03 * w;
      std::vector<double> of_turn;
      for (int i = 0; i < 4000; ++i) of_turn.push_back(force.at(2 * PI * i / 4000).fx * w * w / 2e7);
      double x = 0.0, v = 0.0, largest = 0.0;
      constexpr int TURNS = 60;
      for (int i = 0; i < 4000 * TURNS; ++i) {  // midpoint rule, symplectic
        const double pull = of_turn[static_cast<std::size_t>(i % 4000)];
        v += 0.5 * dt * (pull - w * w * x - damping * v);
        x += dt * v;
        v += 0.5 * dt * (of_turn[static_cast<std::size_t>((i + 1) % 4000)] - w * w * x - damping * v);
        if (i >= 4000 * (TURNS - 1)) largest = std::max(largest, std::abs(x));
      }
      EXPECT_NEAR(predicted, largest, 0.01 * largest) << frequency << (pitch.empty() ? "" : " uneven");
    }
  }
}

TEST(StabilityLimits, IsotropicToolHasOneLimitInAllDirections) {
  MachineModel model = mill(4);
  model.tool_tip.x = model.tool_tip.y = modes(900.0, 2e7);
  StabilityLimits limits(model);
  ASSERT_TRUE(limits.available());
  const Contact contact = contactOf(90, 180, 2 * MM);
  const double along_x = limits.limit(contact, 0.0, false, SPEED);
  EXPECT_GT(along_x, 0.05 * MM);
  EXPECT_LT(along_x, 50 * MM);
  for (const double deg : {30.0, 90.0, 135.0})
    EXPECT_NEAR(limits.limit(contact, units::radFromDeg(deg), false, SPEED), along_x,
                3e-3 * along_x);  // tolerance of the solver
  EXPECT_EQ(limits.computed(), 4u);
  EXPECT_EQ(limits.limit(contact, units::radFromDeg(181.0), false, SPEED), along_x);
  EXPECT_EQ(limits.computed(), 4u);
  // A left-hand tool in the mirrored frame sees the same isotropic dynamics.
  EXPECT_NEAR(limits.limit(contact, 0.0, true, SPEED), along_x, 3e-3 * along_x);
}

// Feed along y with a flexible x is feed along x with a flexible y.
TEST(StabilityLimits, DynamicsTurnWithTheFeed) {
  MachineModel x = mill(4), y = mill(4);
  x.tool_tip.x = modes(900.0, 2e7);
  y.tool_tip.y = modes(900.0, 2e7);
  StabilityLimits of_x(x), of_y(y);
  const Contact contact = contactOf(90, 180, 2 * MM);
  const double limit = of_y.limit(contact, 0.0, false, SPEED);
  EXPECT_NEAR(of_x.limit(contact, PI / 2, false, SPEED), limit, 3e-3 * limit);
  EXPECT_GT(std::abs(of_x.limit(contact, 0.0, false, SPEED) / limit - 1.0), 0.05);
}

// A finishing pass along y with a flexible x has the wall of one along x with a flexible y, that of the
// solver at the speed, depth and feed themselves.
TEST(WallErrors, AreThoseOfThePassInItsFeedFrame) {
  MachineModel x = mill(4), y = mill(4);
  x.tool_tip.x = modes(900.0, 2e7);
  y.tool_tip.y = modes(900.0, 2e7);
  WallErrors of_x(x), of_y(y);
  ASSERT_TRUE(of_y.available());
  const Contact down = contactOf(160, 180, 3 * MM), up = contactOf(0, 20, 3 * MM);
  for (const Contact& contact : {down, up}) {
    const double error = of_y.error(contact, 0.0, false, SPEED, 0.05 * MM);
    EXPECT_NEAR(of_x.error(contact, PI / 2, false, SPEED, 0.05 * MM), error, 1e-9 * std::abs(error));
    stability::RegenerativeSystem system =
        stability::systemOf(y, units::degFromRad(contact.entry()), units::degFromRad(contact.exit()));
    system.chip = stability::finishingChip(y, 0.05 * MM);
    const double exact = stability::WallPrediction(system).at(SPEED, 3 * MM).error;
    EXPECT_GT(std::abs(exact), 0.1e-6);
    EXPECT_NEAR(error, exact, 0.04 * std::abs(exact));  // depth and feed are rounded to 2 %
  }
  EXPECT_TRUE(std::isnan(of_y.error(contactOf(0, 180, 3 * MM), 0.0, false, SPEED, 0.05 * MM)));   // two walls
  EXPECT_TRUE(std::isnan(of_y.error(contactOf(40, 120, 3 * MM), 0.0, false, SPEED, 0.05 * MM)));  // none
  EXPECT_FALSE(WallErrors(mill(4)).available());
}

// A ball end in a slot of small depth: the force of its edges up to the depth.
TEST(ProgramAnalysis, ForceOfABallIsThatOfItsEdge) {
  const TemporaryFolder folder;
  const std::string model = folder.write("ball.yaml",
                                         "format: smartmill-model/1\ntool: {teeth: 2, diameter_mm: 10.0, "
                                         "helix_deg: 30.0, corner_radius_mm: 5.0}\n"
                                         "cutting:\n  Ktc_n_per_mm2: 800.0\n  Krc_n_per_mm2: 300.0\n  "
                                         "Kac_n_per_mm2: 200.0\n  Kte_n_per_mm: 20.0\n  "
                                         "Kre_n_per_mm: 25.0\n  Kae_n_per_mm: 3.0\n");
  ToolModels models({model});
  Stock stock(StockBlock{{0, 0, -10 * MM}, {60 * MM, 40 * MM, 0}}, 0.1 * MM);
  ProgramAnalysis analysis("part.nc", models, stock);
  ForcePrediction middle;
  analysis.run(interpretProgram("G21 G90 G0 X-10 Y20 Z-1\nS3000 M3\nG1 X70 F600\nG0 Z5\nM30\n", "part.nc"),
               [&](const Step& step, const StepPrediction& prediction) {
                 if (step.tip[0] > 29 * MM && step.tip[0] < 31 * MM) middle = prediction.force;
               });
  const MachineModel ball = readMachineModel(model);
  const CuttingForce mean = MechanisticForce(*ball.tool, *ball.cutting, {0.0, PI, 1 * MM, 0.1 * MM}).mean();
  EXPECT_NEAR(middle.mean.fy, mean.fy, 0.01 * std::abs(mean.fy));
  EXPECT_NEAR(middle.mean.fz, mean.fz, 0.01 * std::abs(mean.fz));
  EXPECT_NEAR(middle.mean.torque, mean.torque, 0.01 * mean.torque);
}

constexpr const char* MODEL =
    "format: smartmill-model/1\ntool: {teeth: 4, diameter_mm: 10.0, helix_deg: 30.0}\ncutting:\n  "
    "Ktc_n_per_mm2: 800.0\n  "
    "Krc_n_per_mm2: 300.0\n  Kac_n_per_mm2: 200.0\n  Kte_n_per_mm: 20.0\n  Kre_n_per_mm: 25.0\n  "
    "Kae_n_per_mm: 3.0\n";

// The power of the chip forces is Ktc times the removal rate: for a slot Ktc ae ap vf, plus the edges N a R w
// Kte / 2.
TEST(ProgramAnalysis, PowerIsSpecificEnergyTimesRemovalRate) {
  const TemporaryFolder folder;
  ToolModels models({folder.write("mill.yaml", MODEL)});
  Stock stock(StockBlock{{0, 0, -10 * MM}, {60 * MM, 40 * MM, 0}}, 0.1 * MM);
  ProgramAnalysis analysis("part.nc", models, stock);
  const auto moves =
      interpretProgram("G21 G90 G0 X-10 Y20 Z-2\nS3000 M3\nG1 X70 F600\nG0 Z5\nM30\n", "part.nc");
  const AnalysisResult result = analysis.run(moves);
  ASSERT_EQ(result.blocks.size(), 2u);
  const BlockSummary& cut = result.blocks[0];
  EXPECT_EQ(cut.line, 3);
  EXPECT_NEAR(cut.time, 8.0, 1e-9);
  EXPECT_NEAR(cut.feed_per_tooth, 0.05 * MM, 1e-12);
  const double chip = 800e6 * (10 * MM * 2 * MM * 0.01), edge = 4 * 2 * MM * 5 * MM * SPEED * 20e3 / 2;
  EXPECT_NEAR(cut.power, chip + edge, 1e-3 * (chip + edge));
  EXPECT_NEAR(cut.airShare(), 1.0 - 65.0 / 80.0,
              0.01);                    // from 5 mm before the block to the end of the tool at its end
  EXPECT_TRUE(std::isnan(cut.margin));  // the tool is rigid
}

// On a ramp of a ball end as well, with the axial part of the feed, down and up; of a bull nose up only, as
// its flat part has no force in the model.
TEST(ProgramAnalysis, PowerOnARampIsSpecificEnergyTimesRemovalRate) {
  for (const char* radius : {"5.0", "2.0"}) {
    const TemporaryFolder folder;
    ToolModels models(
        {folder.write("mill.yaml",
                      "format: smartmill-model/1\ntool: {teeth: 2, diameter_mm: 10.0, helix_deg: "
                      "30.0, corner_radius_mm: " +
                          std::string(radius) +
                          "}\ncutting:\n  Ktc_n_per_mm2: 800.0\n  Krc_n_per_mm2: 300.0\n  "
                          "Kac_n_per_mm2: 200.0\n  Kte_n_per_mm: 0.0\n  Kre_n_per_mm: 0.0\n  "
                          "Kae_n_per_mm: 0.0\n")});
    Stock stock(StockBlock{{0, 0, -10 * MM}, {60 * MM, 40 * MM, 0}}, 0.1 * MM);
    ProgramAnalysis analysis("part.nc", models, stock);
    int ramps = 0;
    analysis.run(interpretProgram("G21 G90 G0 X-10 Y10 Z-1\nS3000 M3\nG1 X70 Z-6 F600\nG0 Z5\nX70 Y28\nG1 "
                                  "Z-6\nG1 X-10 Z-1 F600\nG0 Z5\nM30\n",
                                  "part.nc"),
                 [&](const Step& step, const StepPrediction& prediction) {
                   if (step.tip[0] < 20 * MM || step.tip[0] > 40 * MM || step.move->rapid) return;
                   if (step.move->line == 3 && radius != std::string("5.0")) return;
                   ++ramps;
                   const double removal = step.volume() / step.time;  // [m3/s]
                   EXPECT_NEAR(prediction.power / (800e6 * removal), 1.0, 0.01)
                       << radius << " mm, line " << step.move->line;
                 });
    EXPECT_GT(ramps, 10);
  }
}

TEST(ProgramAnalysis, ErrorsNameProgramAndLine) {
  const TemporaryFolder folder;
  const std::string model = folder.write("mill.yaml", MODEL);
  const auto faultOf = [&](const std::string& text, const std::vector<std::string>& models) {
    return errorOf([&] {
      ToolModels tools(models);
      Stock stock(StockBlock{{0, 0, -10 * MM}, {60 * MM, 40 * MM, 0}}, 0.2 * MM);
      ProgramAnalysis("part.nc", tools, stock).run(interpretProgram(text, "part.nc"));
    });
  };
  EXPECT_EQ(faultOf("T1 M6\nG0 X-10 Y20 Z-2\nS3000 M3\nG1 X70 F600\nT2 M6\nS100 M3\nG1 X75\nM30\n", {model}),
            "part.nc: line 7: T2: no model of this tool, expected --model 2=FILE");
  EXPECT_EQ(faultOf("T1 M6\nG0 X-10 Y20 Z-2\nS3000 M3\nG1 X70 F600\nM30\n", {"3=" + model}),
            "part.nc: line 4: T1: no model of this tool, expected --model 1=FILE");
  EXPECT_EQ(faultOf("G0 X-10 Y20 Z-2\nG1 X70 F600\nM30\n", {model}),
            "part.nc: line 2: G1 cuts with the spindle at rest, expected S and M3 or M4 before it");
  EXPECT_EQ(faultOf("G0 X-10 Y20 Z12\nS3000 M3\nG1 X70 F600\nM30\n", {model}),
            "part.nc: no block meets the stock (X 0 to 60, Y 0 to 40, Z -10 to 0 mm), the feed motions are "
            "in X -10 to 70, "
            "Y 20 to 20, Z 12 to 12 mm");
  EXPECT_EQ(faultOf("G0 X-10 Y20 Z12\nX0\nM30\n", {model}),
            "part.nc: no block with a feed motion, expected G1, G2, G3 or a cycle");
  EXPECT_EQ(faultOf("M30\n", {model, model}),
            "--model " + model + ": expected N=FILE, the number of the tool for each of several models");
  const std::string no_tool = folder.write("no_tool.yaml", "format: smartmill-model/1\n");
  EXPECT_EQ(faultOf("M30\n", {no_tool}), no_tool + ": tool is missing (needed to simulate a program)");
  const std::string no_cutting = folder.write(
      "no_cutting.yaml", "format: smartmill-model/1\ntool: {teeth: 4, diameter_mm: 10.0, helix_deg: 30.0}\n");
  EXPECT_EQ(faultOf("G0 X-10 Y20 Z-2\nS3000 M3\nG1 X70 F600\nM30\n", {no_cutting}),
            "part.nc: line 3: " + no_cutting + ": cutting is missing (needed to predict forces)");
}

}  // namespace
}  // namespace smartmill::program
