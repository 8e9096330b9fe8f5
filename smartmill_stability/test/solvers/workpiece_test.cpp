#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/refusals.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_stability/chart/uncertainty.h"
#include "smartmill_stability/solvers/model_system.h"
#include "smartmill_stability_testing/damped_slot.h"

namespace smartmill::stability {
namespace {

using ::testing::HasSubstr;

const double SPEED = units::radPerSecFromRpm(9000.0);

/// The benchmark with a workpiece that has the modes of its tool times a factor on the compliance.
MachineModel withPart(const MachineModel& tool, double factor) {
  MachineModel model = tool;
  model.workpiece_modes = {{0.0, tool.tool_tip.x, tool.tool_tip.y}};
  for (ModalModel* axis : {&model.workpiece_modes[0].x, &model.workpiece_modes[0].y})
    for (Mode& mode : axis->modes) mode.gain *= factor;
  return model;
}

double limitOf(const MachineModel& model, double speed = SPEED, Method method = Method::collocation) {
  return makeSolver(method, systemOf(model, 90.0, 180.0))->limit(speed, 0.1).depth;
}

TEST(Workpiece, aStiffOneLeavesTheLimit) {
  const MachineModel tool = readMachineModel(MODEL_FILE);
  // A compliance of 1e-9 of the tool's changes the limit by as much.
  EXPECT_NEAR(limitOf(withPart(tool, 1e-9)) / limitOf(tool), 1.0, 1e-6);
}

// With all modes alike, force and reaction see the sum of both compliances.
TEST(Workpiece, itsModesActAsThoseOfTheTool) {
  const MachineModel tool = readMachineModel(MODEL_FILE);
  MachineModel part = withPart(tool, 1.0);
  part.tool_tip = {};
  for (const Method method :
       {Method::collocation, Method::semi_discretization, Method::multi_frequency, Method::zero_order})
    EXPECT_NEAR(limitOf(part, SPEED, method) / limitOf(tool, SPEED, method), 1.0, 1e-9) << nameOf(method);
  // Twice the compliance halves the limit: the force is linear in the depth. Tolerance of the search.
  EXPECT_NEAR(limitOf(withPart(tool, 1.0)) / limitOf(tool), 0.5, 2e-6);
}

// Receptances in series add at each frequency.
TEST(Workpiece, receptanceIsTheSum) {
  MachineModel model = readMachineModel(MODEL_FILE);
  WorkpieceModes part;
  part.y.modes = {{480.0, 0.008, 1.0 / 3e6}, {1500.0, 0.02, 1.0 / 9e6}};
  model.workpiece_modes = {part};
  for (const double f : {300.0, 481.0, 900.0, 1700.0}) {
    const auto g = receptance(systemOf(model, 90.0, 180.0).modes, f);
    EXPECT_NEAR(std::abs(g[0] / model.tool_tip.x.response(f) - 1.0), 0.0, 1e-12);
    EXPECT_NEAR(std::abs(g[3] / (model.tool_tip.y.response(f) + part.y.response(f)) - 1.0), 0.0, 1e-12);
    EXPECT_EQ(std::abs(g[1]) + std::abs(g[2]), 0.0);
  }
}

// A wall that is flexible along its normal, milled by a rigid tool with four teeth in a slot: the closed form
// of DampedSlot, since along y as along x the mean of the radial force alone acts.
TEST(Workpiece, wallInASlotHasItsClosedForm) {
  const DampedSlot slot;
  MachineModel model = readMachineModel(MODEL_FILE);
  model.tool_tip = {};
  model.tool->teeth = 4;
  model.cutting->krc = slot.kr;
  WorkpieceModes wall;
  wall.y.modes = {{slot.frequency, slot.damping_ratio, 1.0 / slot.stiffness()}};
  model.workpiece_modes = {wall};
  for (const Method method : {Method::collocation, Method::zero_order}) {
    const auto solver = makeSolver(method, systemOf(model, 0.0, 180.0));
    for (const double rpm : {6100.0, 9000.0, 13000.0}) {
      const double speed = units::radPerSecFromRpm(rpm);
      // Roots of the search; lines of the receptance of the zero-order solution.
      EXPECT_NEAR(solver->limit(speed, 0.5).depth / slot.limit(speed), 1.0,
                  method == Method::zero_order ? 1e-3 : 1e-5)
          << nameOf(method) << " " << rpm;
    }
  }
}

TEST(Workpiece, standardDeviationsOfItsModesAreDrawn) {
  MachineModel model = readMachineModel(MODEL_FILE);
  WorkpieceModes part;
  part.y.modes = {{480.0, 0.008, 1.0 / 3e6, 9.6}};
  model.workpiece_modes = {part};
  const RegenerativeSystem mean = systemOf(model, 90.0, 180.0);
  std::mt19937_64 random(1);
  const UncertainSystem uncertain = UncertainSystem::of(model, mean);
  double sum = 0.0;
  constexpr int DRAWS = 400;
  for (int i = 0; i < DRAWS; ++i)
    sum += std::pow(uncertain.draw(random).modes.back().frequency / 480.0 - 1.0, 2);
  // 2 %; the error of a standard deviation of 400 draws is 3.5 %, four of them.
  EXPECT_NEAR(std::sqrt(sum / DRAWS), 0.02, 0.003);
}

TEST(Workpiece, aPositionIsRequiredWithSeveralPlaces) {
  MachineModel model = withPart(readMachineModel(MODEL_FILE), 1.0);
  model.workpiece_modes.push_back(model.workpiece_modes[0]);
  model.workpiece_modes[1].position = 0.1;
  EXPECT_THAT(errorOf([&] { systemOf(model, 90.0, 180.0); }),
              HasSubstr("workpiece.modes: 2 places, expected a position along the part"));
  EXPECT_NEAR(limitOf(atPosition(model, 0.05)) / limitOf(readMachineModel(MODEL_FILE)), 0.5, 2e-6);
}

/// Values of a CSV by the first two columns.
std::map<std::string, double> rowsOf(const std::string& file) {
  std::map<std::string, double> rows;
  std::ifstream csv(file);
  std::string line;
  std::getline(csv, line);
  while (std::getline(csv, line)) {
    const std::size_t second = line.find(',', line.find(',') + 1);
    rows[line.substr(0, second)] = std::atof(line.c_str() + second + 1);
  }
  return rows;
}

// A free end that is four times as flexible as the clamped end.
TEST(Lobes, limitsAlongTheWorkpiece) {
  const TemporaryFolder folder;
  MachineModel model = withPart(readMachineModel(MODEL_FILE), 1.0);
  model.tool_tip = {};
  model.workpiece_modes.push_back(model.workpiece_modes[0]);
  model.workpiece_modes[1].position = 0.1;
  for (ModalModel* axis : {&model.workpiece_modes[1].x, &model.workpiece_modes[1].y})
    axis->modes[0].gain *= 4.0;
  writeMachineModel(model, folder.file("wall.yaml"));
  const auto run = [&](const std::string& options) {
    const std::string command = std::string(LOBES) + " " + folder.file("wall.yaml") +
                                " --entry-deg 90 --exit-deg 180 --speeds 9000:9200:2 --max-depth-mm 100 -o " +
                                folder.file("chart.csv") + " " + options + " > /dev/null 2> " +
                                folder.file("error.txt");
    return std::system(command.c_str());
  };
  ASSERT_EQ(run("--along-part " + folder.file("part.csv")), 0);
  std::map<std::string, double> part = rowsOf(folder.file("part.csv")),
                                least = rowsOf(folder.file("chart.csv"));
  EXPECT_EQ(part.size(), 42u);
  const double clamped = part.at("0,9000");
  // The shape is linear along the part: 1 at the clamped end, 2 at the free end, 1.5 half way.
  EXPECT_NEAR(part.at("100,9000") / clamped, 0.25, 1e-5);
  EXPECT_NEAR(part.at("50,9000") / clamped, 1.0 / 2.25, 1e-5);
  EXPECT_TRUE(std::ifstream(folder.file("part.png")).good());
  std::ifstream chart(folder.file("chart.csv"));
  std::string line;
  std::getline(chart, line);
  std::getline(chart, line);
  EXPECT_NEAR(std::atof(line.c_str() + line.find(',') + 1), part.at("100,9000"), 1e-6);
  ASSERT_EQ(run("--position-mm 50"), 0);
  std::ifstream there(folder.file("chart.csv"));
  std::getline(there, line);
  std::getline(there, line);
  EXPECT_NEAR(std::atof(line.c_str() + line.find(',') + 1), part.at("50,9000"), 1e-6);
  const auto error = [&] { return readText(folder.file("error.txt")); };
  EXPECT_NE(run("--position-mm 101"), 0);
  EXPECT_THAT(error(), HasSubstr("position 101 mm is outside the places (0 <= value <= 100)"));
  EXPECT_NE(run(""), 0);
  EXPECT_THAT(error(), HasSubstr("workpiece.modes: 2 places, expected a position along the part"));
  EXPECT_NE(run("--along-part " + folder.file("part.csv") + " --position-mm 50"), 0);
  EXPECT_THAT(error(), HasSubstr("--along-part: cannot be combined with --position-mm"));
}

}  // namespace
}  // namespace smartmill::stability
