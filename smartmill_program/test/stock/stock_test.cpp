// Sweeps and columns against closed forms and dense sampling.

#include "smartmill_program/stock/stock.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using nc::PathSegment;
using units::MM;
using units::PI;

const StockBlock BLOCK{{0, 0, -10 * MM}, {60 * MM, 40 * MM, 0}};

/// The lowest tip over a point by sampling the path.
double sampled(const Sweep& sweep, double x, double y, double from, double to) {
  double lowest = Sweep::NONE;
  constexpr int COUNT = 20000;
  for (int k = 0; k <= COUNT; ++k) {
    const PathSegment::Point at = sweep.path().at(from + (to - from) * k / COUNT);
    if (std::hypot(x - at[0], y - at[1]) < sweep.radius()) lowest = std::min(lowest, at[2]);
  }
  return lowest;
}

TEST(Sweep, LowestTipIsThatOfADenselySampledPath) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-12 * MM, 12 * MM);
  const std::vector<PathSegment> paths{PathSegment::line({-5 * MM, 0, 0}, {6 * MM, 4 * MM, 0}),
                                       PathSegment::line({-5 * MM, 0, 0}, {6 * MM, 4 * MM, -2 * MM}),
                                       PathSegment::line({-5 * MM, 0, -2 * MM}, {6 * MM, 4 * MM, 0}),
                                       PathSegment::line({1 * MM, 1 * MM, 2 * MM}, {1 * MM, 1 * MM, -2 * MM}),
                                       PathSegment::arc({5 * MM, 0, 0}, {0, 5 * MM, -1 * MM}, {0, 0}, false),
                                       PathSegment::arc({5 * MM, 0, 0}, {0, 5 * MM, 1 * MM}, {0, 0}, true),
                                       PathSegment::arc({2 * MM, 0, 0}, {2 * MM, 0, -3 * MM}, {0, 0}, false)};
  for (const PathSegment& path : paths) {
    const Sweep sweep(path, ToolProfile(3 * MM));
    for (int k = 0; k < 100; ++k) {
      const double x = place(random), y = place(random);
      const double from = k % 2 ? 0.0 : 0.2 * path.length(), to = k % 3 ? path.length() : 0.7 * path.length();
      const double exact = sweep.lowestSurface(x, y, from, to), expected = sampled(sweep, x, y, from, to);
      if (std::isinf(exact) != std::isinf(expected)) {
        // At the edge of the sweep: a little more or less of the tool decides.
        EXPECT_NE(std::isinf(sampled(Sweep(path, ToolProfile(3.001 * MM)), x, y, from, to)),
                  std::isinf(sampled(Sweep(path, ToolProfile(2.999 * MM)), x, y, from, to)));
      } else if (!std::isinf(exact)) {
        EXPECT_NEAR(exact, expected, 0.2e-6 + 3e-3 * std::abs(sweep.slope()) * MM);  // step of the sampling
      }
    }
  }
}

TEST(DexelGrid, VolumeOfASlotIsThatOfItsColumns) {
  DexelGrid grid(BLOCK, 0.1 * MM);
  EXPECT_NEAR(grid.volume(), 60 * 40 * 10 * MM * MM * MM, 1e-6 * 24e-6);
  // Width 10 mm from edges of columns: exact.
  grid.remove(
      Sweep(PathSegment::line({-6 * MM, 20 * MM, -2 * MM}, {66 * MM, 20 * MM, -2 * MM}), ToolProfile(5 * MM)),
      0.0, 72 * MM);
  EXPECT_NEAR(grid.volume(), (24000 - 1200) * MM * MM * MM, 1e-6 * 24e-6);
}

TEST(DexelGrid, PiecesOfASweepRemoveWhatTheWholeDoes) {
  for (const PathSegment& path : {PathSegment::line({5 * MM, 8 * MM, -1 * MM}, {50 * MM, 31 * MM, -4 * MM}),
                                  PathSegment::line({5 * MM, 8 * MM, -4 * MM}, {50 * MM, 31 * MM, -1 * MM}),
                                  PathSegment::arc({40 * MM, 20 * MM, -1 * MM}, {20 * MM, 20 * MM, -3 * MM},
                                                   {30 * MM, 20 * MM}, true)}) {
    DexelGrid whole(BLOCK, 0.25 * MM), pieces(BLOCK, 0.25 * MM);
    const Sweep sweep(path, ToolProfile(5 * MM));
    whole.remove(sweep, 0.0, path.length());
    for (int k = 0; k < 50; ++k) pieces.remove(sweep, path.length() * k / 50, path.length() * (k + 1) / 50);
    for (std::size_t j = 0; j < whole.columns(1); ++j)
      for (std::size_t i = 0; i < whole.columns(0); ++i)
        ASSERT_NEAR(whole.height(i, j), pieces.height(i, j), 1e-8) << i << " " << j;  // floats
  }
}

// A wall between the middles of two columns.
TEST(Stock, AWallIsWhereTheToolHasCutIt) {
  Stock stock(BLOCK, 0.1 * MM);
  const double y = 20.0373 * MM;
  stock.begin(Sweep(PathSegment::line({-6 * MM, y, -2 * MM}, {66 * MM, y, -2 * MM}), ToolProfile(5 * MM)));
  stock.advance(72 * MM);
  for (double x = 3 * MM; x < 50 * MM; x += 1.7 * MM) {
    EXPECT_NEAR(stock.height(x, y + 5 * MM + 1e-6), 0.0, 1e-9);
    EXPECT_NEAR(stock.height(x, y + 5 * MM - 1e-6), -2 * MM, 1e-9);
    EXPECT_NEAR(stock.height(x, y), -2 * MM, 1e-9);
  }
  EXPECT_EQ(stock.height(-1e-6, y), Stock::EMPTY);
}

// Tools that pass again and again do not change what earlier ones have left: lists of sweeps are pruned.
TEST(Stock, LevelsOfAPocketKeepTheirWalls) {
  Stock stock(BLOCK, 0.2 * MM);
  for (int level = 1; level <= 40; ++level) {
    const double z = -0.2 * level * MM;
    for (const double y : {15.0, 18.0, 21.0}) {
      const PathSegment path = PathSegment::line({20 * MM, y * MM, z}, {40 * MM, (y + 0.013) * MM, z});
      stock.begin(Sweep(path, ToolProfile(4 * MM)));
      stock.advance(path.length());
    }
  }
  // Wall of the line from (20, 21) to (40, 21.013).
  const double wall = (21.0065 + 4.0) * MM;
  EXPECT_NEAR(stock.height(30 * MM, wall + 2e-6), 0.0, 1e-9);
  EXPECT_NEAR(stock.height(30 * MM, wall - 2e-6), -8 * MM, 1e-8);
}

TEST(Stock, FaceVolumeOfADescendingToolIsThatOfACylinder) {
  for (const double offset : {0.0, 0.031, 0.05}) {
    const Stock stock(BLOCK, 0.1 * MM);
    EXPECT_NEAR(stock.faceVolume((30 + offset) * MM, 20 * MM, 5 * MM, 2 * MM, -3 * MM) / (MM * MM * MM),
                PI * 25 * 3, 1e-3 * PI * 75);
  }
  EXPECT_EQ(Stock(BLOCK, 0.1 * MM).faceVolume(70 * MM, 20 * MM, 5 * MM, 2 * MM, -3 * MM), 0.0);
  EXPECT_EQ(Stock(BLOCK, 0.1 * MM).faceVolume(30 * MM, 20 * MM, 5 * MM, 2 * MM, 0.0), 0.0);
}

TEST(DexelGrid, RefusesAnEmptyBlockAndTooManyColumns) {
  EXPECT_EQ(errorOf([] {
              DexelGrid(StockBlock{{0, 0, 0}, {0, 1, 1}}, 1e-4);
            }),
            "stock: size 0 mm in X, expected a value above 0");
  EXPECT_EQ(errorOf([] {
              DexelGrid(StockBlock{{0, 0, 0}, {1, 1, 1}}, 1e-6);
            }),
            "resolution 0.001 mm: more than 2e+08 columns in the stock, expected a coarser one");
  EXPECT_EQ(errorOf([] { DexelGrid(BLOCK, 0.0); }), "resolution [m]: 0 is out of range (> 0)");
}

}  // namespace
}  // namespace smartmill::program
