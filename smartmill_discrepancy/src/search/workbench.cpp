#include "smartmill_discrepancy/search/workbench.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_discrepancy/data/phase.h"
#include "smartmill_discrepancy/gap/asked.h"
#include "smartmill_sim/twin/guide.h"

namespace smartmill::discrepancy {
namespace {

std::vector<std::size_t> testsOf(const Dataset& data, bool heldout) {
  std::vector<std::size_t> tests;
  for (std::size_t t = 0; t < data.tests.size(); ++t) {
    if (data.tests[t].heldout == heldout) tests.push_back(t);
  }
  return tests;
}

bool guides(const TestData& test, const MachineModel& nominal) {
  const bool modes = !nominal.tool_tip.x.modes.empty() || !nominal.tool_tip.y.modes.empty();
  return modes && test.test.kind == TestKind::cut && !test.heldout && !test.test.running_before &&
         sim::Guide::canBe(test.record);
}

constexpr int QUICK_SLICES = 4;  // of a tool's corner, of the quick twin

// Of the quick twin where nothing guides it: with too few steps it chatters elsewhere than the machine, and a
// fit goes where it does not. Beyond twice the steps refineQuick() is for where it must be.
int freeSubsteps(const Dataset& data, const WorkbenchOptions& options) {
  constexpr double STEPS = 12.0;  // a period
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

// Of each block, by what a model leaves.
std::vector<Whitening> whiteningOf(const TwinRunner& runner, const MachineModel& model) {
  std::vector<double> left = runner.simulate(model);
  for (std::size_t i = 0; i < left.size(); ++i) left[i] = runner.measured()[i] - left[i];
  std::vector<Whitening> of_blocks;
  for (const Block& b : runner.blocks()) of_blocks.emplace_back(&left[b.offset], b.size);
  return of_blocks;
}

// A value that is moved by u.r has the variance of lines of random phase, which is largest where u lies at
// the lines of what is left: as that of independent samples of so much more noise, of which so many count.
Trust trustOf(const std::vector<double>& left) {
  double sum = 0.0, squares = 0.0, all = 0.0;
  for (const double r : left) all += r * r;
  const std::vector<double> power = powerOf(left.data(), left.size());
  for (const double p : power) {
    sum += p;
    squares += p * p;
  }
  const double mean_square = all / static_cast<double>(left.size());
  if (!(sum > 0.0) || !std::isfinite(sum)) return {};
  // Of white noise the mean of squares is twice the square of the mean.
  const double gathered = std::max(1.0, 0.5 * static_cast<double>(power.size()) * squares / (sum * sum));
  const double noise = std::sqrt(std::max(1.0, gathered * mean_square));
  return {noise, std::min(1.0, mean_square / (noise * noise))};
}

// One step of Gauss and Newton of where each record lies. @return the largest turn [rad]
double turnOnce(const TwinRunner& runner, const MachineModel& model, Dataset* data) {
  constexpr double MOST = 0.3;  // [rad]
  const SimulatedBlocks base = runner.simulateBlocks({model}).front();
  const std::vector<double> simulated = runner.joined(base);
  const auto size = static_cast<Eigen::Index>(simulated.size());
  const Eigen::VectorXd apart = Eigen::Map<const Eigen::VectorXd>(runner.measured().data(), size) -
                                Eigen::Map<const Eigen::VectorXd>(simulated.data(), size);
  double largest = 0.0;
  for (std::size_t k = 0; k < runner.tests().size(); ++k) {
    TestData& test = data->tests[runner.tests()[k]];
    const std::vector<TurnFreedom> free = turnFreedoms(test);
    if (free.empty()) continue;
    std::vector<SimulatedBlocks> moved;
    std::vector<double> steps;
    Eigen::VectorXd precision(static_cast<Eigen::Index>(free.size())), pull = precision;
    for (const TurnFreedom& f : free) {
      const auto at = static_cast<Eigen::Index>(moved.size());
      precision[at] = 1.0 / (f.prior_std * f.prior_std);
      pull[at] = f.value == &Turn::entry ? -precision[at] * test.early_entry : 0.0;
      Turn step;
      step.*f.value = f.step;
      moved.push_back(runner.turned(model, base, k, step));
      steps.push_back(f.step);
    }
    const BlockColumns columns(runner, base, moved, steps);
    Eigen::MatrixXd information = columns.gram();
    information.diagonal() += precision;
    const Eigen::VectorXd right = columns.along(apart) + pull;
    const Eigen::VectorXd found = linear::solveSymmetric(information, right);
    Turn by;
    for (std::size_t f = 0; f < free.size(); ++f) by.*free[f].value = found[static_cast<Eigen::Index>(f)];
    const double turn = std::max(std::abs(by.middle), std::abs(by.end));
    if (!found.allFinite() || turn > MOST) continue;
    turnRecord(test, by);
    largest = std::max(largest, turn);
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
                             [&](const TestData& t) { return guides(t, data.nominal); })),
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
  trustAt(stated);
}

void Workbench::readGuidance() {
  for (TwinRunner* runner : {&quick_runner_, &exact_runner_, &guided_runner_, &heldout_runner_})
    runner->readGuidance();
}

void Workbench::trustAt(const FitState& state) {
  const auto& tests = exact_runner_.tests();
  if (std::none_of(tests.begin(), tests.end(), [&](std::size_t t) { return data_.tests[t].guided; })) return;
  turnFitted(state);
  const TwinRunner& runner = exact_runner_;
  const std::vector<double> simulated = runner.simulate(quick_.model(state));
  for (const Block& b : runner.blocks()) {
    TestData& test = data_.tests[b.test];
    if (!test.guided) continue;
    std::vector<double> left(b.size);
    const double scale = b.noise / (b.slow ? b.slow->noise : data_.noise.at(b.channel));
    for (std::size_t i = 0; i < b.size; ++i)
      left[i] = scale * (simulated[b.offset + i] - runner.measured()[b.offset + i]);
    test.trust[b.channel] = trustOf(left);
  }
  readGuidance();
}

void Workbench::guideNearLimit(const FitState& state) {
  if (!can_guide_ || guided_) return;
  turnFitted(state);
  const MachineModel model = quick_.model(state);
  bool any = false;
  const auto look = [&](const TwinRunner& free, const std::vector<double>& freely, const TwinRunner& led,
                        const std::vector<double>& guided) {
    constexpr double CLEARLY = 4.0;  // deviations of squares of noise
    std::map<std::size_t, double> gain, samples;
    for (const Block& b : free.blocks()) {
      for (std::size_t i = b.offset; i < b.offset + b.size; ++i)
        gain[b.test] +=
            std::pow(freely[i] - free.measured()[i], 2) - std::pow(guided[i] - led.measured()[i], 2);
      samples[b.test] += static_cast<double>(b.size);
    }
    for (const auto& [t, gained] : gain) {
      TestData& test = data_.tests[t];
      if (test.guided || !canBeLed(test, data_.nominal) || !(gained > CLEARLY * std::sqrt(2.0 * samples[t])))
        continue;
      test.guided = any = true;
    }
  };
  look(exact_runner_, exact_runner_.simulate(model), guided_runner_, guided_runner_.simulate(model));
  const std::vector<double> freely = heldout_runner_.simulate(model);
  heldout_runner_.setGuided(true);
  const std::vector<double> guided = heldout_runner_.simulate(model);
  heldout_runner_.setGuided(false);
  look(heldout_runner_, freely, heldout_runner_, guided);
  if (any) readGuidance();
}

// The records and the exact twin; the quick one stays where its tangents were taken.
void Workbench::turnFitted(const FitState& state) {
  const std::vector<std::size_t>& tests = exact_runner_.tests();
  for (std::size_t k = 0; k < tests.size(); ++k) {
    TestData& t = data_.tests[tests[k]];
    t.test.spindle_speed = loaded_[k].test.spindle_speed;
    t.early_entry = loaded_[k].early_entry;
    if (t.phase_estimated) t.record.add("spindle_angle") = loaded_[k].record.column("spindle_angle");
  }
  std::vector<Turn> by(tests.size());
  for (std::size_t k = 0; k < state.turns.size(); ++k)
    by[quick_.turns()[k].chosen].*quick_.turns()[k].freedom.value = state.turns[k];
  for (std::size_t k = 0; k < tests.size(); ++k) turnRecord(data_.tests[tests[k]], by[k]);
  exact_runner_.readPhases();
  guided_runner_.readPhases();
}

void Workbench::correctAt(const FitState& state, double* exact_squares) {
  const MachineModel model = quick_.model(state);
  turnFitted(state);
  quick_runner_.readPhases();
  const std::vector<double> simulated = fitted().simulate(model);
  if (exact_squares) *exact_squares = squaresLeft(fitted(), simulated);
  quick_runner_.correctTo(model, simulated);
}

NominalTangents Workbench::linearise(const FitState& state, double* exact_squares) {
  correctAt(state, exact_squares);
  const SimulatedBlocks said = quick_runner_.simulateBlocks({quick_.model(state)}).front();
  const bool hold = taken_ && taken_->state == state &&
                    std::equal(said.begin(), said.end(), taken_->said.begin(), taken_->said.end(),
                               [](const auto& a, const auto& b) { return a == b || *a == *b; });
  if (!hold) taken_ = Taken{state, said, quick_.nominalTangents(state)};
  return taken_->tangents;
}

NominalTangents Workbench::lineariseBy(NominalTangents tangents, const FitState& state,
                                       double* exact_squares) {
  correctAt(state, exact_squares);
  tangents.at = state.nominal;
  tangents.turns = state.turns;
  tangents.turns.resize(quick_.turns().size(), 0.0);
  return tangents;
}

double Workbench::exactSquares(const FitState& state) {
  turnFitted(state);
  return exactSquaresHere(state);
}

double Workbench::freeSquares(const FitState& state) {
  turnFitted(state);
  return squaresLeft(exact_runner_, exact_runner_.simulate(quick_.model(state)));
}

void Workbench::guide(bool guided) {
  guided_ = guided && can_guide_;
  for (TestData& t : data_.tests) t.guided = t.chatter.has_value();
  readGuidance();
  quick_runner_.setGuided(guided_);
  if (!refined_)
    quick_runner_.setFineness(guided_ ? options_.screening_substeps : freeSubsteps(data_, options_),
                              QUICK_SLICES);
  heldout_runner_.setGuided(guided_);
}

bool Workbench::weighBy(const FitState& state) {
  weighAlike();
  if (guided_) return false;
  turnTo(state);
  const MachineModel model = quick_.model(state);
  const std::vector<Whitening> of_fitted = whiteningOf(fitted(), model),
                               of_heldout = whiteningOf(heldout_runner_, model);
  const auto changes = [](const Whitening& w) { return w.changes(); };
  if (std::none_of(of_fitted.begin(), of_fitted.end(), changes)) return false;
  for (TwinRunner* runner : {&quick_runner_, &exact_runner_, &guided_runner_})
    runner->setWhitening(of_fitted);
  heldout_runner_.setWhitening(of_heldout);
  return true;
}

void Workbench::weighAlike() {
  for (TwinRunner* runner : {&quick_runner_, &exact_runner_, &guided_runner_, &heldout_runner_})
    runner->setWhitening({});
}

double Workbench::exactSquaresHere(const FitState& state) const {
  return squaresLeft(fitted(), fitted().simulate(quick_.model(state)));
}

bool Workbench::refineQuick() {
  constexpr int FINER = 4;
  if (quick_runner_.substeps() >= exact_runner_.substeps()) return false;
  refined_ = true;
  quick_runner_.setFineness(std::min(FINER * quick_runner_.substeps(), exact_runner_.substeps()),
                            CORNER_SLICES);
  return true;
}

double Workbench::turnPhases(FitState& state) {
  // Fits find what is less better, by every sample and with what else is free: turned back and forth between
  // two answers nothing would settle.
  constexpr double FITTED = 0.05;  // [rad]
  if (!phases_estimated_) return 0.0;
  turnFitted(state);
  const double turn = discrepancy::turnPhases(data_, quick_.model(state), FITTED);
  heldout_runner_.readPhases();
  if (turn == 0.0) return turn;
  state.turns.clear();
  for (const Fitter::TurnOf& t : quick_.turns()) {
    const TestData& now = data_.tests[exact_runner_.tests()[t.chosen]];
    state.turns.push_back(turnBetween(loaded_[t.chosen], now).*t.freedom.value);
  }
  return turn;
}

void Workbench::turnTo(const FitState& state) {
  constexpr int PASSES = 3;
  constexpr double SETTLED = 1e-4;  // [rad]
  turnFitted(state);
  for (int pass = 0; pass < PASSES; ++pass) {
    const MachineModel model = quick_.model(state);
    const double turn = turnOnce(heldout_runner_, model, &data_);
    heldout_runner_.readPhases();
    if (turn < SETTLED) return;
  }
}

}  // namespace smartmill::discrepancy
