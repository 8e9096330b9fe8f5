#include "twin/steady_test.h"

#include <cmath>

#include "smartmill_core/cutting/contact_arc.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

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
      lead_in_(options.lead_in),
      variation_(options.speed_variation),
      // A linear rise is on average half a step before the end of the step.
      rise_(engagementRise(machine.vibrates()) + 2.0 * options.early_entry),
      machine_(machine),
      // Tolerance for a rounded time stamp of the engagement.
      start_(test.engage_time.value_or(begin - 1.0) - 1e-3 / test.sample_rate) {
  if (!cut()) return;
  model.needCutting("simulate a cut");
  const double feed = test.engagement->feed_per_tooth * model.needTool("simulate a cut").teeth *
                      test.spindle_speed / units::TWO_PI;
  feed_ = {feed * std::cos(test.feed_direction), feed * std::sin(test.feed_direction)};
}

void SteadyTest::inputAt(double t, CuttingMachine::Input& input) const {
  const double turn = test_.spindle_speed * (t - begin_);
  input.motion.angle = phase_ + (variation_ ? variation_->angle(turn) : turn);
  input.motion.speed = test_.spindle_speed * (variation_ ? variation_->speed(turn) : 1.0);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    input.motion.velocity[axis] = feed_[axis];
    input.motion.centre[axis] = feed_[axis] * (t - begin_);
  }
}

void SteadyTest::next(double t, CuttingMachine::Input& input) {
  inputAt(t, input);
  if (!engaged_ && cut() && t >= start_) engage(input.motion, test_.engagement->axial_depth);
}

void SteadyTest::leadIn() {
  // Independent of the model, so that differences between models are smooth.
  const double time = *test_.running_before < lead_in_.least_steady ? *test_.running_before : lead_in_.time;
  const auto steps = static_cast<long>(time * test_.sample_rate * substeps_);
  const double step = 1.0 / test_.sample_rate / substeps_;
  CuttingMachine::Input input;
  CuttingMachine::Output out;
  for (long k = steps; k > 0; --k) {
    inputAt(begin_ - static_cast<double>(k) * step, input);
    if (cut() && (k % lead_in_.steps == 0 || !engaged_)) {
      const double share =
          lead_in_.first_depth +
          (1.0 - lead_in_.first_depth) *
              growth(static_cast<double>(steps - k) / (lead_in_.growing_share * static_cast<double>(steps)));
      if (!engaged_) engage(input.motion, share * test_.engagement->axial_depth);
      machine_.setDepth(share * test_.engagement->axial_depth);
    }
    machine_.step(input, out);
  }
  if (engaged_)
    machine_.setDepth(test_.engagement->axial_depth,
                      std::hypot(feed_[0], feed_[1]) * (*test_.running_before - time));
}

void SteadyTest::engage(const ToolMotion& now, double depth) {
  Engagement engagement = *test_.engagement;
  engagement.axial_depth = depth;
  machine_.engage(contactArcs(engagement, test_.feed_direction), now, rise_ * substeps_);
  engaged_ = true;
}

}  // namespace smartmill::sim
