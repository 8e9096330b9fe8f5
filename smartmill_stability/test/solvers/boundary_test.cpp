#include "smartmill_stability/solvers/boundary.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_stability/solvers/delayed_system.h"
#include "smartmill_stability_testing/oracles.h"

namespace smartmill::stability {
namespace {

using units::radPerSecFromRpm;

TraceOptions window(double low_rpm, double high_rpm, double max_depth) {
  TraceOptions options;
  options.speed_low = radPerSecFromRpm(low_rpm);
  options.speed_high = radPerSecFromRpm(high_rpm);
  options.max_depth = max_depth;
  options.speeds = 24;
  options.depths = 20;
  options.levels = 1;
  return options;
}

// At every point the dominant multiplier is on the unit circle, within 1e-4 of a fine cell.
TEST(Boundary, pointsLieOnTheUnitCircle) {
  const auto solver = makeFloquetSolver(Method::collocation, benchmarkSystem(1.0, true, false));
  const auto curves = traceBoundary(*solver, window(9000.0, 22000.0, 4e-3));
  ASSERT_FALSE(curves.empty());
  std::size_t points = 0, flips = 0;
  for (const BoundaryCurve& curve : curves) {
    for (const BoundaryPoint& p : curve.points) {
      EXPECT_NEAR(solver->multiplier(p.speed, p.depth).radius(), 1.0, 2e-3);
      flips += p.kind == Kind::flip;
      ++points;
    }
  }
  EXPECT_GT(points, 100u);
  EXPECT_GT(flips, 5u);  // the tables have flips at 12000 and 20000 rpm
}

// The lowest point of the traced curves at a speed is the first loss of stability there.
TEST(Boundary, agreesWithTheFirstLoss) {
  const auto solver = makeFloquetSolver(Method::collocation, benchmarkSystem(1.0, true, false));
  const TraceOptions options = window(9000.0, 22000.0, 4e-3);
  const auto curves = traceBoundary(*solver, options);
  for (const double rpm : {10013.0, 14989.0, 18017.0}) {
    const double speed = radPerSecFromRpm(rpm);
    double lowest = 1.0;
    for (const BoundaryCurve& curve : curves) {
      for (std::size_t i = 0; i + 1 < curve.points.size(); ++i) {
        const BoundaryPoint &a = curve.points[i], &b = curve.points[i + 1];
        if ((a.speed - speed) * (b.speed - speed) > 0.0 || a.speed == b.speed) continue;
        lowest = std::min(lowest, a.depth + (b.depth - a.depth) * (speed - a.speed) / (b.speed - a.speed));
      }
    }
    EXPECT_NEAR(lowest / solver->limit(speed, 4e-3).depth, 1.0, 0.03) << rpm;  // chords of fine cells
  }
}

// A helix closes flip lobes to islands (Zatarain et al. 2006): where the depth is an integer multiple of the
// axial pitch the feedback is constant and no flip exists.
TEST(Boundary, helixMakesIslandsOfFlip) {
  RegenerativeSystem system = benchmarkSystem(0.05, true, false);
  system.helix = units::radFromDeg(30.0);
  system.diameter = 0.008;
  const double axial_pitch = units::PI * 0.5 * system.diameter / std::tan(system.helix);  // two teeth
  const double speed = radPerSecFromRpm(17000.0);
  const DelayedSystem whole = delayedSystem(system, speed, axial_pitch);
  Feedback first, other;
  whole.feedback(0.0, 0.0, first);
  for (const double share : {0.13, 0.4, 0.77}) {
    whole.feedback(share * whole.period, share * whole.period, other);
    EXPECT_LT((other.now - first.now).norm(), 1e-9 * first.now.norm());
  }
  const auto solver = makeFloquetSolver(Method::collocation, system);
  TraceOptions options = window(15500.0, 19500.0, 12e-3);
  options.speeds = 20;
  options.levels = 1;
  int islands = 0;
  for (const BoundaryCurve& curve : traceBoundary(*solver, options)) {
    const bool flip = std::all_of(curve.points.begin(), curve.points.end(),
                                  [](const BoundaryPoint& p) { return p.kind == Kind::flip; });
    islands += curve.closed && flip;
  }
  EXPECT_EQ(islands, 1);
}

TEST(Boundary, refusesAnEmptyWindow) {
  const auto solver = makeFloquetSolver(Method::collocation, benchmarkSystem(1.0, true, false));
  EXPECT_THROW(traceBoundary(*solver, window(9000.0, 9000.0, 1e-3)), Error);
  EXPECT_THROW(traceBoundary(*solver, window(9000.0, 10000.0, 0.0)), Error);
}

// Columns and content of the program's CSV file, which other programs read.
TEST(Lobes, writesTheFirstLossOfStability) {
  const TemporaryFolder folder;
  const std::string out = folder.file("chart.csv");
  const auto command = [&](const std::string& rest) {
    return std::string(LOBES) + " test/smartmill_stability_testing/model.yaml --entry-deg 0 --exit-deg 180 " +
           rest + " -o " + out + " > /dev/null 2>&1";
  };
  ASSERT_EQ(std::system(command("--method collocation --speeds 10000:20000:3 --max-depth-mm 0.1").c_str()),
            0);
  std::ifstream file(out);
  std::string line;
  std::getline(file, line);
  EXPECT_EQ(line, "rpm,limit_mm,chatter_hz,kind");
  std::vector<std::vector<std::string>> rows;
  while (std::getline(file, line)) {
    std::vector<std::string> row;
    std::istringstream fields(line + ",");
    for (std::string field; std::getline(fields, field, ',');) row.push_back(field);
    rows.push_back(row);
  }
  ASSERT_EQ(rows.size(), 3u);
  const double limits[3] = {0.0714108, -1.0, 0.0632216};
  for (const int i : {0, 2}) {
    ASSERT_EQ(rows[static_cast<std::size_t>(i)].size(), 4u);
    EXPECT_NEAR(std::stod(rows[static_cast<std::size_t>(i)][1]) / limits[i], 1.0, 1e-5);
    EXPECT_EQ(rows[static_cast<std::size_t>(i)][3], "hopf");
  }
  EXPECT_EQ(rows[1],
            (std::vector<std::string>{"15000", "", "", ""}));  // 0.114 mm: stable to the maximum depth
  EXPECT_TRUE(std::ifstream(folder.file("chart.png")).good());
  EXPECT_NE(std::system(command("--method guess --speeds 10000:20000:3 --max-depth-mm 0.1").c_str()), 0);
  EXPECT_NE(std::system(command("--speeds 10000:20000 --max-depth-mm 0.1").c_str()), 0);
}

}  // namespace
}  // namespace smartmill::stability
