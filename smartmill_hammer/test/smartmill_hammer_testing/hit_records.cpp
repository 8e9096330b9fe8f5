#include "smartmill_hammer_testing/hit_records.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <random>

namespace smartmill::hammer {
namespace {

using Random = std::mt19937_64;
constexpr double TWO_PI = 6.283185307179586;
constexpr int SUB_STEPS = 16;  // of a sample during contact

double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}
double byRatio(Random& random, double low, double high) {
  return low * std::pow(high / low, between(random, 0.0, 1.0));
}
bool chance(Random& random, double share) {
  return between(random, 0.0, 1.0) < share;
}

/// One contact: rise and fall by power laws, a ripple, and ringing of the force cell.
struct Pulse {
  double begin = 0.0, length = 0.0, peak = 0.0;  // [s], [s], [N]
  double rise = 1.0, fall = 1.0, ripple = 0.0, waves = 2.0, phase = 0.0;
  double ring = 0.0, ring_frequency = 5000.0, ring_time = 5e-4;

  double contact(double t) const {
    const double u = (t - begin) / length;
    if (u <= 0.0 || u >= 1.0) return 0.0;
    const double top = rise / (rise + fall);
    const double shape = std::pow(u / top, rise) * std::pow((1.0 - u) / (1.0 - top), fall);
    return peak * shape * (1.0 + ripple * std::sin(TWO_PI * waves * u + phase));
  }
  /// [N] output of the force cell.
  double forceAt(double t) const {
    const double after = t - begin - length;
    const double ringing =
        after > 0.0 ? ring * peak * std::exp(-after / ring_time) * std::sin(TWO_PI * ring_frequency * after)
                    : 0.0;
    return contact(t) + ringing;
  }
};

struct Structure {
  std::vector<double> frequency, damping, gain;
};

/// Noise and converter of a channel, relative to the largest value.
struct Channel {
  double noise = 0.0, offset = 0.0, hum = 0.0, hum_phase = 0.0, full_scale = 2.0;
  double steps = 32768.0;  // of a full scale
};

struct Scene {
  double rate = 0.0;
  std::size_t samples = 0, before = 0;
  int kind = 0;  // 0 displacement, 1 acceleration, 2 voltage of a gap sensor
  Structure structure;
  Channel force, response;
  double volt_per_metre = 0.0;
};

double spectrumOf(const Pulse& p, double f) {
  std::complex<double> sum;
  constexpr int STEPS = 240;
  for (int i = 0; i < STEPS; ++i) {
    const double t = p.begin + p.length * (i + 0.5) / STEPS;
    sum += p.contact(t) * std::polar(1.0, -TWO_PI * f * (t - p.begin));
  }
  return std::abs(sum);
}

/// First frequency [Hz] where the contact's spectrum is below a share of its largest; `most` if none is.
double bandOf(const Pulse& p, double share, double most) {
  double largest = 0.0;
  for (int i = 0; i <= 400; ++i) {
    const double f = most * i / 400.0, size = spectrumOf(p, f);
    largest = std::max(largest, size);
    if (size < share * largest) return f;
  }
  return most;
}

Pulse drawPulse(Random& random, double rate, double length, double peak) {
  Pulse p;
  p.length = length;
  p.peak = peak;
  p.rise = between(random, 0.8, 2.2);
  p.fall = between(random, 0.9, 3.0);
  p.ripple = between(random, 0.0, 0.12);
  p.waves = between(random, 1.5, 3.0);
  p.phase = between(random, 0.0, TWO_PI);
  p.ring = between(random, 0.0, 0.03);
  p.ring_frequency = between(random, 3000.0, std::min(9000.0, 0.4 * rate));
  p.ring_time = between(random, 3e-4, 1e-3);
  return p;
}

Channel drawChannel(Random& random) {
  Channel c;
  c.noise = byRatio(random, 2e-4, 5e-3);
  c.offset = between(random, -0.3, 0.3);
  c.hum = between(random, 0.0, 3e-3);
  c.hum_phase = between(random, 0.0, TWO_PI);
  c.full_scale = between(random, 1.5, 5.0);
  c.steps = chance(random, 0.5) ? 32768.0 : 8388608.0;
  return c;
}

Structure drawStructure(Random& random, double rate) {
  Structure s;
  const int modes = std::uniform_int_distribution<int>(1, 5)(random);
  for (int k = 0; k < modes; ++k) {
    const bool pair = k == 1 && chance(random, 0.2);
    s.frequency.push_back(pair ? s.frequency[0] * between(random, 1.01, 1.03)
                               : byRatio(random, 200.0, std::min(5500.0, 0.35 * rate)));
    s.damping.push_back(byRatio(random, 3e-3, 0.06));
    s.gain.push_back(byRatio(random, 2e-9, 1e-7) * (k > 0 && chance(random, 0.2) ? -1.0 : 1.0));
  }
  return s;
}

Scene drawScene(Random& random) {
  constexpr double RATES[] = {20000.0, 25600.0, 40000.0, 50000.0, 51200.0};
  Scene scene;
  scene.rate = RATES[std::uniform_int_distribution<int>(0, 4)(random)];
  scene.samples = static_cast<std::size_t>(scene.rate * between(random, 0.1, 0.4)) / 2 * 2;
  scene.before =
      std::max<std::size_t>(64, static_cast<std::size_t>(scene.rate * between(random, 3e-3, 1e-2)));
  scene.kind = std::uniform_int_distribution<int>(0, 2)(random);
  scene.structure = drawStructure(random, scene.rate);
  scene.force = drawChannel(random);
  scene.force.offset *= 0.1;
  scene.response = drawChannel(random);
  scene.volt_per_metre = byRatio(random, 1e4, 1e5);
  return scene;
}

double drawLength(Random& random, double rate) {
  return std::max(between(random, 1.2e-4, 6e-4), 5.0 / rate);
}

/// Exact step of free modes: each as a decaying rotation of (x, v).
struct Oscillators {
  explicit Oscillators(const Structure& s) : structure(s), x(s.frequency.size(), 0.0), v(x) {}

  void move(double dt) {
    for (std::size_t k = 0; k < x.size(); ++k) {
      const double w = TWO_PI * structure.frequency[k], z = structure.damping[k];
      const double wd = w * std::sqrt(1.0 - z * z), decay = std::exp(-z * w * dt);
      const double c = std::cos(wd * dt), s = std::sin(wd * dt), x0 = x[k], v0 = v[k];
      x[k] = decay * (x0 * c + (v0 + z * w * x0) / wd * s);
      v[k] = decay * (v0 * c - (w * w * x0 + z * w * v0) / wd * s);
    }
  }
  void push(double impulse) {
    for (std::size_t k = 0; k < x.size(); ++k)
      v[k] += std::pow(TWO_PI * structure.frequency[k], 2) * structure.gain[k] * impulse;
  }
  double displacement() const {
    double sum = 0.0;
    for (const double d : x) sum += d;
    return sum;
  }
  double acceleration(double force) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < x.size(); ++k) {
      const double w = TWO_PI * structure.frequency[k];
      sum += w * w * (structure.gain[k] * force - x[k]) - 2.0 * structure.damping[k] * w * v[k];
    }
    return sum;
  }

  const Structure& structure;
  std::vector<double> x, v;
};

/// Clean channels without noise. @param delay [s] of the response
void play(const Scene& scene, const std::vector<Pulse>& pulses, double delay, std::vector<double>& force,
          std::vector<double>& response) {
  Oscillators modes(scene.structure);
  const auto contact = [&](double t) {
    double f = 0.0;
    for (const Pulse& p : pulses) f += p.contact(t);
    return f;
  };
  double last = 0.0;
  for (const Pulse& p : pulses) last = std::max(last, p.begin + p.length);
  for (std::size_t i = 0; i < scene.samples; ++i) {
    const double t = (static_cast<double>(i) - static_cast<double>(scene.before)) / scene.rate;
    double sum = 0.0;
    for (const Pulse& p : pulses) sum += p.forceAt(t);
    force.push_back(sum);
    const double x = modes.displacement();
    response.push_back(scene.kind == 1   ? modes.acceleration(contact(t - delay))
                       : scene.kind == 0 ? x
                                         : -scene.volt_per_metre * x * (1.0 - 1e3 * x));
    if (t > last + delay + 1e-4) {
      modes.move(1.0 / scene.rate);
      continue;
    }
    const double dt = 1.0 / scene.rate / SUB_STEPS;
    for (int s = 0; s < SUB_STEPS; ++s) {
      modes.move(0.5 * dt);
      modes.push(contact(t - delay + (s + 0.5) * dt) * dt);
      modes.move(0.5 * dt);
    }
  }
}

double largestOf(const std::vector<double>& values) {
  double most = 0.0;
  for (const double v : values) most = std::max(most, std::abs(v));
  return most;
}

/// Noise, hum and offset, then the converter.
void record(Random& random, const Channel& c, double rate, double largest, std::vector<double>& values) {
  std::normal_distribution<double> normal;
  const double step = c.full_scale * largest / c.steps;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double hum = c.hum * std::sin(TWO_PI * 50.0 * static_cast<double>(i) / rate + c.hum_phase);
    values[i] += largest * (c.noise * normal(random) + hum + c.offset);
    values[i] = std::round(values[i] / step) * step;
  }
}

/// Level of a channel at rest.
double levelOf(const Channel& c, double largest) {
  return c.offset * largest;
}

double envelope(const std::vector<double>& values, double level, std::size_t at, std::size_t reach) {
  double most = 0.0;
  for (std::size_t i = at > reach ? at - reach : 0; i < std::min(values.size(), at + reach); ++i)
    most = std::max(most, std::abs(values[i] - level));
  return most;
}

struct Drawn {
  Scene scene;
  Hit hit;
  double force_largest = 0.0, response_largest = 0.0;
};

/// @param spoil changes the channels before noise and converter
Drawn make(Random& random, const Scene& scene, const std::vector<Pulse>& pulses, double delay = 0.0,
           const std::function<void(Drawn&)>& spoil = {}) {
  Drawn d;
  d.scene = scene;
  d.hit.sample_rate = scene.rate;
  d.hit.pre_trigger = scene.before;
  play(scene, pulses, delay, d.hit.force, d.hit.response);
  d.force_largest = largestOf(d.hit.force);
  d.response_largest = largestOf(d.hit.response);
  if (spoil) spoil(d);
  record(random, scene.force, scene.rate, d.force_largest, d.hit.force);
  record(random, scene.response, scene.rate, d.response_largest, d.hit.response);
  return d;
}

std::vector<double>& channel(Drawn& d, bool force) {
  return force ? d.hit.force : d.hit.response;
}
double largest(const Drawn& d, bool force) {
  return force ? d.force_largest : d.response_largest;
}
double level(const Drawn& d, bool force) {
  return levelOf(force ? d.scene.force : d.scene.response, largest(d, force));
}

void clip(Random& random, Drawn& d, bool after_noise, bool force, double share) {
  (void)random;
  const double top = share * largest(d, force), middle = after_noise ? level(d, force) : 0.0;
  for (double& v : channel(d, force)) v = std::clamp(v, middle - top, middle + top);
}

std::size_t beyond(const Drawn& d, bool force, double share) {
  const std::vector<double>& values = force ? d.hit.force : d.hit.response;
  return static_cast<std::size_t>(std::count_if(
      values.begin(), values.end(), [&](double v) { return std::abs(v) > share * largest(d, force); }));
}

Drawn drawClipped(Random& random, const Scene& scene, const std::vector<Pulse>& pulses) {
  const bool force = chance(random, 0.5), amplifier = chance(random, 0.25);
  double share = amplifier ? between(random, 0.4, 0.8) : between(random, 0.5, 0.9);
  Drawn d = make(random, scene, pulses, 0.0, [&](Drawn& clean) {
    while (beyond(clean, force, share) < 3) share *= 0.9;
    if (amplifier) clip(random, clean, false, force, share);
  });
  if (!amplifier) clip(random, d, true, force, share);
  return d;
}

void dropOut(Random& random, Drawn& d) {
  const bool force = chance(random, 0.3);
  std::vector<double>& values = channel(d, force);
  const int count = std::uniform_int_distribution<int>(1, 3)(random);
  for (int done = 0, tries = 0; done < count && tries < 100000; ++tries) {
    const auto at = std::uniform_int_distribution<std::size_t>(20, values.size() - 20)(random);
    const auto length = std::uniform_int_distribution<std::size_t>(1, 2)(random);
    const int way = std::uniform_int_distribution<int>(0, 2)(random);
    const double full = largest(d, force) * (force ? d.scene.force : d.scene.response).full_scale;
    const double value = way == 0   ? 0.0
                         : way == 1 ? std::copysign(full, between(random, -1.0, 1.0))
                                    : level(d, force) + largest(d, force) * between(random, -1.0, 1.0);
    if (std::abs(values[at] - value) < 0.2 * largest(d, force)) continue;
    for (std::size_t i = at; i < at + length; ++i) values[i] = value;
    ++done;
  }
}

void driftAway(Random& random, Drawn& d) {
  const bool force = chance(random, 0.5);
  std::vector<double>& values = channel(d, force);
  const double end = largest(d, force) * between(random, 0.05, 0.3) * (chance(random, 0.5) ? 1.0 : -1.0);
  const int shape = std::uniform_int_distribution<int>(0, 2)(random);
  const double from = static_cast<double>(d.scene.before), last = static_cast<double>(values.size()) - from;
  const double time = between(random, 0.1, 0.5);
  for (std::size_t i = d.scene.before; i < values.size(); ++i) {
    const double u = (static_cast<double>(i) - from) / last;
    values[i] += end * (shape == 0   ? u
                        : shape == 1 ? u * u
                                     : (1.0 - std::exp(-u / time)) / (1.0 - std::exp(-1.0 / time)));
  }
}

bool stick(Random& random, Drawn& d) {
  const bool force = chance(random, 0.2);
  std::vector<double>& values = channel(d, force);
  const double rest = level(d, force), most = largest(d, force);
  for (int tries = 0; tries < 20000; ++tries) {
    const auto run = std::uniform_int_distribution<std::size_t>(10, force ? 60 : 120)(random);
    const auto at = std::uniform_int_distribution<std::size_t>(
        d.scene.before, d.scene.before + (values.size() - d.scene.before) / (force ? 20 : 3))(random);
    if (at + run + 2 >= values.size() || std::abs(values[at] - rest) < (force ? 0.2 : 0.05) * most) continue;
    const auto ends = std::minmax_element(values.begin() + static_cast<std::ptrdiff_t>(at),
                                          values.begin() + static_cast<std::ptrdiff_t>(at + run));
    if (*ends.second - *ends.first < 0.1 * most) continue;
    std::fill(values.begin() + static_cast<std::ptrdiff_t>(at),
              values.begin() + static_cast<std::ptrdiff_t>(at + run), values[at]);
    return true;
  }
  return false;
}

void bump(Random& random, Drawn& d) {
  std::vector<double>& values = d.hit.response;
  const double rate = d.scene.rate;
  const auto after = static_cast<double>(values.size() - d.scene.before);
  const auto at = d.scene.before + static_cast<std::size_t>(after * between(random, 0.25, 0.8));
  const double here = envelope(values, 0.0, at, static_cast<std::size_t>(2e-3 * rate));
  const double size = std::max(d.response_largest * between(random, 0.25, 1.0), 2.5 * here);
  std::vector<double> wave(values.size() - at, 0.0);
  if (chance(random, 0.5)) {
    // Another excitation: the modes respond in other proportions.
    for (std::size_t k = 0; k < d.scene.structure.frequency.size(); ++k) {
      const double w = TWO_PI * d.scene.structure.frequency[k], share = between(random, 0.2, 1.0);
      for (std::size_t i = 0; i < wave.size(); ++i) {
        const double t = static_cast<double>(i) / rate;
        wave[i] += share * std::exp(-d.scene.structure.damping[k] * w * t) * std::sin(w * t);
      }
    }
  } else {
    const double f = byRatio(random, 80.0, 2000.0), length = std::max(between(random, 3e-3, 20e-3), 1.5 / f);
    for (std::size_t i = 0; i < wave.size(); ++i) {
      const double t = static_cast<double>(i) / rate;
      if (t < length) wave[i] = std::pow(std::sin(0.5 * TWO_PI * t / length), 2) * std::sin(TWO_PI * f * t);
    }
  }
  const double scale = size / std::max(largestOf(wave), 1e-300);
  for (std::size_t i = 0; i < wave.size(); ++i) values[at + i] += scale * wave[i];
}

HitCase drawSet(HitClass kind, Random& random) {
  HitCase c;
  const Scene scene = drawScene(random);
  const auto hits = std::uniform_int_distribution<std::size_t>(4, 8)(random);
  c.at_fault = std::uniform_int_distribution<std::size_t>(0, hits - 1)(random);
  const double length = drawLength(random, scene.rate), peak = byRatio(random, 15.0, 800.0);
  const double sign = chance(random, 0.5) ? 1.0 : -1.0, apart = between(random, 0.6, 4.0) / scene.rate;
  const double gain = std::pow(byRatio(random, 1.15, 2.5), sign);
  for (std::size_t h = 0; h < hits; ++h) {
    const bool fault = h == c.at_fault;
    Pulse p = drawPulse(random, scene.rate, std::max(length * between(random, 0.8, 1.2), 5.0 / scene.rate),
                        peak * between(random, 0.7, 1.3));
    double delay = 0.0;
    if (fault && kind == HitClass::trigger_skew) {
      // Delay of either sign: the force is delayed where the response would come first.
      if (sign > 0.0) {
        delay = apart;
      } else {
        p.begin += apart;
        delay = -apart;
      }
    }
    Drawn d = make(random, scene, {p}, delay, [&](Drawn& clean) {
      if (!fault || kind != HitClass::gain_jump) return;
      for (double& r : clean.hit.response) r *= gain;
      clean.response_largest *= gain;
    });
    c.hits.push_back(std::move(d.hit));
  }
  return c;
}

/// A pulse whose spectrum agrees with the class and the band.
Pulse drawFitting(HitClass kind, Random& random, const Scene& scene, HitCase& c) {
  for (;;) {
    const double peak = byRatio(random, 15.0, 800.0);
    Pulse p = drawPulse(random, scene.rate, drawLength(random, scene.rate), peak);
    if (kind == HitClass::dull) {
      const double ends = bandOf(p, 0.015, 0.45 * scene.rate);
      c.high = ends * between(random, 1.1, 1.5);
      if (c.high > 0.45 * scene.rate) continue;
    } else if (chance(random, 0.5)) {
      c.high = bandOf(p, 0.1, 0.4 * scene.rate) * between(random, 0.5, 1.0);
    }
    if (kind == HitClass::weak && chance(random, 0.5)) {
      c.weak_force = peak / between(random, 0.1, 0.7);
    } else if (kind != HitClass::weak && chance(random, 0.5)) {
      c.weak_force = peak * between(random, 0.2, 0.7);
    }
    return p;
  }
}

HitCase drawSingle(HitClass kind, Random& random) {
  HitCase c;
  Scene scene = drawScene(random);
  Pulse p = drawFitting(kind, random, scene, c);
  if (kind == HitClass::weak && c.weak_force == 0.0) scene.force.noise = 1.0 / between(random, 2.0, 7.0);
  std::vector<Pulse> pulses = {p};
  if (kind == HitClass::double_hit) {
    // The second contact begins after the end of the first.
    const double gap = between(random, 0.5e-3, 3e-3);
    pulses[0].length = std::min(pulses[0].length, 0.9 * gap);
    pulses.push_back(
        drawPulse(random, scene.rate, drawLength(random, scene.rate), p.peak * between(random, 0.2, 0.6)));
    pulses[1].begin = gap;
    c.high = 0.0;
  }
  if (kind == HitClass::clipping) {
    c.hits.push_back(drawClipped(random, scene, pulses).hit);
    return c;
  }
  Drawn d = make(random, scene, pulses, 0.0, [&](Drawn& clean) {
    if (kind == HitClass::drift) driftAway(random, clean);
    if (kind == HitClass::late_bump) bump(random, clean);
  });
  if (kind == HitClass::dropout) dropOut(random, d);
  if (kind == HitClass::stuck && !stick(random, d)) return drawSingle(kind, random);
  c.hits.push_back(std::move(d.hit));
  return c;
}

}  // namespace

std::string nameOf(HitClass kind) {
  constexpr const char* NAMES[HIT_CLASSES] = {
      "clean", "clean among others", "double hit", "clipping", "dropout",      "baseline drift",
      "stuck", "late bump",          "weak",       "dull",     "trigger skew", "gain jump"};
  return NAMES[static_cast<int>(kind)];
}

HitCase drawHitCase(HitClass kind, std::uint64_t seed) {
  std::seed_seq seeds{static_cast<std::uint32_t>(kind), static_cast<std::uint32_t>(seed),
                      static_cast<std::uint32_t>(seed >> 32)};
  Random random(seeds);
  switch (kind) {
    case HitClass::clean_group:
    case HitClass::trigger_skew:
    case HitClass::gain_jump:
      return drawSet(kind, random);
    default:
      return drawSingle(kind, random);
  }
}

}  // namespace smartmill::hammer
