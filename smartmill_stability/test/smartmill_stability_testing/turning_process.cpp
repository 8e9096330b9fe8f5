#include "smartmill_stability_testing/turning_process.h"

#include <cmath>
#include <deque>
#include <memory>
#include <random>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

void TurningProcess::validate() const {
  require("stiffness ratio", stiffness_ratio, Range::positive());
  require("damping ratio", damping_ratio, Range::open(0.0, 1.0));
  require("natural frequency [rad/s]", natural_frequency, Range::positive());
  require("overlap", overlap, Range::closed(0.0, 1.0));
  require("period [s]", period, Range::positive());
}

double merrittLimit(double damping_ratio) {
  return 2.0 * damping_ratio * (1.0 + damping_ratio);
}

double criticalFrequency(double natural_frequency, double damping_ratio) {
  return natural_frequency * std::sqrt(1.0 + 2.0 * damping_ratio);
}

double growthRate(const TurningProcess& process) {
  process.validate();
  // One mode of unit stiffness along x; at a depth of 1 m the cutting stiffness is the stiffness ratio.
  RegenerativeSystem system;
  system.cut = Cut::turning;
  system.entry = 0.5 * units::PI;
  system.kr = process.stiffness_ratio;
  system.overlap = process.overlap;
  system.modes = systemModes(
      ModalModel{{{process.natural_frequency / units::TWO_PI, process.damping_ratio, 1.0}}, 0.0}, 0);
  const auto solver = makeFloquetSolver(Method::collocation, system);
  return std::log(solver->multiplier(units::TWO_PI / process.period, 1.0).radius()) / process.period;
}

ControlLaw displacementErrorControl(double gain, double bandwidth, double rate) {
  const double share = 1.0 - std::exp(-units::TWO_PI * bandwidth / rate);
  return [gain, share, at = 0.0](double deflection, double tool) mutable {
    at += share * (gain * (deflection - tool) - at);
    return at;
  };
}

ControlLaw forceFeedbackControl(const SecondOrder& model, const TurningProcess& process, double rate) {
  const auto filter = std::make_shared<ModalFilter>(model.modal(), rate, Hold::first_order);
  const auto motion = std::make_shared<std::deque<double>>();
  const double back = process.period * rate;
  return [=, before = process.chip](double deflection, double tool) mutable {
    motion->push_front(deflection - tool);
    const auto i = static_cast<std::size_t>(back);
    double past = 0.0;
    if (i + 1 < motion->size()) {
      past = (*motion)[i] + (back - static_cast<double>(i)) * ((*motion)[i + 1] - (*motion)[i]);
      if (motion->size() > i + 3) motion->pop_back();
    }
    const double chip = process.chip - motion->front() + process.overlap * past;
    filter->step(chip);
    const double command = filter->peek(2.0 * chip - before);
    before = chip;
    return command;
  };
}

TurningRun simulateTurning(const TurningProcess& process, double duration, double rate, double noise_rms,
                           unsigned seed, const ControlLaw& law) {
  process.validate();
  require("duration [s]", duration, Range::positive());
  require("rate x period", rate * process.period, Range::above(2.0));
  const SecondOrder machine{process.stiffness_ratio, process.natural_frequency, process.damping_ratio};
  ModalFilter filter(machine.modal(), rate, Hold::first_order);
  // Effect of the chip thickness on the deflection of the same sample.
  const double direct = filter.peek(1.0) - filter.peek(0.0);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  TurningRun run;
  const auto samples = static_cast<std::size_t>(duration * rate);
  run.time.reserve(samples);
  const double back = process.period * rate;
  const auto whole = static_cast<std::size_t>(back);
  const double share = back - static_cast<double>(whole);
  double tool = 0.0;
  for (std::size_t i = 0; i < samples; ++i) {
    double past = 0.0;
    if (i > whole) past = run.motion[i - whole] + share * (run.motion[i - whole - 1] - run.motion[i - whole]);
    // Solves deflection = free + direct chip and chip = a0 - (deflection - tool) + mu past.
    const double chip = (process.chip + tool - filter.peek(0.0) + process.overlap * past) / (1.0 + direct);
    const double deflection = filter.step(chip);
    run.time.push_back(static_cast<double>(i) / rate);
    run.motion.push_back(deflection - tool);
    run.deflection.push_back(deflection);
    if (law) tool = law(deflection + noise_rms * noise(random), tool + noise_rms * noise(random));
  }
  return run;
}

}  // namespace smartmill::stability
