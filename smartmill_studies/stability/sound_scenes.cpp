#include "stability/sound_scenes.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/interpolate.h"
#include "stability/twin_agreement.h"
#include "stability/twin_cuts.h"

namespace smartmill::stability {
namespace {

constexpr double RATE = 44100.0;                                // [Hz]
constexpr double AIR = 1.0, CUT = 2.5, PIECE = 0.6, GAP = 0.4;  // [s]
constexpr int SAMPLES = 180;
constexpr double FEED = 0.1e-3;  // [m] per tooth

bool cuts(SoundKind kind) {
  return kind != SoundKind::idle && kind != SoundKind::broadband && kind != SoundKind::other_machine &&
         kind != SoundKind::run_up;
}
bool chatters(SoundKind kind) {
  return kind == SoundKind::chatter || kind == SoundKind::chatter_no_air || kind == SoundKind::chatter_shop ||
         kind == SoundKind::chatter_interrupted;
}
bool interrupted(SoundKind kind) {
  return kind == SoundKind::interrupted || kind == SoundKind::chatter_interrupted;
}
bool airless(SoundKind kind) {
  return kind == SoundKind::stable_tone || kind == SoundKind::chatter_no_air;
}

/// y'' + 2 zeta w y' + w^2 y = w^2 x, by the bilinear transform.
std::vector<double> through(const std::vector<double>& x, double frequency, double damping) {
  const double w = 2.0 * RATE * std::tan(units::PI * frequency / RATE), k = 2.0 * RATE;
  const double a0 = k * k + 2.0 * damping * w * k + w * w;
  const double b = w * w / a0, a1 = (2.0 * w * w - 2.0 * k * k) / a0,
               a2 = (k * k - 2.0 * damping * w * k + w * w) / a0;
  std::vector<double> y(x.size(), 0.0);
  for (std::size_t i = 2; i < x.size(); ++i)
    y[i] = b * (x[i] + 2.0 * x[i - 1] + x[i - 2]) - a1 * y[i - 1] - a2 * y[i - 2];
  return y;
}

class Shop {
 public:
  Shop(unsigned seed, double seconds)
      : random_(seed), sound_(static_cast<std::size_t>(seconds * RATE), 0.0) {}

  double uniform(double low, double high) { return low + (high - low) * unit_(random_); }
  std::vector<double> noise(std::size_t count) {
    std::vector<double> values(count);
    double brown = 0.0;
    for (double& v : values) {
      brown = 0.98 * brown + normal_(random_);
      v = 0.3 * normal_(random_) + 0.1 * brown;
    }
    return values;
  }
  void add(const std::vector<double>& other, double gain, double at = 0.0) {
    const auto from = static_cast<std::size_t>(at * RATE);
    for (std::size_t i = 0; i < other.size() && from + i < sound_.size(); ++i)
      sound_[from + i] += gain * other[i];
  }
  void background(double level) { add(noise(sound_.size()), level); }

  /// Spindle orders and a bearing tone that is not an order; the speed rises over the first seconds.
  void spindle(double speed, double level, double run_up = 0.0) {
    std::vector<double> gain, phase;
    constexpr int ORDERS = 14;
    for (int k = 0; k < ORDERS; ++k) {
      gain.push_back(level * uniform(0.2, 1.0) / (1.0 + 0.3 * k));
      phase.push_back(uniform(0.0, units::TWO_PI));
    }
    const double bearing = uniform(3.1, 6.9);
    double turned = 0.0;
    for (std::size_t i = 0; i < sound_.size(); ++i) {
      const double t = static_cast<double>(i) / RATE;
      const double wander = 1.0 + 4e-4 * std::sin(units::TWO_PI * 0.7 * t);
      turned += speed * wander * (run_up > 0.0 ? std::min(1.0, 0.02 + t / run_up) : 1.0) / RATE;
      for (int k = 0; k < ORDERS; ++k)
        sound_[i] += gain[static_cast<std::size_t>(k)] *
                     std::sin((k + 1) * turned + phase[static_cast<std::size_t>(k)]);
      sound_[i] += 0.3 * level * std::sin(bearing * turned);
    }
  }

  void otherMachine(double level) {
    const double base = uniform(180.0, 1900.0), second = uniform(600.0, 3000.0);
    for (std::size_t i = 0; i < sound_.size(); ++i) {
      const double t = static_cast<double>(i) / RATE;
      sound_[i] +=
          level *
          (std::sin(units::TWO_PI * base * t) + 0.5 * std::sin(units::TWO_PI * 2.0 * base * t + 1.0) +
           0.6 * std::sin(units::TWO_PI * second * t + 2.0) + 0.3 * std::sin(units::TWO_PI * 100.0 * t));
    }
  }

  void coolant(double level, double from, double to) {
    std::vector<double> hiss = noise(static_cast<std::size_t>((to - from) * RATE));
    hiss = through(hiss, uniform(400.0, 2500.0), 0.1);
    add(hiss, level, from);
  }

  /// Sound of the cut with unit amplitude, in place.
  std::vector<double> heard(const std::vector<double>& cut) {
    std::vector<double> sum(cut.size(), 0.0);
    const auto mix = [&](const std::vector<double>& part, double gain) {
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += gain * part[i];
    };
    const double size = rms(cut);
    std::vector<double> scaled = cut;
    for (double& v : scaled) v /= size;
    mix(scaled, 0.6);
    // Chip noise and load noise through resonances of machine and workshop.
    std::vector<double> chips = noise(cut.size());
    for (std::size_t i = 0; i < chips.size(); ++i) chips[i] *= 0.3 + std::abs(scaled[i]);
    for (int k = 0; k < 3; ++k) {
      const double frequency = uniform(300.0, 3500.0), damping = uniform(0.01, 0.05);
      mix(through(scaled, frequency, damping), uniform(0.1, 0.4));
      const std::vector<double> ringing = through(chips, frequency, damping);
      mix(ringing, uniform(0.1, 0.3) / std::max(1e-9, rms(ringing)));
    }
    mix(chips, 0.1);
    return sum;
  }

  static double rms(const std::vector<double>& values) {
    double square = 0.0;
    for (const double v : values) square += v * v / static_cast<double>(values.size());
    return std::sqrt(std::max(1e-30, square));
  }
  std::vector<double> take() { return std::move(sound_); }

 private:
  std::mt19937_64 random_;
  std::uniform_real_distribution<double> unit_;
  std::normal_distribution<double> normal_;
  std::vector<double> sound_;
};

/// Pressure from the tip acceleration of a record, at the rate of the microphone.
std::vector<double> pressureOf(const Record& record, double rate) {
  const std::vector<double>&x = record.column("tool_x"), &y = record.column("tool_y");
  std::vector<double> slow(x.size(), 0.0);
  for (std::size_t i = 1; i + 1 < x.size(); ++i)
    slow[i] = (x[i + 1] - 2.0 * x[i] + x[i - 1] + 0.6 * (y[i + 1] - 2.0 * y[i] + y[i - 1])) * rate * rate;
  std::vector<double> sound;
  for (double at = 1.0; at < static_cast<double>(slow.size()) - 3.0; at += rate / RATE) {
    const auto k = static_cast<std::size_t>(at);
    sound.push_back(catmullRom(slow[k - 1], slow[k], slow[k + 1], slow[k + 2], at - static_cast<double>(k)));
  }
  return sound;
}

std::vector<double> soundOf(const SoundScene& scene, const std::vector<double>& cut, unsigned seed) {
  const double seconds = interrupted(scene.kind) ? AIR + 3 * (PIECE + GAP) + 0.5
                         : airless(scene.kind)   ? CUT
                                                 : AIR + CUT + AIR;
  Shop shop(seed, seconds);
  const double level = shop.uniform(0.05, 0.2);
  shop.background(0.1 * level);
  shop.spindle(scene.speed, 0.5 * level, scene.kind == SoundKind::run_up ? 2.0 : 0.0);
  if (scene.kind == SoundKind::broadband) shop.coolant(shop.uniform(1.0, 4.0), 1.0, 3.2);
  if (scene.kind == SoundKind::other_machine || scene.kind == SoundKind::stable_tone ||
      scene.kind == SoundKind::chatter_shop)
    shop.otherMachine(shop.uniform(0.3, 1.0) * level);
  if (!cut.empty()) {
    std::vector<double> heard = shop.heard(cut);
    if (interrupted(scene.kind)) {
      heard.resize(static_cast<std::size_t>(PIECE * RATE));
      for (int k = 0; k < 3; ++k) shop.add(heard, 1.0, AIR + k * (PIECE + GAP));
    } else {
      shop.add(heard, 1.0, airless(scene.kind) ? 0.0 : AIR);
    }
  }
  return shop.take();
}

}  // namespace

std::vector<SoundKind> soundKinds() {
  std::vector<SoundKind> kinds;
  for (int k = 0; k <= static_cast<int>(SoundKind::chatter_interrupted); ++k)
    kinds.push_back(static_cast<SoundKind>(k));
  return kinds;
}

const char* nameOf(SoundKind kind) {
  constexpr const char* NAMES[] = {"idle spindle",
                                   "broadband",
                                   "other machine",
                                   "run-up",
                                   "stable cut",
                                   "stable cut, other machine, no air",
                                   "stable, speed error",
                                   "stable, interrupted",
                                   "chatter",
                                   "chatter, no air",
                                   "chatter, other machine, speed error",
                                   "chatter, interrupted"};
  return NAMES[static_cast<int>(kind)];
}

std::vector<SoundScene> soundScenes(const MachineModel& model, const RegenerativeSystem& system,
                                    const StudyRange& range, const std::vector<SoundKind>& kinds) {
  range.validate();
  const auto solver = makeFloquetSolver(Method::collocation, system);
  std::mt19937_64 random(range.seed);
  std::uniform_real_distribution<double> unit;
  const int samples = wholeTeeth(SAMPLES, system.teeth);
  std::vector<SoundScene> scenes;
  std::vector<std::vector<double>> sounds(kinds.size());
  std::vector<TwinCut> plan;
  std::vector<std::size_t> of;  // scene of a cut
  for (const SoundKind kind : kinds) {
    SoundScene scene;
    scene.kind = kind;
    for (int tries = 0;; ++tries) {
      if (tries > 1000) throw Error("sound scenes: no cuts near the limit found");
      scene.speed = range.speed_low + (range.speed_high - range.speed_low) * unit(random);
      const double limit = solver->limit(scene.speed, range.max_depth).depth, share = unit(random);
      if (!std::isfinite(limit)) continue;
      scene.depth = limit * (chatters(kind) ? 1.2 + 0.8 * share : 0.4 + 0.4 * share);
      // Flips with an even number of teeth are excluded.
      const CharacteristicMultiplier m = solver->multiplier(scene.speed, scene.depth);
      if ((m.radius() > 1.02) == chatters(kind) && (m.radius() > 1.0) == chatters(kind)) break;
    }
    const bool off = kind == SoundKind::speed_error || kind == SoundKind::chatter_shop;
    scene.stated_speed = scene.speed * (1.0 + (off ? 0.015 : 0.003) * (2.0 * unit(random) - 1.0));
    if (cuts(kind)) {
      const int turns = static_cast<int>(CUT * scene.speed / units::TWO_PI);
      plan.push_back({scene.speed, {system.entry, system.exit, scene.depth, FEED}, samples, turns, 0});
      of.push_back(scenes.size());
    }
    scenes.push_back(scene);
  }
  const int period = system.evenPitch() ? samples / system.teeth : samples;
  runTwinCuts({model}, plan, {{"tool_x", "tool_y"}}, [&](std::size_t i, const Record& record) {
    SoundScene& scene = scenes[of[i]];
    scene.chatters = repeatsNoMore(record, samples, period, FEED);
    sounds[of[i]] = pressureOf(record, samples * scene.speed / units::TWO_PI);
  });
  for (std::size_t k = 0; k < scenes.size(); ++k) {
    scenes[k].recording.sample_rate = RATE;
    scenes[k].recording.channels = {
        soundOf(scenes[k], sounds[k], range.seed + 17u * static_cast<unsigned>(k))};
  }
  return scenes;
}

}  // namespace smartmill::stability
