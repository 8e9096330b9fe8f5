#include "smartmill_program/prediction/chatter_risk.h"

#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

constexpr double SAME_DEPTH = 0.02;  // [1]

}  // namespace

struct ChatterRisk::Drawn {
  Drawn(const MachineModel& model, const EngagementCell& cell, const stability::RiskOptions& options)
      : system(stability::UncertainSystem::of(model, cell.system(model))), machines(system, options) {}

  stability::UncertainSystem system;
  stability::DrawnMachines machines;
};

ChatterRisk::ChatterRisk(const MachineModel& model, const stability::RiskOptions& options)
    : model_(model), options_(options) {
}

ChatterRisk::~ChatterRisk() = default;

ChatterRisk::Drawn& ChatterRisk::drawn(const EngagementCell& cell) {
  std::unique_ptr<Drawn>& place = drawn_[cell];
  if (!place) place = std::make_unique<Drawn>(model_, cell, options_);
  return *place;
}

bool ChatterRisk::meanIsStable(const EngagementCell& cell, double speed, double depth) {
  return drawn(cell).machines.meanIsStable(speed, depth);
}

std::optional<double> ChatterRisk::probability(const EngagementCell& cell, double speed, double depth) {
  return drawn(cell).machines.probability(speed, depth);
}

std::optional<double> ChatterRisk::rounded(const EngagementCell& cell, double speed, double depth) {
  const int rpm = static_cast<int>(std::lround(units::rpmFromRadPerSec(speed)));
  const int at = static_cast<int>(std::lround(std::log(depth) / SAME_DEPTH));
  const auto [place, is_new] = known_.try_emplace({cell, rpm, at}, std::nullopt);
  if (is_new) place->second = probability(cell, units::radPerSecFromRpm(rpm), std::exp(SAME_DEPTH * at));
  return place->second;
}

}  // namespace smartmill::program
