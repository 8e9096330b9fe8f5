#include "smartmill_stability/chatter/chatter_advice.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"

namespace smartmill::stability {
namespace {

struct AdviceOptions {
  std::size_t conditions = 8;  ///< most recent ones, among which the cut of a verdict is
  std::size_t speeds = 12;     ///< proposed by the chatter frequency; limits of more take seconds
  double same_speed = 0.01;    ///< [1] relative difference of speeds that are one proposal
  double load = 0.01;          ///< [1] smaller differences of the speed are the effect of load
  double override = 0.5;       ///< [1] larger ones a spindle run-up or stop
  double deepest = 5.0;        ///< [1] largest depth over that of the cut, which identifies pockets
  int correction_steps = 40;   ///< of the factor of a frequency, finer than two motions are apart
};
constexpr AdviceOptions ADVICE;

struct Probe {
  /// [Hz] Predicted minus observed frequency, modulo the tooth passing frequency.
  double gap = 0.0;
  bool chatters = false;
};

Probe probe(const RegenerativeSystem& system, double speed, double depth, double observed) {
  const auto [m, predicted] = makeFloquetSolver(Method::collocation, system)->at(speed)->motion(depth);
  const double passing = 1.0 / m.period;
  // A multiplier and its conjugate: frequencies +f and -f, each plus integer multiples of the tooth passing.
  const double same = std::remainder(predicted - observed, passing);
  const double mirrored = -std::remainder(-predicted - observed, passing);
  return {std::abs(same) <= std::abs(mirrored) ? same : mirrored, m.radius() > 1.0};
}

RegenerativeSystem scaled(const RegenerativeSystem& system, std::size_t mode, double factor) {
  RegenerativeSystem changed = system;
  SystemMode& m = changed.modes[mode];
  // Constant compliance: both vectors are proportional to the frequency.
  m.frequency *= factor;
  for (std::size_t a = 0; a < 2; ++a) {
    m.input[a] *= factor;
    m.output[a] *= factor;
  }
  return changed;
}

}  // namespace

std::vector<ChatterEpisode> episodes(const std::vector<ChatterState>& states) {
  std::vector<ChatterEpisode> found;
  std::vector<double> frequencies;
  bool running = false;
  const auto close = [&] {
    if (!running) return;
    std::nth_element(frequencies.begin(),
                     frequencies.begin() + static_cast<std::ptrdiff_t>(frequencies.size() / 2),
                     frequencies.end());
    found.back().frequency = frequencies[frequencies.size() / 2];
    running = false;
  };
  for (const ChatterState& s : states) {
    if (!s.valid || !s.chatter || (running && s.condition != found.back().condition)) close();
    if (!s.valid || !s.chatter) continue;
    if (!running) {
      found.push_back({s.condition, s.onset, s.stamp, s.stamp, 0.0, 0.0});
      frequencies.clear();
      running = true;
    }
    frequencies.push_back(s.frequency);
    found.back().end = s.stamp;
    found.back().severity = std::max(found.back().severity, s.severity);
  }
  close();
  return found;
}

std::vector<double> speedsFromChatter(double frequency, int teeth, double low, double high) {
  if (!(frequency > 0.0) || teeth < 1)
    throw Error("chatter speeds: expected a frequency above 0 Hz and at least 1 tooth");
  if (!(low > 0.0) || !(high >= low)) throw Error("chatter speeds: expected 0 < low <= high");
  std::vector<double> speeds;
  for (int k = 1;; ++k) {
    const double speed = units::TWO_PI * frequency / (k * teeth);
    if (speed < low) return speeds;
    if (speed <= high) speeds.push_back(speed);
  }
}

std::optional<ModeCorrection> correctFromChatter(const RegenerativeSystem& prior, double speed, double depth,
                                                 double observed, double most) {
  if (!(observed > 0.0)) throw Error("chatter correction: expected a frequency above 0 Hz");
  if (!(most > 0.0) || most >= 0.5)
    throw Error("chatter correction: expected a largest change between 0 and 0.5");
  std::optional<ModeCorrection> best;
  const auto consider = [&](std::size_t mode, double factor, bool chatters) {
    const bool better = !best || (chatters && !best->chatters) ||
                        (chatters == best->chatters && std::abs(factor - 1.0) < std::abs(best->factor - 1.0));
    if (!better) return;
    best = ModeCorrection{mode, factor, prior.modes[mode].frequency * factor, chatters,
                          scaled(prior, mode, factor)};
  };
  const double passing = speed * prior.teeth / units::TWO_PI;
  for (std::size_t mode = 0; mode < prior.modes.size(); ++mode) {
    // Roots of the gap over the factor. A jump to another motion and a wrap-around are no roots.
    double before_factor = 1.0 - most;
    Probe before = probe(scaled(prior, mode, before_factor), speed, depth, observed);
    for (int i = 1; i <= ADVICE.correction_steps; ++i) {
      const double factor = 1.0 - most + 2.0 * most * i / ADVICE.correction_steps;
      const Probe here = probe(scaled(prior, mode, factor), speed, depth, observed);
      if ((before.gap > 0.0) != (here.gap > 0.0) && std::abs(here.gap - before.gap) < 0.25 * passing) {
        double a = before_factor, b = factor;
        Probe pa = before, pb = here;
        for (int k = 0; k < 25 && b - a > 1e-7; ++k) {
          const double middle = 0.5 * (a + b);
          const Probe pm = probe(scaled(prior, mode, middle), speed, depth, observed);
          ((pm.gap > 0.0) == (pa.gap > 0.0) ? a : b) = middle;
          ((pm.gap > 0.0) == (pa.gap > 0.0) ? pa : pb) = pm;
        }
        if (std::abs(pb.gap - pa.gap) < 1e-3 * passing) consider(mode, 0.5 * (a + b), pb.chatters);
      }
      before = here;
      before_factor = factor;
    }
  }
  return best;
}

ChatterAdvisor::ChatterAdvisor(double low, double high, int teeth, PriorSystem prior, Output output,
                               Output early)
    : low_(low),
      high_(high),
      teeth_(teeth),
      prior_system_(std::move(prior)),
      output_(std::move(output)),
      early_(std::move(early)) {
  if (!(low > 0.0) || !(high >= low)) throw Error("chatter advice: expected speeds 0 < low <= high");
  if (teeth < 1) throw Error("chatter advice: expected at least 1 tooth");
}

void ChatterAdvisor::handle(const CuttingCondition& condition) {
  conditions_.push_back(condition);
  if (conditions_.size() > ADVICE.conditions) conditions_.pop_front();
}

void ChatterAdvisor::handle(const CncState& state) {
  if (state.connected) actual_speed_ = state.spindle_speed;
}

void ChatterAdvisor::restart() {
  running_.clear();
  advised_ = false;
}

void ChatterAdvisor::handle(const ChatterState& state) {
  const bool same = !running_.empty() && running_.front().condition == state.condition;
  if (!state.valid || !state.chatter || !same) restart();
  if (!state.valid || !state.chatter) return;
  running_.push_back(state);
  if (advised_ || running_.size() < 2) return;
  const double before = running_[running_.size() - 2].frequency;
  if (std::abs(state.frequency - before) > SAME_CHATTER * before) return;
  advised_ = true;
  advise(state);
}

namespace {

/// Speeds at which the tooth passing frequency divides the chatter frequency, highest first, then those of
/// the modal frequencies, where the pockets are if the chatter is a flip. The limits are still unknown.
std::vector<ChatterAdvice::Speed> inStep(double frequency, int teeth, const std::vector<SystemMode>& modes,
                                         double low, double high) {
  constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> proposed = speedsFromChatter(frequency, teeth, low, high);
  if (proposed.size() > ADVICE.speeds) proposed.resize(ADVICE.speeds);
  for (const SystemMode& mode : modes)
    for (const double s : speedsFromChatter(mode.frequency, teeth, low, high))
      if (proposed.size() < 4 * ADVICE.speeds) proposed.push_back(s);
  std::vector<ChatterAdvice::Speed> speeds;
  for (const double s : proposed) {
    if (std::none_of(speeds.begin(), speeds.end(), [&](const ChatterAdvice::Speed& other) {
          return std::abs(other.speed / s - 1.0) < ADVICE.same_speed;
        }))
      speeds.push_back({s, UNKNOWN, UNKNOWN});
  }
  return speeds;
}

}  // namespace

void ChatterAdvisor::advise(const ChatterState& state) {
  ChatterAdvice advice;
  advice.stamp = state.stamp;
  advice.episode = episodes(running_).front();
  const double frequency = 0.5 * (state.frequency + running_[running_.size() - 2].frequency);
  advice.episode.frequency = frequency;
  CuttingCondition condition;
  for (const CuttingCondition& c : conditions_)
    if (c.name == state.condition) condition = c;
  advice.depth = condition.engagement.axial_depth;
  const int teeth = condition.tool.teeth > 0 ? condition.tool.teeth : teeth_;
  std::optional<RegenerativeSystem> system;
  // The engagement of an unsteady cut changes: a limit for one that encloses it corrects no mode.
  if (condition.kind != CuttingCondition::Kind::unsteady) system = prior_system_(condition);
  const double off = std::abs(actual_speed_ - condition.spindle_speed) / condition.spindle_speed;
  const double speed = off > ADVICE.load && off < ADVICE.override ? actual_speed_ : condition.spindle_speed;
  advice.speed = speed;
  advice.engagement = condition.engagement;
  advice.teeth = teeth;
  const double most = ADVICE.deepest * advice.depth;
  if (system && speed > 0.0 && advice.depth > 0.0) {
    const auto limitOf = [&](const RegenerativeSystem& s) {
      return makeSolver(Method::collocation, s)->limit(speed, most).depth;
    };
    advice.believed_limit = limitOf(*system);
    advice.correction = correctFromChatter(*system, speed, advice.depth, frequency);
    if (advice.correction) {
      advice.believed_frequency = system->modes[advice.correction->mode].frequency;
      system = advice.correction->system;
      advice.corrected_limit = limitOf(*system);
    }
  }
  const bool known = system && most > 0.0;
  advice.speeds = inStep(frequency, teeth, known ? system->modes : std::vector<SystemMode>(), low_, high_);
  if (early_) early_(advice);
  for (ChatterAdvice::Speed& one : advice.speeds) {
    if (!known) break;
    const Limit limit = makeSolver(Method::collocation, *system)->limit(one.speed, most);
    one.limit = limit.depth;
    one.frequency = limit.frequency;
  }
  if (known)
    std::stable_sort(advice.speeds.begin(), advice.speeds.end(), [](const auto& a, const auto& b) {
      return a.limit != b.limit ? a.limit > b.limit : a.speed > b.speed;
    });
  output_(advice);
}

}  // namespace smartmill::stability
