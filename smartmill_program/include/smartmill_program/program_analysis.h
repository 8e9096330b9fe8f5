#pragma once

#include <functional>
#include <string>
#include <vector>

#include "smartmill_program/engagement/cut_simulation.h"
#include "smartmill_program/nc/move.h"
#include "smartmill_program/prediction/tool_models.h"
#include "smartmill_program/report/block_summary.h"
#include "smartmill_program/stock/stock.h"

namespace smartmill::program {

struct AnalysisOptions {
  SimulationOptions simulation;
  bool prediction = true;    ///< forces and limits; requires coefficients in the models
  bool stability = true;     ///< computes stability limits for models with modes of the tool tip
  bool probability = false;  ///< computes probabilities of chatter next to the limits
};

struct AnalysisResult {
  std::vector<BlockSummary> blocks;   ///< that move the tool or dwell, in the order of execution
  double time = 0.0;                  ///< [s] of the program
  double volume = 0.0;                ///< [m3] removed
  std::size_t steps = 0, limits = 0;  ///< steps simulated, stability limits computed
  bool interrupted = false;
};

/// All stages of a program: moves, material removal, engagement, prediction.
class ProgramAnalysis {
 public:
  /// Called after each step.
  using Visit = std::function<void(const Step&, const StepPrediction&)>;
  /// Called about every thousandth of the moves. @param share [1] of them. @return false: stop
  using Progress = std::function<bool(double share)>;

  /// @param name of the program, for messages
  ProgramAnalysis(const std::string& name, ToolModels& models, Stock& stock,
                  const AnalysisOptions& options = {});

  /// @throws Error "NAME: line N: ..." on a tool without model and a cut with the spindle at rest;
  /// "NAME: no block meets the stock ..."
  AnalysisResult run(const std::vector<Move>& moves, const Visit& visit = {}, const Progress& progress = {});

 private:
  void requireCuts(const std::vector<Move>& moves, const AnalysisResult& result) const;

  std::string name_;
  ToolModels& models_;
  Stock& stock_;
  AnalysisOptions options_;
};

}  // namespace smartmill::program
