#include "smartmill_program/program_analysis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using units::MM;

constexpr std::size_t STEPS_PER_CALL = 200;  // of Progress: some milliseconds

/// "X 0 to 60, Y 0 to 40, Z -10 to 0 mm"
std::string extentText(const std::array<double, 3>& low, const std::array<double, 3>& high) {
  return formatted("X %.4g to %.4g, Y %.4g to %.4g, Z %.4g to %.4g mm", low[0] / MM, high[0] / MM,
                   low[1] / MM, high[1] / MM, low[2] / MM, high[2] / MM);
}

}  // namespace

ProgramAnalysis::ProgramAnalysis(const std::string& name, ToolModels& models, Stock& stock,
                                 const AnalysisOptions& options)
    : name_(name), models_(models), stock_(stock), options_(options) {
}

AnalysisResult ProgramAnalysis::run(const std::vector<Move>& moves, const Visit& visit,
                                    const Progress& progress) {
  AnalysisResult result;
  StepPredictor predictor(models_, options_.stability, options_.probability);
  CutSimulation simulation(
      stock_, [&](int tool) -> const ToolShape& { return models_.shape(tool); }, options_.simulation);
  std::size_t done = 0;
  const auto onStep = [&](const Step& step) {
    const StepPrediction prediction = options_.prediction ? predictor.predict(step) : StepPrediction();
    result.blocks.back().add(step, prediction);
    result.volume += step.volume();
    if (visit) visit(step, prediction);
    const bool stops = ++result.steps % STEPS_PER_CALL == 0 && progress &&
                       !progress(static_cast<double>(done) / static_cast<double>(moves.size()));
    return !stops;
  };
  for (const Move& move : moves) {
    if (result.blocks.empty() || result.blocks.back().block != move.block) result.blocks.emplace_back(move);
    try {
      result.interrupted = !simulation.run(move, onStep);
    } catch (const Error& error) {
      throw Error(name_ + ": line " + std::to_string(move.line) + ": " + error.what());
    }
    if (result.interrupted) break;
    result.blocks.back().addDwell(move.dwell);
    ++done;
  }
  for (const BlockSummary& block : result.blocks) result.time += block.time;
  result.limits = predictor.computedLimits();
  if (!result.interrupted) requireCuts(moves, result);
  return result;
}

void ProgramAnalysis::requireCuts(const std::vector<Move>& moves, const AnalysisResult& result) const {
  if (result.volume > 0.0) return;
  std::array<double, 3> low{}, high{};
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  for (const Move& move : moves) {
    if (move.rapid || move.path.length() == 0.0) continue;
    for (const double share : {0.0, 0.25, 0.5, 0.75, 1.0}) {
      const nc::PathSegment::Point point = move.path.at(share * move.path.length());
      for (std::size_t i = 0; i < 3; ++i) {
        low[i] = std::min(low[i], point[i]);
        high[i] = std::max(high[i], point[i]);
      }
    }
  }
  const StockBlock& block = stock_.block();
  if (!(low[0] <= high[0]))
    throw Error(name_ + ": no block with a feed motion, expected G1, G2, G3 or a cycle");
  throw Error(name_ + ": no block meets the stock (" + extentText(block.low, block.high) +
              "), the feed motions are in " + extentText(low, high));
}

}  // namespace smartmill::program
