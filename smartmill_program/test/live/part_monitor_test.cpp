// A shoulder passed at its programmed feed, with forces of known size.
#include "smartmill_program/live/part_monitor.h"

#include <cmath>
#include <map>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "test_part.h"

namespace smartmill::program {
namespace {

using units::MM;
using units::PI;

constexpr double FEED = 0.01, RATE = 1000.0;  // [m/s], [Hz]
constexpr int BLOCK = 10;
const CuttingCoefficients COEFFICIENTS{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};

/// A slot and one step of 3 mm down, with the way between them in air.
const char* const SHOULDER =
    "G21 G90 G17 S3000 M3 F600\n"
    "G0 X-10 Y10 Z5\n"
    "G1 Z-2\n"
    "G1 X70\n"   // 4: slot
    "G1 Y13\n"   // 5: outside of the stock
    "G1 X-10\n"  // 6: down-milling
    "G0 Z5\n"
    "M30\n";

/// Largest force across the axis over a revolution, by the closed form along the helix at 720 angles.
double peakOf(double entry, double exit) {
  ToolGeometry tool;
  tool.teeth = 4;
  tool.diameter = 10 * MM;
  tool.helix = units::radFromDeg(30.0);
  const MechanisticForce force(tool, COEFFICIENTS, {entry, exit, 2 * MM, 0.05 * MM});
  double peak = 0.0;
  for (int k = 0; k < 720; ++k) {
    const CuttingForce now = force.at(units::TWO_PI * k / 720.0);
    peak = std::max(peak, std::hypot(now.fx, now.fy));
  }
  return peak;
}

ToolModels tools() {
  const TemporaryFolder folder;
  return ToolModels({folder.write(
      "model.yaml", "format: smartmill-model/1\ntool: {teeth: 4, diameter_mm: 10.0, helix_deg: 30.0}\n")});
}

struct Rig {
  std::shared_ptr<const LiveProgram> program = std::make_shared<const LiveProgram>(prepareText(SHOULDER));
  std::vector<PartProgress> reports;
  PartMonitor monitor{program, 0.25, 0.05, [this](const PartProgress& report) { reports.push_back(report); }};

  double begin(int line) const {
    for (const PathPiece& piece : program->pieces)
      if (piece.line == line) return piece.from;
    return NAN;
  }
  int lineAt(double place) const {
    int line = 0;
    for (const PathPiece& piece : program->pieces)
      if (piece.from <= place) line = piece.line;
    return line;
  }
  /// From a place [m] on, with a force of 100 N times the line. @param compensated the force
  void run(double place, double time, bool compensated = true) {
    for (int k = 0; k < static_cast<int>(time / 0.01); ++k) {
      const double stamp = 50.0 + 0.01 * k, at = place + FEED * 0.01 * k;
      ForceBlock block;
      block.stamp = stamp;
      block.sample_rate = RATE;
      block.first_index = static_cast<std::uint64_t>(k) * BLOCK;
      block.status = compensated ? ForceBlock::Status::compensated : ForceBlock::Status::passed_through;
      block.force[0].assign(BLOCK, 60.0 * lineAt(at));
      block.force[1].assign(BLOCK, -80.0 * lineAt(at));
      block.force[2].assign(BLOCK, 500.0);
      monitor.push(block);
      if (k % 2 == 0) monitor.push(PartPlace{stamp, at, lineAt(at), 1, FEED});
    }
    monitor.flush();
  }
};

TEST(PathPieces, CoverThePathAndArePredicted) {
  const Rig rig;
  const std::vector<PathPiece>& pieces = rig.program->pieces;
  for (std::size_t k = 1; k < pieces.size(); ++k) EXPECT_NEAR(pieces[k].from, pieces[k - 1].to, 1e-9);
  const std::vector<PiecePrediction> predictions = predictPieces(pieces, tools(), COEFFICIENTS);
  std::map<int, double> peak, length;
  for (std::size_t k = 0; k < pieces.size(); ++k) {
    const bool cut = pieces[k].kind == PathPiece::Kind::cut;
    EXPECT_EQ(std::isfinite(predictions[k].peak_force), cut) << k;
    EXPECT_TRUE(std::isnan(predictions[k].margin));  // no modes
    if (cut) length[pieces[k].line] += pieces[k].to - pieces[k].from;
    if (cut && !(predictions[k].peak_force <= peak[pieces[k].line]))
      peak[pieces[k].line] = predictions[k].peak_force;
  }
  // Where the tool enters or leaves, some angles of the slot are cut without the others.
  EXPECT_NEAR(peak[4] / peakOf(0.0, PI), 1.0, 0.02);
  EXPECT_NEAR(peak[6] / peakOf(PI - std::acos(0.4), PI), 1.0, 0.02);
  EXPECT_NEAR(length[4], 65 * MM, 0.5 * MM);  // 60 mm of stock and a radius
  EXPECT_LT(pieces.size(),
            250u);  // one piece for the steady part of each line, one for each step at its ends
  for (const PiecePrediction& one : predictPieces(pieces, tools(), std::nullopt))
    EXPECT_TRUE(std::isnan(one.peak_force));
}

TEST(PartMonitor, ComparesStretchesOfThePath) {
  Rig rig;
  rig.monitor.setPredictions(predictPieces(rig.program->pieces, tools(), COEFFICIENTS));
  const double start = rig.begin(4) + 30 * MM;  // in the slot
  rig.monitor.push(PartVerdict{51.0, true, 812.0});
  rig.run(start, 10.0);
  ASSERT_GT(rig.reports.size(), 30u);
  double place = start;
  for (const PartProgress& report : rig.reports) {
    EXPECT_NEAR(report.from, place, 1e-9);
    EXPECT_NEAR(report.to - report.from, FEED * (report.stamp - report.begin), 1e-6);
    EXPECT_NEAR(report.stamp - report.begin, 0.26, 1e-6);  // a multiple of the period of the states
    place = report.to;
    EXPECT_LE(report.first_line, report.last_line);
    EXPECT_NEAR(report.peak_force, 100.0 * report.last_line, 1e-9);
    EXPECT_TRUE(report.compensated);
    EXPECT_EQ(report.verdicts.size(), report.begin < 51.0 && 51.0 <= report.stamp ? 1u : 0u);
    if (report.last_line == 4 && report.to < rig.begin(4) + 60 * MM) {
      EXPECT_NEAR(report.predicted.peak_force / peakOf(0.0, PI), 1.0, 0.02);
    }
    if (report.first_line == 5 && report.last_line == 5) {
      EXPECT_TRUE(std::isnan(report.predicted.peak_force));
    }
  }
  EXPECT_EQ(rig.reports.back().last_line, 6);
}

TEST(PartMonitor, StatesWhetherTheForceIsCompensatedAndNothingWithoutAPlace) {
  Rig raw;
  raw.run(raw.begin(4) + 30 * MM, 1.0, false);
  ASSERT_FALSE(raw.reports.empty());
  for (const PartProgress& report : raw.reports) {
    EXPECT_FALSE(report.compensated);
    EXPECT_NEAR(report.peak_force, 400.0, 1e-9);
    EXPECT_TRUE(std::isnan(report.predicted.peak_force));  // not predicted yet
  }
  Rig lost;
  for (int k = 0; k < 100; ++k) lost.monitor.push(PartPlace{50.0 + 0.02 * k, std::nullopt, 4, 1, FEED});
  lost.monitor.flush();
  EXPECT_TRUE(lost.reports.empty());
}

}  // namespace
}  // namespace smartmill::program
