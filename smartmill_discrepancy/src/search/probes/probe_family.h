#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "search/probes/mode_probes.h"
#include "search/projection.h"

namespace smartmill::discrepancy {

/// Current fit of a screening, from whose residual probes are located. Outlives the families.
struct ProbeContext {
  ProbeContext(const Projection& at_fit, const TwinRunner& twin, const MachineModel& machine,
               const FitResult& fit)
      : projection(at_fit),
        runner(twin),
        model(machine),
        now(fit),
        modes(twin, machine, at_fit.thinned().rows()) {}

  const Projection& projection;
  const TwinRunner& runner;
  const MachineModel& model;
  const FitResult& now;
  const ModeProbes modes;
};

using Probes = std::vector<Hypothesis::Probe>;

/// Locates the probes of effects whose place is not known beforehand: the frequency of a mode, the order of a
/// line. One family serves one Hypothesis::SearchStrategy; the list is in probe_finder.cpp.
class ProbeFamily {
 public:
  virtual ~ProbeFamily() = default;
  virtual Probes probesOf(const Hypothesis& hypothesis) = 0;
};

std::unique_ptr<ProbeFamily> makeSensorModes(const ProbeContext& context);
std::unique_ptr<ProbeFamily> makeTipModes(const ProbeContext& context);
std::unique_ptr<ProbeFamily> makeSpindleOrders(const ProbeContext& context);
std::unique_ptr<ProbeFamily> makeFreeOrders(const ProbeContext& context);

/// Probes of any hypothesis: the stated ones, or those of its family.
class ProbeFinder {
 public:
  ProbeFinder(const Projection& projection, const TwinRunner& runner, const MachineModel& model,
              const FitResult& now);
  Probes probesOf(const Hypothesis& hypothesis);

 private:
  ProbeContext context_;
  std::map<Hypothesis::SearchStrategy, std::unique_ptr<ProbeFamily>> families_;
};

/// Adds the point at which one coordinate is 1 and the others are those of the null point.
void addUnitPoint(Hypothesis::Probe& probe, std::size_t coordinate);

}  // namespace smartmill::discrepancy
