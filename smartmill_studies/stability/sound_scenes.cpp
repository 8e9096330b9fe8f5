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
         kind != SoundKind::run_up && kind != SoundKind::idle_bearing && kind != SoundKind::idle_hall;
}
bool inHall(SoundKind kind) {
  return kind == SoundKind::idle_hall || kind == SoundKind::stable_hall || kind == SoundKind::chatter_hall;
}
bool chatters(SoundKind kind) {
  return kind == SoundKind::chatter || kind == SoundKind::chatter_no_air || kind == SoundKind::chatter_shop ||
         kind == SoundKind::chatter_interrupted || kind == SoundKind::chatter_hall;
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

  /// A defect of the inner ring: lines at its order, modulated by the revolution.
  void defectiveBearing(double speed, double level) {
    const double order = uniform(4.2, 6.8), depth = uniform(0.4, 0.9);
    for (std::size_t i = 0; i < sound_.size(); ++i) {
      const double turned = speed * static_cast<double>(i) / RATE;
      const double modulation = 1.0 + depth * std::cos(turned);
      for (int k = 1; k <= 4; ++k) sound_[i] += level / k * modulation * std::sin(k * order * turned + k);
    }
  }

  /// Compressor, slamming doors and music.
  void hallNoise(double level) {
    const double piston = uniform(18.0, 26.0), loudness = uniform(0.3, 1.0);
    for (std::size_t i = 0; i < sound_.size(); ++i) {
      const double t = static_cast<double>(i) / RATE;
      for (int k = 1; k <= 12; ++k)
        sound_[i] += loudness * level / k * std::sin(units::TWO_PI * k * piston * t + 0.7 * k * k);
    }
    for (double at = uniform(0.2, 1.0); at * RATE < static_cast<double>(sound_.size());
         at += uniform(0.8, 2.0)) {
      std::vector<double> bang(static_cast<std::size_t>(0.3 * RATE));
      for (std::size_t i = 0; i < bang.size(); ++i)
        bang[i] = normal_(random_) * std::exp(-static_cast<double>(i) / (0.04 * RATE));
      add(through(bang, uniform(90.0, 400.0), 0.05), 4.0 * level, at);
    }
    for (double at = 0.0; at * RATE < static_cast<double>(sound_.size());) {
      const double lasts = uniform(0.15, 0.6);
      const double note = 110.0 * std::pow(2.0, std::floor(uniform(0.0, 36.0)) / 12.0);
      for (std::size_t i = 0; i < static_cast<std::size_t>(lasts * RATE); ++i) {
        const std::size_t sample = static_cast<std::size_t>(at * RATE) + i;
        if (sample >= sound_.size()) break;
        const double t = static_cast<double>(i) / RATE;
        for (int k = 1; k <= 5; ++k)
          sound_[sample] += level / k * std::exp(-2.0 * t / lasts) * std::sin(units::TWO_PI * k * note * t);
      }
      at += lasts;
    }
  }

  /// Echoes of a hall of 0.3 .. 0.8 s reverberation.
  void echoes() {
    const double decay = uniform(0.04, 0.12);  // [s] of the amplitude
    const std::vector<double> direct = sound_;
    for (int k = 0; k < 60; ++k) {
      const double delay = uniform(0.005, 4.0 * decay);
      add(direct, 0.35 * std::exp(-delay / decay) * (uniform(0.0, 1.0) < 0.5 ? -1.0 : 1.0), delay);
    }
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
  if (scene.kind == SoundKind::idle_bearing)
    shop.defectiveBearing(scene.speed, shop.uniform(0.5, 2.0) * level);
  if (inHall(scene.kind)) {
    shop.hallNoise(shop.uniform(0.3, 1.0) * level);
    shop.echoes();
  }
  return shop.take();
}

/// [1] in a revolution
int samplesOf(const RegenerativeSystem& system) {
  return wholeTeeth(SAMPLES, system.teeth);
}

TwinCut planOf(const RegenerativeSystem& system, const SoundScene& scene) {
  const int turns = static_cast<int>(CUT * scene.speed / units::TWO_PI);
  return {scene.speed, {system.entry, system.exit, scene.depth, FEED}, samplesOf(system), turns, 0};
}

bool chattersIn(const Record& record, const RegenerativeSystem& system) {
  const int samples = samplesOf(system);
  return repeatsNoMore(record, samples, system.evenPitch() ? samples / system.teeth : samples, FEED);
}

}  // namespace

std::vector<SoundKind> soundKinds() {
  std::vector<SoundKind> kinds;
  for (int k = 0; k <= static_cast<int>(SoundKind::chatter_hall); ++k)
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
                                   "chatter, interrupted",
                                   "idle spindle, defective bearing",
                                   "idle spindle, hall",
                                   "stable cut, hall",
                                   "chatter, hall"};
  return NAMES[static_cast<int>(kind)];
}

std::vector<SoundScene> soundScenes(const MachineModel& model, const RegenerativeSystem& system,
                                    const StudyRange& range, const std::vector<SoundKind>& kinds) {
  range.validate();
  const auto solver = makeFloquetSolver(Method::collocation, system);
  std::mt19937_64 random(range.seed);
  std::uniform_real_distribution<double> unit;
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
      plan.push_back(planOf(system, scene));
      of.push_back(scenes.size());
    }
    scenes.push_back(scene);
  }
  runTwinCuts({model}, plan, {{"tool_x", "tool_y"}}, [&](std::size_t i, const Record& record) {
    SoundScene& scene = scenes[of[i]];
    scene.chatters = chattersIn(record, system);
    sounds[of[i]] = pressureOf(record, samplesOf(system) * scene.speed / units::TWO_PI);
  });
  for (std::size_t k = 0; k < scenes.size(); ++k) {
    scenes[k].recording.sample_rate = RATE;
    scenes[k].recording.channels = {
        soundOf(scenes[k], sounds[k], range.seed + 17u * static_cast<unsigned>(k))};
  }
  return scenes;
}

SoundScene cutScene(const MachineModel& model, const RegenerativeSystem& system, double speed, double depth,
                    unsigned seed) {
  SoundScene scene;
  scene.kind = SoundKind::stable;
  scene.speed = scene.stated_speed = speed;
  scene.depth = depth;
  runTwinCuts({model}, {planOf(system, scene)}, {{"tool_x", "tool_y"}},
              [&](std::size_t, const Record& record) {
                scene.chatters = chattersIn(record, system);
                scene.recording.channels = {
                    soundOf(scene, pressureOf(record, samplesOf(system) * speed / units::TWO_PI), seed)};
              });
  scene.recording.sample_rate = RATE;
  return scene;
}

std::vector<Capture> captures() {
  return {Capture::whole, Capture::no_speed, Capture::brief, Capture::low_rate};
}

const char* nameOf(Capture capture) {
  constexpr const char* NAMES[] = {"whole", "speed not stated", "3 .. 30 revolutions",
                                   "2.2 .. 6 samples a tooth"};
  return NAMES[static_cast<int>(capture)];
}

SoundScene captured(const SoundScene& scene, Capture capture, int teeth, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit;
  SoundScene result = scene;
  std::vector<double>& sound = result.recording.channels[0];
  if (capture == Capture::no_speed) result.stated_speed = 0.0;
  if (capture == Capture::brief) {
    // The middle of the recording is in the cut, where there is one; that of interrupted cuts in the second.
    const double turns = 3.0 * std::pow(10.0, unit(random));
    const auto length = static_cast<std::size_t>(turns * units::TWO_PI / scene.speed * RATE) + 8;
    const double middle = interrupted(scene.kind) ? AIR + PIECE + GAP + 0.5 * PIECE
                                                  : 0.5 * static_cast<double>(sound.size()) / RATE;
    const auto from = static_cast<std::ptrdiff_t>(middle * RATE) - static_cast<std::ptrdiff_t>(length / 2);
    const auto first = sound.begin() + std::max<std::ptrdiff_t>(0, from);
    sound = std::vector<double>(first, first + static_cast<std::ptrdiff_t>(std::min(length, sound.size())));
  }
  if (capture == Capture::low_rate) {
    const double passing = teeth * scene.speed / units::TWO_PI;
    const double rate = passing * (2.2 + 3.8 * unit(random));
    std::vector<double> slow;
    for (double at = 1.0; at < static_cast<double>(sound.size()) - 3.0; at += RATE / rate) {
      const auto k = static_cast<std::size_t>(at);
      slow.push_back(
          catmullRom(sound[k - 1], sound[k], sound[k + 1], sound[k + 2], at - static_cast<double>(k)));
    }
    sound = std::move(slow);
    result.recording.sample_rate = rate;
  }
  return result;
}

}  // namespace smartmill::stability
