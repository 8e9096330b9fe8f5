#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "solvers/element_response.h"
#include "solvers/period_map.h"

// Chebyshev collocation of the feedback force. On each element the force is the polynomial through its values
// at the Chebyshev-Lobatto nodes. The response of the modes to it is exact (convolution with exp(s t) in
// closed form), so only the force has to be resolved, and the free motion between cuts has no error. Elements
// end at the breaks.

namespace smartmill::stability {
namespace {

/// [1] Tolerance of an eigenvalue for the tolerance of the depth in the options.
double eigenvalueTolerance(const SolverOptions& options) {
  if (options.many) return COLLOCATION.eigenvalue_share_of_many * options.tolerance;
  return std::clamp(COLLOCATION.eigenvalue_share * options.tolerance, COLLOCATION.finest_eigenvalue,
                    COLLOCATION.coarsest_eigenvalue);
}

class Collocation : public FloquetSolver {
 public:
  Collocation(const RegenerativeSystem& system, const SolverOptions& options)
      : FloquetSolver(system, options),
        reference_(std::make_shared<ReferenceElement>(options.nodes > 0 ? options.nodes : COLLOCATION.nodes)),
        with_velocity_(system.hasProcessDamping()),
        table_(options.many && fastestOf(system.modes, 0.0) > 0.0
                   ? std::make_shared<ResponseTable>(system.modes, *reference_, with_velocity_)
                   : nullptr) {}

  class Speed : public AtSpeed {
   public:
    Speed(const Collocation& solver, double speed)
        : system_(solver.system_),
          speed_(speed),
          responses_(system_.modes, solver.reference_, solver.with_velocity_, solver.table_) {
      responses_.eigenvalue_tolerance = eigenvalueTolerance(solver.options_);
    }

    CharacteristicMultiplier multiplier(double depth) override {
      const DelayedSystem delayed = delayedSystem(system_, speed_, depth);
      return {PeriodMap(delayed, responses_).dominant(false).value, delayed.period};
    }

    double chatterFrequency(double depth) override { return motion(depth).second; }

    std::pair<CharacteristicMultiplier, double> motion(double depth) override {
      const DelayedSystem delayed = delayedSystem(system_, speed_, depth);
      PeriodMap map(delayed, responses_);
      const Dominant dominant = map.dominant(true);
      return {{dominant.value, delayed.period}, map.strongest(dominant, highestOf(system_))};
    }

   private:
    RegenerativeSystem system_;
    double speed_;
    ResponseCache responses_;
  };

  std::unique_ptr<AtSpeed> at(double speed) const override { return std::make_unique<Speed>(*this, speed); }

  std::unique_ptr<FloquetSolver> refined() const override {
    SolverOptions finer = options_;
    finer.nodes = reference_->n + COLLOCATION.refinement;
    finer.estimate_error = false;
    return std::make_unique<Collocation>(system_, finer);
  }

 private:
  std::shared_ptr<const ReferenceElement> reference_;
  bool with_velocity_;
  std::shared_ptr<const ResponseTable> table_;
};

}  // namespace

std::unique_ptr<FloquetSolver> makeCollocation(const RegenerativeSystem& system,
                                               const SolverOptions& options) {
  if (options.nodes != 0 && (options.nodes < 4 || options.nodes > 40 + COLLOCATION.refinement))
    throw Error("nodes: " + std::to_string(options.nodes) + ": expected 4..40");
  return std::make_unique<Collocation>(system, options);
}

CharacteristicMultiplier collocationMultiplier(const DelayedSystem& system, int nodes) {
  if (nodes < 4 || nodes > 40) throw Error("nodes: " + std::to_string(nodes) + ": expected 4..40");
  ResponseCache responses(system.modes, std::make_shared<ReferenceElement>(nodes), true);
  return {PeriodMap(system, responses).dominant(false).value, system.period};
}

}  // namespace smartmill::stability
