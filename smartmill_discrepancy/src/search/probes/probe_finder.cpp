#include "search/probes/probe_family.h"

namespace smartmill::discrepancy {

ProbeFinder::ProbeFinder(const Projection& projection, const TwinRunner& runner, const MachineModel& model,
                         const FitResult& now)
    : context_(projection, runner, model, now) {
  using Strategy = Hypothesis::SearchStrategy;
  families_[Strategy::sensor_mode] = makeSensorModes(context_);
  families_[Strategy::tip_mode] = makeTipModes(context_);
  families_[Strategy::spindle_order] = makeSpindleOrders(context_);
  families_[Strategy::free_order] = makeFreeOrders(context_);
}

Probes ProbeFinder::probesOf(const Hypothesis& hypothesis) {
  const auto family = families_.find(hypothesis.strategy);
  return family == families_.end() ? hypothesis.probes : family->second->probesOf(hypothesis);
}

void addUnitPoint(Hypothesis::Probe& probe, std::size_t coordinate) {
  probe.points.push_back(probe.null);
  probe.points.back()[coordinate] = 1.0;
}

}  // namespace smartmill::discrepancy
