#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/learning/chart_learning.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// A drawn machine without a tap test, and the cuts that it permits.
struct UntappedMachine {
  MachineModel model;
  Engagement engagement;  ///< without depth
  CutRange range;
  RegenerativeSystem system() const;
};

/// Carbide end mills of 8 to 20 mm as beams in drawn spindles of the independent plant, all modes below 6
/// kHz, other springs and damping in y than in x; 2 to 4 teeth, helix 20 to 45 deg; aluminium, cast iron,
/// steel or titanium; slots, half, quarter and 85 % immersion, up and down. The depth ends at 1.5 diameters,
/// the highest speed lies between 8,000 and 24,000 rpm, the lowest at 20 to 40 % of it. Nothing of the prior
/// of ChartLearning is used. @param random seeded
UntappedMachine drawUntappedMachine(std::mt19937_64& random);

/// The largest removal speed x depth of the exact chart: the first loss of stability by collocation at 400
/// speeds.
CutProposal mostRemoval(const UntappedMachine& machine);

/// A machine that cuts, and reports what a machine without a hammer does: verdict and chatter frequency by
/// collocation with all its modes, the frequency with an error of 1 %, and with the first cut the tangential
/// coefficient of the load meter with a standard deviation of 10 %.
class ProbedMachine {
 public:
  ProbedMachine(const UntappedMachine& machine, std::uint64_t seed);
  JudgedCut at(double speed, double depth);

 private:
  double kt_;
  std::unique_ptr<FloquetSolver> solver_;
  std::mt19937_64 random_;
  bool first_ = true;
};

/// What a machine learned from its cuts.
struct ProbingResult {
  std::vector<CutProposal> proposed;  ///< with the stated probability
  std::vector<JudgedCut> cuts;        ///< as reported
  std::optional<CutProposal> recommended;
  bool stable = false;   ///< the recommended cut, by collocation
  CutProposal most;      ///< of the exact chart
  double removal = 0.0;  ///< [1] of the recommended cut, over the most that the exact chart allows
};

/// @param cuts number of cuts before the recommendation
ProbingResult probe(const UntappedMachine& machine, int cuts, const LearningOptions& options,
                    std::uint64_t seed);

}  // namespace smartmill::stability
