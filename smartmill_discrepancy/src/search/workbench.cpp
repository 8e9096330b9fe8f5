#include "smartmill_discrepancy/search/workbench.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_discrepancy/data/alignment.h"
#include "smartmill_discrepancy/gap/scale_evidence.h"
#include "smartmill_sim/twin/tip_trajectory.h"

namespace smartmill::discrepancy {
namespace {

std::vector<std::size_t> testsOf(const Dataset& data, bool heldout) {
  std::vector<std::size_t> tests;
  for (std::size_t t = 0; t < data.tests.size(); ++t) {
    if (data.tests[t].heldout == heldout) tests.push_back(t);
  }
  return tests;
}

bool isGuidable(const TestData& test, const MachineModel& nominal) {
  return hasToolModes(nominal) && test.test.kind == TestKind::cut && !test.heldout &&
         !test.test.running_before && sim::TipTrajectory::isAvailable(test.record);
}

constexpr int QUICK_SLICES = 4;  // of a tool's corner, for the quick twin

// Of the unguided quick twin: with too few steps per period its stability limit is wrong and misleads the
// fit. More than twice the steps are left to refineQuick().
int freeSubsteps(const Dataset& data, const WorkbenchOptions& options) {
  constexpr double STEPS = 12.0;  // per period
  constexpr double MOST = 2.0;
  double substeps = options.screening_substeps;
  for (const ModalModel* axis : {&data.nominal.tool_tip.x, &data.nominal.tool_tip.y}) {
    for (const Mode& mode : axis->modes) {
      for (const TestData& t : data.tests) {
        if (t.test.kind == TestKind::cut)
          substeps = std::max(substeps, std::ceil(STEPS * mode.frequency / t.test.sample_rate));
      }
    }
  }
  const double most = std::max(MOST, static_cast<double>(options.screening_substeps));
  return std::min(static_cast<int>(std::min(substeps, most)), options.final_substeps);
}

// By span, from the residual of a model.
std::vector<Whitening> whiteningOf(const TwinRunner& runner, const MachineModel& model) {
  const std::vector<double> residual = residualOf(runner, model);
  std::vector<Whitening> of_spans;
  for (const ChannelSpan& b : runner.spans()) of_spans.emplace_back(&residual[b.offset], b.size);
  return of_spans;
}

// A value displaced by u.r has the variance of lines of random phase, largest if u overlaps the lines of the
// residual: equivalent to more noise with fewer independent samples.
ChannelWeight weightOf(const std::vector<double>& residual) {
  double sum = 0.0, squares = 0.0, all = 0.0;
  for (const double r : residual) all += r * r;
  const std::vector<double> power = powerSpectrum(residual.data(), residual.size());
  for (const double p : power) {
    sum += p;
    squares += p * p;
  }
  const double mean_square = all / static_cast<double>(residual.size());
  if (!(sum > 0.0) || !std::isfinite(sum)) return {};
  // For white noise the mean of squares is twice the square of the mean.
  const double concentration = std::max(1.0, 0.5 * static_cast<double>(power.size()) * squares / (sum * sum));
  const double noise = std::sqrt(std::max(1.0, concentration * mean_square));
  return {noise, std::min(1.0, mean_square / (noise * noise))};
}

// One Gauss-Newton step of each record's alignment. @return largest rotation [rad]
double alignOnce(const TwinRunner& runner, const MachineModel& model, Dataset* data) {
  constexpr double MOST = 0.3;  // [rad]
  const SimulatedChannels base = runner.simulateChannels({model}).front();
  const std::vector<double> simulated = runner.joined(base);
  const auto size = static_cast<Eigen::Index>(simulated.size());
  const Eigen::VectorXd residual = Eigen::Map<const Eigen::VectorXd>(runner.measured().data(), size) -
                                   Eigen::Map<const Eigen::VectorXd>(simulated.data(), size);
  double largest = 0.0;
  for (std::size_t k = 0; k < runner.tests().size(); ++k) {
    TestData& test = data->tests[runner.tests()[k]];
    const std::vector<AlignmentFreedom> free = alignmentFreedoms(test);
    if (free.empty()) continue;
    std::vector<SimulatedChannels> moved;
    std::vector<double> steps;
    Eigen::VectorXd precision(static_cast<Eigen::Index>(free.size())), pull = precision;
    for (const AlignmentFreedom& f : free) {
      const auto at = static_cast<Eigen::Index>(moved.size());
      precision[at] = 1.0 / (f.prior_std * f.prior_std);
      pull[at] = f.value == &RecordAlignment::entry ? -precision[at] * test.early_entry : 0.0;
      RecordAlignment step;
      step.*f.value = f.step;
      moved.push_back(runner.realigned(model, base, k, step));
      steps.push_back(f.step);
    }
    const SparseColumns columns(runner, base, moved, steps);
    Eigen::MatrixXd information = columns.gram();
    information.diagonal() += precision;
    const Eigen::VectorXd right = columns.along(residual) + pull;
    const Eigen::VectorXd found = linear::solveSymmetric(information, right);
    RecordAlignment by;
    for (std::size_t f = 0; f < free.size(); ++f) by.*free[f].value = found[static_cast<Eigen::Index>(f)];
    const double rotation = std::max(std::abs(by.phase), std::abs(by.drift));
    if (!found.allFinite() || rotation > MOST) continue;
    alignRecord(test, by);
    largest = std::max(largest, rotation);
  }
  return largest;
}

}  // namespace

Workbench::Workbench(const Dataset& data, const WorkbenchOptions& options)
    : options_(options),
      data_(data),
      freedom_(data.nominal),
      phases_estimated_(std::any_of(data.tests.begin(), data.tests.end(),
                                    [](const TestData& t) { return t.phase_estimated; })),
      can_guide_(std::any_of(data.tests.begin(), data.tests.end(),
                             [&](const TestData& t) { return isGuidable(t, data.nominal); })),
      quick_runner_(data_, testsOf(data_, false), options.threads, freeSubsteps(data_, options)),
      exact_runner_(data_, testsOf(data_, false), options.threads, options.final_substeps),
      guided_runner_(data_, testsOf(data_, false), options.threads, options.final_substeps),
      heldout_runner_(data_, testsOf(data_, true), options.threads, options.final_substeps),
      quick_(quick_runner_, freedom_, options.cancelled),
      exact_(exact_runner_, freedom_, options.cancelled) {
  quick_runner_.setFineness(quick_runner_.substeps(), QUICK_SLICES);
  guided_runner_.setGuided(true);
  for (const std::size_t t : exact_runner_.tests()) loaded_.push_back(data_.tests[t]);
  FitState stated;
  stated.nominal.assign(freedom_.coordinates().size(), 0.0);
  updateWeights(stated);
}

void Workbench::readGuidance() {
  for (TwinRunner* runner : {&quick_runner_, &exact_runner_, &guided_runner_, &heldout_runner_})
    runner->readGuidance();
}

void Workbench::updateWeights(const FitState& state) {
  const auto& tests = exact_runner_.tests();
  if (std::none_of(tests.begin(), tests.end(), [&](std::size_t t) { return data_.tests[t].guided; })) return;
  alignFitted(state);
  const TwinRunner& runner = exact_runner_;
  const std::vector<double> simulated = runner.simulate(quick_.model(state));
  for (const ChannelSpan& b : runner.spans()) {
    TestData& test = data_.tests[b.test];
    if (!test.guided) continue;
    std::vector<double> residual(b.size);
    const double scale = b.noise / (b.slow ? b.slow->noise : data_.noise.at(b.channel));
    for (std::size_t i = 0; i < b.size; ++i)
      residual[i] = scale * (simulated[b.offset + i] - runner.measured()[b.offset + i]);
    test.weights[b.channel] = weightOf(residual);
  }
  readGuidance();
}

void Workbench::guideNearLimit(const FitState& state) {
  if (!can_guide_ || guided_) return;
  alignFitted(state);
  const MachineModel model = quick_.model(state);
  bool any = false;
  const auto markGuided = [&](const TwinRunner& free, const std::vector<double>& freely,
                              const TwinRunner& guided_runner, const std::vector<double>& guided) {
    constexpr double MIN_DEVIATIONS = 4.0;  // standard deviations of the squares of noise
    std::map<std::size_t, double> gain, samples;
    for (const ChannelSpan& b : free.spans()) {
      for (std::size_t i = b.offset; i < b.offset + b.size; ++i)
        gain[b.test] += std::pow(freely[i] - free.measured()[i], 2) -
                        std::pow(guided[i] - guided_runner.measured()[i], 2);
      samples[b.test] += static_cast<double>(b.size);
    }
    for (const auto& [t, gained] : gain) {
      TestData& test = data_.tests[t];
      if (test.guided || !canBeGuided(test, data_.nominal) ||
          !(gained > MIN_DEVIATIONS * std::sqrt(2.0 * samples[t])))
        continue;
      test.guided = any = true;
    }
  };
  markGuided(exact_runner_, exact_runner_.simulate(model), guided_runner_, guided_runner_.simulate(model));
  const std::vector<double> freely = heldout_runner_.simulate(model);
  heldout_runner_.setGuided(true);
  const std::vector<double> guided = heldout_runner_.simulate(model);
  heldout_runner_.setGuided(false);
  markGuided(heldout_runner_, freely, heldout_runner_, guided);
  if (any) readGuidance();
}

// Aligns the records and the exact twins; the quick one keeps the alignment of its derivatives.
void Workbench::alignFitted(const FitState& state) {
  const std::vector<std::size_t>& tests = exact_runner_.tests();
  for (std::size_t k = 0; k < tests.size(); ++k) {
    TestData& t = data_.tests[tests[k]];
    t.test.spindle_speed = loaded_[k].test.spindle_speed;
    t.early_entry = loaded_[k].early_entry;
    if (t.phase_estimated) t.record.add("spindle_angle") = loaded_[k].record.column("spindle_angle");
  }
  std::vector<RecordAlignment> by(tests.size());
  for (std::size_t k = 0; k < state.alignment.size(); ++k)
    by[quick_.alignment()[k].chosen].*quick_.alignment()[k].freedom.value = state.alignment[k];
  for (std::size_t k = 0; k < tests.size(); ++k) alignRecord(data_.tests[tests[k]], by[k]);
  exact_runner_.readPhases();
  guided_runner_.readPhases();
}

void Workbench::correctAt(const FitState& state, double* exact_squares) {
  const MachineModel model = quick_.model(state);
  alignFitted(state);
  quick_runner_.readPhases();
  const std::vector<double> simulated = fitted().simulate(model);
  if (exact_squares) *exact_squares = residualSquares(fitted(), simulated);
  quick_runner_.correctTo(model, simulated);
}

NominalTangents Workbench::linearise(const FitState& state, double* exact_squares) {
  correctAt(state, exact_squares);
  const SimulatedChannels simulated_there = quick_runner_.simulateChannels({quick_.model(state)}).front();
  const bool hold =
      last_linearised_ && last_linearised_->state == state &&
      std::equal(simulated_there.begin(), simulated_there.end(), last_linearised_->simulated_there.begin(),
                 last_linearised_->simulated_there.end(),
                 [](const auto& a, const auto& b) { return a == b || *a == *b; });
  if (!hold) last_linearised_ = LinearisedState{state, simulated_there, quick_.nominalTangents(state)};
  return last_linearised_->tangents;
}

NominalTangents Workbench::lineariseBy(NominalTangents tangents, const FitState& state,
                                       double* exact_squares) {
  correctAt(state, exact_squares);
  tangents.at = state.nominal;
  tangents.alignment = state.alignment;
  tangents.alignment.resize(quick_.alignment().size(), 0.0);
  return tangents;
}

double Workbench::exactSquares(const FitState& state) {
  alignFitted(state);
  return exactSquaresHere(state);
}

double Workbench::freeSquares(const FitState& state) {
  alignFitted(state);
  return residualSquares(exact_runner_, exact_runner_.simulate(quick_.model(state)));
}

void Workbench::setGuided(bool guided) {
  guided_ = guided && can_guide_;
  for (TestData& t : data_.tests) t.guided = t.chatter.has_value();
  readGuidance();
  quick_runner_.setGuided(guided_);
  if (!refined_)
    quick_runner_.setFineness(guided_ ? options_.screening_substeps : freeSubsteps(data_, options_),
                              QUICK_SLICES);
  heldout_runner_.setGuided(guided_);
}

bool Workbench::whitenAt(const FitState& state) {
  clearWhitening();
  if (guided_) return false;
  alignTo(state);
  const MachineModel model = quick_.model(state);
  const std::vector<Whitening> of_fitted = whiteningOf(fitted(), model),
                               of_heldout = whiteningOf(heldout_runner_, model);
  const auto changes = [](const Whitening& w) { return w.isActive(); };
  if (std::none_of(of_fitted.begin(), of_fitted.end(), changes)) return false;
  for (TwinRunner* runner : {&quick_runner_, &exact_runner_, &guided_runner_})
    runner->setWhitening(of_fitted);
  heldout_runner_.setWhitening(of_heldout);
  return true;
}

void Workbench::clearWhitening() {
  for (TwinRunner* runner : {&quick_runner_, &exact_runner_, &guided_runner_, &heldout_runner_})
    runner->setWhitening({});
}

double Workbench::exactSquaresHere(const FitState& state) const {
  return residualSquares(fitted(), fitted().simulate(quick_.model(state)));
}

bool Workbench::refineQuick() {
  constexpr int FINER = 4;
  if (quick_runner_.substeps() >= exact_runner_.substeps()) return false;
  refined_ = true;
  quick_runner_.setFineness(std::min(FINER * quick_runner_.substeps(), exact_runner_.substeps()),
                            CORNER_SLICES);
  return true;
}

double Workbench::alignPhases(FitState& state) {
  // Smaller rotations are left to the fits, which use all samples and free values; correcting them here would
  // alternate between two solutions.
  constexpr double MIN_ROTATION = 0.05;  // [rad]
  if (!phases_estimated_) return 0.0;
  alignFitted(state);
  const double moved = discrepancy::alignPhases(data_, quick_.model(state), MIN_ROTATION);
  heldout_runner_.readPhases();
  if (moved == 0.0) return moved;
  state.alignment.clear();
  for (const Fitter::FreeAlignment& t : quick_.alignment()) {
    const TestData& now = data_.tests[exact_runner_.tests()[t.chosen]];
    state.alignment.push_back(alignmentBetween(loaded_[t.chosen], now).*t.freedom.value);
  }
  return moved;
}

void Workbench::alignTo(const FitState& state) {
  constexpr int PASSES = 3;
  constexpr double TOLERANCE = 1e-4;  // [rad]
  alignFitted(state);
  for (int pass = 0; pass < PASSES; ++pass) {
    const MachineModel model = quick_.model(state);
    const double moved = alignOnce(heldout_runner_, model, &data_);
    heldout_runner_.readPhases();
    if (moved < TOLERANCE) return;
  }
}

}  // namespace smartmill::discrepancy
