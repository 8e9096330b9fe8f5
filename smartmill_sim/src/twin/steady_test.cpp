#include "twin/steady_test.h"

#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

// Lead-in before a record of a running cut. The depth of cut grows over its first part: a sudden full cut
// would excite a long transient.
constexpr double LEAD_IN = 0.4;        // [s]
constexpr double LEAST_STEADY = 0.1;   // [s] shorter times before the record are simulated as they are
constexpr double GROWING_SHARE = 0.6;  // [1] of the lead-in
constexpr double LEAST_GROWTH = 0.01;  // [1] of the depth at the beginning
constexpr long GROWTH_STEPS = 32;      // between two depths

// Smooth step from 0 at 0 to 1 at 1.
double growth(double x) {
  return x >= 1.0 ? 1.0 : x * x * (3.0 - 2.0 * x);
}

}  // namespace

SteadyTest::SteadyTest(const MachineModel& model, const CampaignTest& test, double phase, double begin,
                       const SimulationOptions& options, CuttingMachine& machine)
    : test_(test),
      phase_(phase),
      begin_(begin),
      substeps_(options.substeps),
      // A linear rise is on average half a step before the end of the step.
      rise_(engagementRise(machine.vibrates()) + 2.0 * options.early_entry),
      machine_(machine),
      // Tolerance for a rounded time stamp of the engagement.
      start_(test.engage_time.value_or(begin - 1.0) - 1e-3 / test.sample_rate) {
  if (!cut()) return;
  model.needCutting("simulate a cut");
  feed_ = test.engagement->feed_per_tooth * model.needTool("simulate a cut").teeth * test.spindle_speed /
          units::TWO_PI;
}

void SteadyTest::inputAt(double t, CuttingMachine::Input& input) const {
  input.motion.angle = phase_ + test_.spindle_speed * (t - begin_);
  input.motion.speed = test_.spindle_speed;
  input.motion.velocity[0] = feed_;
  input.motion.centre[0] = feed_ * (t - begin_);
}

void SteadyTest::next(double t, CuttingMachine::Input& input) {
  inputAt(t, input);
  if (!engaged_ && cut() && t >= start_) engage(input.motion, test_.engagement->axial_depth);
}

void SteadyTest::leadIn() {
  // Independent of the model, so that differences between models are smooth.
  const double time = *test_.running_before < LEAST_STEADY ? *test_.running_before : LEAD_IN;
  const auto steps = static_cast<long>(time * test_.sample_rate * substeps_);
  const double step = 1.0 / test_.sample_rate / substeps_;
  CuttingMachine::Input input;
  CuttingMachine::Output out;
  for (long k = steps; k > 0; --k) {
    inputAt(begin_ - static_cast<double>(k) * step, input);
    if (cut() && (k % GROWTH_STEPS == 0 || !engaged_)) {
      const double share =
          LEAST_GROWTH + (1.0 - LEAST_GROWTH) * growth(static_cast<double>(steps - k) /
                                                       (GROWING_SHARE * static_cast<double>(steps)));
      if (!engaged_) engage(input.motion, share * test_.engagement->axial_depth);
      machine_.setDepth(share * test_.engagement->axial_depth);
    }
    machine_.step(input, out);
  }
  if (engaged_) machine_.setDepth(test_.engagement->axial_depth, feed_ * (*test_.running_before - time));
}

void SteadyTest::engage(const ToolMotion& now, double depth) {
  machine_.engage({{test_.engagement->entry, test_.engagement->exit, depth}}, now, rise_ * substeps_);
  engaged_ = true;
}

}  // namespace smartmill::sim
