#include "smartmill_discrepancy/search/record_alignments.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_discrepancy/data/alignment.h"

namespace smartmill::discrepancy {
namespace {

struct RecordAlignmentOptions {
  /// [rad] Smaller rotations are left to the fits, which use all samples and free values; correcting them
  /// here would alternate between two solutions.
  double min_rotation = 0.05;
  int heldout_passes = 3;           ///< Gauss-Newton steps of held-out records, which converge quadratically
  double heldout_tolerance = 1e-4;  ///< [rad] of the last step
  double max_step = 0.3;            ///< [rad] range in which the derivatives of a rotation are valid
};

const RecordAlignmentOptions LIMITS;

// The alignment of one record that minimises its residual if the twin is linear in it.
RecordAlignment linearOptimum(const TwinRunner& runner, const MachineModel& model,
                              const SimulatedChannels& base, const Eigen::VectorXd& residual,
                              std::size_t chosen, const std::vector<AlignmentFreedom>& free) {
  const TestData& test = runner.data().tests[runner.tests()[chosen]];
  std::vector<SimulatedChannels> moved;
  std::vector<double> steps;
  Eigen::VectorXd precision(static_cast<Eigen::Index>(free.size())), pull = precision;
  for (const AlignmentFreedom& f : free) {
    const auto at = static_cast<Eigen::Index>(moved.size());
    precision[at] = 1.0 / (f.prior_std * f.prior_std);
    pull[at] = f.value == &RecordAlignment::entry ? -precision[at] * test.early_entry : 0.0;
    RecordAlignment step;
    step.*f.value = f.step;
    moved.push_back(runner.realigned(model, base, chosen, step));
    steps.push_back(f.step);
  }
  const SparseColumns columns(runner, base, moved, steps);
  Eigen::MatrixXd information = columns.gram();
  information.diagonal() += precision;
  const Eigen::VectorXd right = columns.along(residual) + pull;
  const Eigen::VectorXd found = linear::solveSymmetric(information, right);
  RecordAlignment by;
  for (std::size_t f = 0; f < free.size(); ++f) by.*free[f].value = found[static_cast<Eigen::Index>(f)];
  return by;
}

bool isFinite(const RecordAlignment& by) {
  return std::isfinite(by.phase) && std::isfinite(by.drift) && std::isfinite(by.entry);
}

}  // namespace

RecordAlignments::RecordAlignments(Twins& twins, const Fitter& fitter)
    : twins_(twins),
      fitter_(fitter),
      phases_estimated_(std::any_of(twins.data.tests.begin(), twins.data.tests.end(),
                                    [](const TestData& t) { return t.phase_estimated; })) {
  for (const std::size_t t : twins.exact.tests()) loaded_.push_back(twins.data.tests[t]);
}

void RecordAlignments::alignFitted(const FitState& state) {
  const std::vector<std::size_t>& tests = twins_.exact.tests();
  for (std::size_t k = 0; k < tests.size(); ++k) {
    TestData& t = twins_.data.tests[tests[k]];
    t.test.spindle_speed = loaded_[k].test.spindle_speed;
    t.early_entry = loaded_[k].early_entry;
    if (t.phase_estimated) t.record.add("spindle_angle") = loaded_[k].record.column("spindle_angle");
  }
  std::vector<RecordAlignment> by(tests.size());
  for (std::size_t k = 0; k < state.alignment.size(); ++k)
    by[fitter_.alignment()[k].chosen].*fitter_.alignment()[k].freedom.value = state.alignment[k];
  for (std::size_t k = 0; k < tests.size(); ++k) alignRecord(twins_.data.tests[tests[k]], by[k]);
  twins_.exact.readPhases();
  twins_.guided.readPhases();
}

double RecordAlignments::alignPhases(FitState& state) {
  if (!phases_estimated_) return 0.0;
  alignFitted(state);
  const double moved = discrepancy::alignPhases(twins_.data, fitter_.model(state), LIMITS.min_rotation);
  twins_.heldout.readPhases();
  if (moved == 0.0) return moved;
  state.alignment.clear();
  for (const Fitter::FreeAlignment& t : fitter_.alignment()) {
    const TestData& now = twins_.data.tests[twins_.exact.tests()[t.chosen]];
    state.alignment.push_back(alignmentBetween(loaded_[t.chosen], now).*t.freedom.value);
  }
  return moved;
}

void RecordAlignments::alignTo(const FitState& state) {
  alignFitted(state);
  const MachineModel model = fitter_.model(state);
  for (int pass = 0; pass < LIMITS.heldout_passes; ++pass) {
    const double moved = alignHeldoutOnce(model);
    twins_.heldout.readPhases();
    if (moved < LIMITS.heldout_tolerance) return;
  }
}

// One Gauss-Newton step of each held-out record. @return largest rotation [rad]
double RecordAlignments::alignHeldoutOnce(const MachineModel& model) {
  const TwinRunner& runner = twins_.heldout;
  const SimulatedChannels base = runner.simulateChannels({model}).front();
  const std::vector<double> simulated = runner.joined(base);
  const auto size = static_cast<Eigen::Index>(simulated.size());
  const Eigen::VectorXd residual = Eigen::Map<const Eigen::VectorXd>(runner.measured().data(), size) -
                                   Eigen::Map<const Eigen::VectorXd>(simulated.data(), size);
  double largest = 0.0;
  for (std::size_t k = 0; k < runner.tests().size(); ++k) {
    TestData& test = twins_.data.tests[runner.tests()[k]];
    const std::vector<AlignmentFreedom> free = alignmentFreedoms(test);
    if (free.empty()) continue;
    const RecordAlignment by = linearOptimum(runner, model, base, residual, k, free);
    const double rotation = std::max(std::abs(by.phase), std::abs(by.drift));
    if (!isFinite(by) || rotation > LIMITS.max_step) continue;
    alignRecord(test, by);
    largest = std::max(largest, rotation);
  }
  return largest;
}

}  // namespace smartmill::discrepancy
