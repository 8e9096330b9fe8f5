#include "stability/control_study.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_sim/twin/cutting_machine.h"
#include "stability/reliability.h"

namespace smartmill::stability {
namespace {

constexpr int SAMPLES = 180, SUBSTEPS = 2;  // per programmed revolution
constexpr int PLACES = 8;                   // evaluated tip positions per tooth passing
constexpr int QUIET = 25;                   // repeating revolutions after which the chatter has ended
constexpr std::size_t BLOCK = 256;
constexpr double FEED = 0.1e-3;  // [m] per tooth
constexpr double STILL = 0.05;   // [1] of the feed per tooth: changes of the motion below it are ignored
constexpr double ANGLE_EVERY = 0.005, STATE_EVERY = 0.02;  // [s]

/// Whether the tip's motion repeats with the tooth passing, revolution by revolution, at any speed.
class Repetition {
 public:
  explicit Repetition(int teeth) : places_(teeth * PLACES), last_(static_cast<std::size_t>(PLACES)) {}

  /// @param angle [rad] turned @param tip [m]
  void at(double angle, const std::array<double, 2>& tip) {
    const double travelled = angle * places_ / units::TWO_PI;
    const auto place = static_cast<long>(travelled);
    if (place > place_ && travelled > last_travelled_)
      evaluate(place, tip, (static_cast<double>(place) - last_travelled_) / (travelled - last_travelled_));
    place_ = place;
    last_travelled_ = travelled;
    tip_ = tip;
  }
  bool repeats(std::size_t turn) const { return std::sqrt(change_[turn]) < STILL * FEED; }
  std::size_t turns() const { return change_.size() - 1; }  // whole ones
  /// First turn from which the last ones all repeat.
  std::size_t quietFrom() const {
    std::size_t turn = turns();
    while (turn > 0 && repeats(turn - 1)) --turn;
    return turn;
  }

 private:
  /// Interpolated between the last step and this one.
  void evaluate(long place, const std::array<double, 2>& tip, double share) {
    const auto turn = static_cast<std::size_t>(place / places_);
    if (change_.size() <= turn) change_.resize(turn + 1, 0.0);
    std::array<double, 2>& before = last_[static_cast<std::size_t>(place % PLACES)];
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double here = tip_[axis] + share * (tip[axis] - tip_[axis]);
      change_[turn] += std::pow(here - std::exchange(before[axis], here), 2) / places_;
    }
  }

  int places_;
  long place_ = 0;
  double last_travelled_ = 0.0;        // [positions] at the last step
  std::array<double, 2> tip_{{0, 0}};  // [m] then
  std::vector<std::array<double, 2>> last_;
  std::vector<double> change_;
};

/// A cutting machine with its measurement and control.
class ControlledCut {
 public:
  ControlledCut(const MachineModel& truth, const MachineModel& model, const RegenerativeSystem& believed,
                const ControlOptions& options, ControlCut& cut, unsigned seed)
      : options_(options),
        cut_(cut),
        teeth_(believed.teeth),
        step_(units::TWO_PI / (cut.speed * SAMPLES * SUBSTEPS)),
        machine_(truth, step_),
        belief_(UncertainSystem::of(model, believed)),
        repetition_(believed.teeth),
        random_(seed),
        detector_(options.detector, [this](const ChatterState& state) { judged(state); }),
        advisor_(
            options.control.spindle_low * cut.speed, options.control.spindle_high * cut.speed, believed.teeth,
            [believed](const CuttingCondition&) { return believed; }, [](const ChatterAdvice&) {},
            [this](const ChatterAdvice& advice) {
              // The following limits are only for display.
              control_.handle(advice);
              const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - judging_;
              cut_.thinking += passed.count();
            }),
        control_(options.control, options.detector.revolutions,
                 [this](const Engagement&) { return belief_; }) {
    condition_.kind = CuttingCondition::Kind::cut;
    condition_.name = "cut";
    condition_.tool = *model.tool;
    condition_.engagement = {believed.entry, believed.exit, cut.depth, FEED};
    condition_.spindle_speed = cut.speed;
    condition_.steady_from = {{-1.0, 0.0, 0.0}};
    condition_.steady_to = {{10.0, 0.0, 0.0}};
    detector_.handle(condition_);
    advisor_.handle(condition_);
    control_.handle(condition_);
    wanted_ = speed_ = cut.speed;
    block_.sample_rate = 1.0 / (step_ * SUBSTEPS);
    block_.status = ForceBlock::Status::compensated;
  }

  void run() {
    sim::CuttingMachine::Input input;
    sim::CuttingMachine::Output output;
    for (long k = 0; turned_ < units::TWO_PI * options_.revolutions; ++k) {
      time_ = static_cast<double>(k) * step_;
      turn();
      input.motion.angle = turned_;
      input.motion.speed = speed_;
      input.motion.velocity[0] = feed_ * FEED * teeth_ * cut_.speed / units::TWO_PI;
      input.motion.centre[0] = fed_;
      if (k == 0)
        machine_.engage({{condition_.engagement.entry, condition_.engagement.exit, cut_.depth}},
                        input.motion);
      machine_.step(input, output);
      fed_ += input.motion.velocity[0] * step_;
      repetition_.at(turned_, output.displacement);
      if (k % SUBSTEPS == 0) measure(output);
      if (done()) break;
    }
    finish();
  }

 private:
  /// The spindle follows its override with limited acceleration, the feed at once.
  void turn() {
    if (asked_ && time_ >= taken_at_) {
      wanted_ = asked_->spindle * cut_.speed;
      feed_ = asked_->feed;
      asked_.reset();
      control_.answer(true, "", time_);
    }
    const double most = options_.spindle_acceleration * step_;
    speed_ += std::clamp(wanted_ - speed_, -most, most);
    turned_ += speed_ * step_;
  }

  void measure(const sim::CuttingMachine::Output& output) {
    if (time_ >= angle_due_) {
      detector_.handle(SpindleAngle{time_, std::fmod(turned_, units::TWO_PI), speed_});
      angle_due_ += ANGLE_EVERY;
    }
    if (time_ >= state_due_) {
      CncState state;
      state.stamp = time_;
      state.connected = state.armed = true;
      state.axes = {"X", "Y", "Z"};
      state.position = {fed_, 0.0, 0.0};
      state.distance_to_go = {0.0, 0.0, 0.0};
      state.feed = 0.02;
      state.spindle_speed = speed_;
      advisor_.handle(state);
      control_.handle(state);
      detector_.handle(state);
      state_due_ += STATE_EVERY;
    }
    const std::array<double, 3> force{{output.force.fx, output.force.fy, output.force.fz}};
    for (std::size_t axis = 0; axis < 3; ++axis)
      block_.force[axis].push_back(force[axis] + options_.noise * normal_(random_));
    if (block_.force[0].size() < BLOCK) return;
    block_.stamp = time_ - static_cast<double>(BLOCK - 1) / block_.sample_rate;
    detector_.handle(block_);
    block_.first_index += BLOCK;
    for (std::vector<double>& values : block_.force) values.clear();
  }

  void judged(const ChatterState& state) {
    control_.handle(state);
    if (control_.moving()) {
      advisor_.restart();
      return;
    }
    judging_ = std::chrono::steady_clock::now();
    advisor_.handle(state);
    const auto request = control_.takeRequest();
    if (!request) return;
    if (cut_.moves++ == 0) cut_.requested = turned_ / units::TWO_PI;
    cut_.reason = request->reason;
    cut_.spindle = request->spindle;
    cut_.feed = request->feed;
    cut_.next_speed = request->next_speed;
    cut_.next_depth = request->next_depth;
    asked_ = request;
    taken_at_ = time_ + options_.reaction;
  }

  /// The cut is decided: stable since the last override, or the control has given up.
  bool done() const {
    if (asked_ || cut_.moves == 0 || repetition_.turns() < 1) return false;
    const auto since = static_cast<double>(repetition_.turns()) - taken_at_ * cut_.speed / units::TWO_PI;
    return since > 4.0 * QUIET && repetition_.turns() - repetition_.quietFrom() > 3 * QUIET;
  }

  void finish() {
    const std::size_t turns = repetition_.turns(), quiet = repetition_.quietFrom();
    cut_.ended =
        turns - quiet >= QUIET ? static_cast<double>(quiet) : std::numeric_limits<double>::quiet_NaN();
    std::size_t onset = 1;
    while (onset < turns && repetition_.repeats(onset)) ++onset;
    cut_.onset = static_cast<double>(onset);
  }

  const ControlOptions& options_;
  ControlCut& cut_;
  int teeth_;
  double step_;
  sim::CuttingMachine machine_;
  UncertainSystem belief_;
  Repetition repetition_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  ChatterDetector detector_;
  ChatterAdvisor advisor_;
  MillingControl control_;
  CuttingCondition condition_;
  ForceBlock block_;
  std::optional<OverrideRequest> asked_;
  std::chrono::steady_clock::time_point judging_;
  double time_ = 0.0, taken_at_ = 0.0, angle_due_ = 0.0, state_due_ = 0.0;  // [s]
  double turned_ = 0.0, speed_ = 0.0, wanted_ = 0.0;                        // [rad], [rad/s]
  double feed_ = 1.0, fed_ = 0.0;                                           // [1], [m]
};

/// [1] of the programmed removal rate, by an operator who halves the depth until the cut is stable.
double halved(const FloquetSolver& truth, const ControlCut& cut) {
  double share = 1.0;
  while (truth.multiplier(cut.speed, share * cut.depth).radius() > 1.0 && share > 1e-3) share *= 0.5;
  return share;
}

}  // namespace

std::vector<ControlCut> controlStudy(const MachineModel& model, const RegenerativeSystem& system,
                                     const ControlOptions& options,
                                     const std::function<void(double)>& progress) {
  options.validate();
  if (options.cuts < 1) throw Error("cuts: expected at least 1");
  const UncertainSystem belief = UncertainSystem::of(model, system);
  std::mt19937_64 random(options.seed);
  std::uniform_real_distribution<double> unit;
  std::vector<ControlCut> cuts;
  for (int tries = 0; static_cast<int>(cuts.size()) < options.cuts; ++tries) {
    if (tries > 100 * options.cuts + 1000) throw Error("control study: no cuts with chatter found");
    ControlCut cut;
    cut.speed = options.speed_low + (options.speed_high - options.speed_low) * unit(random);
    const double share = 1.2 + 0.8 * unit(random);
    const RegenerativeSystem drawn = belief.draw(random);
    const auto truth = makeFloquetSolver(Method::collocation, drawn);
    cut.limit = truth->limit(cut.speed, options.max_depth).depth;
    if (!std::isfinite(cut.limit)) continue;
    cut.depth = share * cut.limit;
    if (truth->multiplier(cut.speed, cut.depth).radius() <= 1.05) continue;
    cut.requested = std::numeric_limits<double>::quiet_NaN();
    ControlledCut(machineOf(model, drawn), model, system, options, cut,
                  options.seed + 31u * static_cast<unsigned>(cuts.size()))
        .run();
    cut.careful = halved(*truth, cut);
    cut.next_stable =
        cut.next_speed > 0.0 && truth->multiplier(cut.next_speed, cut.next_depth).radius() < 1.0;
    // If the next cut chatters too, the depth is halved as well.
    cut.removal = cut.end()         ? cut.feed
                  : cut.next_stable ? cut.next_speed * cut.next_depth / (cut.speed * cut.depth)
                                    : cut.careful;
    cuts.push_back(cut);
    if (progress) progress(static_cast<double>(cuts.size()) / options.cuts);
  }
  return cuts;
}

}  // namespace smartmill::stability
