#include "smartmill_discrepancy/explain/sentence.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "smartmill_core/formatted.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

double valueOf(const FoundEffect& effect, const std::string& key) {
  for (const FoundParameter& p : effect.parameters) {
    if (p.key == key) return p.value;
  }
  return 0.0;
}

std::vector<double> seriesOf(const FoundEffect& effect, const std::string& key) {
  std::vector<double> values;
  for (const FoundParameter& p : effect.parameters) {
    if (p.key.rfind(key + "[", 0) == 0) values.push_back(p.value);
  }
  return values;
}

const char* unitOf(const std::string& channel) {
  return channel == "load_meter" ? "V" : "N";
}

const char* moreOrLess(double value) {
  return value >= 0.0 ? "more" : "less";
}

// Whether factors follow (h / reference)^-exponent: slope of their logarithms, and the share of their
// variance that it explains.
struct Power {
  double exponent = 0.0, explained = 0.0;
};
Power powerOf(const std::vector<double>& h, const std::vector<double>& factor) {
  const auto n = static_cast<double>(h.size());
  double x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
  for (std::size_t k = 0; k < h.size(); ++k) {
    const double u = std::log(h[k]), v = std::log(factor[k]);
    x += u;
    y += v;
    xx += u * u;
    xy += u * v;
    yy += v * v;
  }
  const double sxx = xx - x * x / n, sxy = xy - x * y / n, syy = yy - y * y / n;
  return {sxx > 0.0 ? -sxy / sxx : 0.0, sxx * syy > 0.0 ? sxy * sxy / (sxx * syy) : 0.0};
}

std::string ofChip(const FoundEffect& effect) {
  constexpr double FOLLOWS = 0.97;
  const std::vector<double> h = seriesOf(effect, "h_um"), factor = seriesOf(effect, "factor");
  if (h.size() == 2) {
    const double slope = (h[1] * factor[1] - h[0] * factor[0]) / (h[1] - h[0]) / factor[0];
    return formatted(
        "the cutting force has a kink: above a chip of %.3g um it rises %.0f %% as fast with the chip as "
        "below",
        h[0], 100.0 * slope);
  }
  std::string text = "the force per chip is no constant: against the model it is";
  for (std::size_t k = 0; k < h.size(); ++k)
    text += formatted("%s %.2f at %.0f um", k ? "," : "", factor[k], h[k]);
  const Power power = powerOf(h, factor);
  if (power.explained > FOLLOWS)
    text += formatted(", which follows a power law as size_effect does, exponent %.2f", power.exponent);
  return text;
}

// Of which share of the force a form of the law speaks.
const char* shareOf(const FoundEffect& effect) {
  return effect.words.at("of") == "chip" ? "cutting force" : "force of its rubbing edge";
}

// The tooth that is not as the others, which are alike; nothing where several differ.
std::optional<std::size_t> oddTooth(const std::vector<double>& factor) {
  constexpr double ALIKE = 0.2;  // of the odd one's distance
  for (std::size_t k = 0; k < factor.size(); ++k) {
    std::vector<double> others = factor;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    const auto [low, high] = std::minmax_element(others.begin(), others.end());
    if (*high - *low < ALIKE * std::min(std::abs(factor[k] - *low), std::abs(factor[k] - *high))) return k;
  }
  return {};
}

std::string ofTeeth(const FoundEffect& effect) {
  constexpr double OUT = 0.1;
  const std::vector<double> factor = seriesOf(effect, "factor");
  if (const std::optional<std::size_t> odd = oddTooth(factor)) {
    const double ratio = factor[*odd] / factor[*odd == 0 ? 1 : 0];
    if (ratio < OUT) return formatted("one tooth is out: tooth %zu hardly cuts", *odd + 1);
    return formatted(
        "one tooth is not as the others: the %s of tooth %zu is %.0f %% %s; look whether it is %s",
        shareOf(effect), *odd + 1, 100.0 * std::abs(ratio - 1.0), moreOrLess(ratio - 1.0),
        ratio > 1.0 ? "dull or chipped" : "of another grade or edge");
  }
  std::string text =
      formatted("the teeth are not alike: the %s of each, over that of the model, is", shareOf(effect));
  for (std::size_t k = 0; k < factor.size(); ++k) text += formatted("%s %.2f", k ? "," : "", factor[k]);
  return text;
}

std::string ofLife(const FoundEffect& effect) {
  constexpr double STRAIGHT = 1500.0;  // [s]
  const double amplitude = valueOf(effect, "amplitude"), constant = valueOf(effect, "time_constant_s");
  if (constant > STRAIGHT)
    return formatted("the %s becomes %.2g %% %s with each minute of cutting, in a straight line as wear does",
                     shareOf(effect), 100.0 * std::abs(amplitude) * 60.0 / constant, moreOrLess(amplitude));
  return formatted(
      "while the edge is run in its %s becomes %.0f %% %s, by the exponential approach of a time constant of "
      "%.2g min of cutting",
      effect.words.at("of") == "chip" ? "cutting force" : "rubbing force", 100.0 * std::abs(amplitude),
      moreOrLess(amplitude), constant / 60.0);
}

std::string ofTime(const FoundEffect& effect) {
  const double amplitude = valueOf(effect, "amplitude");
  return formatted("a cut begins with %.0f %% %s cutting force and settles with a time constant of %.3g s",
                   100.0 * std::abs(amplitude), moreOrLess(amplitude), valueOf(effect, "time_constant_s"));
}

std::string ofProfile(const FoundEffect& effect) {
  const double extra = valueOf(effect, "factor") - 1.0;
  const bool surface = effect.words.at("from") == "surface";
  return formatted("the %s %.3g mm of the cut %s %.0f %% %s cutting force: look for %s",
                   surface ? "uppermost" : "lowest", valueOf(effect, "height_mm"), surface ? "cost" : "take",
                   100.0 * std::abs(extra), moreOrLess(extra),
                   surface ? "a skin of the stock" : "a corner that is worn or of another shape");
}

std::string ofLostEdge(const FoundEffect& effect) {
  return formatted(
      "one tooth is out: the lowest %.3g mm of tooth %.0f do not cut and the next tooth takes its chip; look "
      "for a lost corner",
      valueOf(effect, "height_mm"), valueOf(effect, "tooth"));
}

std::string ofCurve(const FoundEffect& effect) {
  const auto bend = [&](double kn) {
    return kn * (valueOf(effect, "odd_per_kn") * std::abs(kn) + valueOf(effect, "even_per_kn") * kn +
                 valueOf(effect, "cubic_per_kn2") * kn * kn);
  };
  return formatted(
      "%s is not straight: it shows %+.3g N at 300 N and %+.3g N at -300 N beside the true force",
      effect.words.at("channel").c_str(), 1e3 * bend(0.3), 1e3 * bend(-0.3));
}

std::string ofTone(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  return formatted("%s carries a tone of %.3g %s at %.5g Hz, %s", channel.c_str(),
                   valueOf(effect, "amplitude"), unitOf(channel), valueOf(effect, "frequency_hz"),
                   effect.words.at("while") == "turning"
                       ? "at any speed of the spindle, but not while it stands"
                       : "whatever the spindle does");
}

std::string ofOrder(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  return formatted(
      "%s carries a tone of %.3g %s at %.4g times the spindle's turning, its phase another one each "
      "record",
      channel.c_str(), valueOf(effect, "amplitude"), unitOf(channel), valueOf(effect, "order"));
}

std::string ofSettling(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  return formatted("%s begins each record off by %.3g %s and comes back with a time constant of %.3g s",
                   channel.c_str(), valueOf(effect, "amplitude"), unitOf(channel),
                   valueOf(effect, "time_constant_s"));
}

std::string ofStep(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  const double amplitude = valueOf(effect, "amplitude"), at = valueOf(effect, "at_s");
  if (effect.words.at("clock") == "record")
    return formatted("%s jumps by %+.3g %s %.4g s after each record began: look at what switches then",
                     channel.c_str(), amplitude, unitOf(channel), at);
  return formatted(
      "%s reads %+.3g %s off from the time on that stands %.0f s after the campaign's begin: "
      "something was touched between two tests",
      channel.c_str(), amplitude, unitOf(channel), at);
}

std::string ofRamp(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  const bool record = effect.words.at("clock") == "record";
  return formatted("%s drifts by %+.3g %s a minute %s, in a straight line as charge_drift does: look at %s",
                   channel.c_str(), valueOf(effect, "per_min"), unitOf(channel),
                   record ? "from the start of each record" : "over the whole campaign",
                   record ? "its charge amplifier" : "what it is fastened to and how warm that becomes");
}

std::string ofApproach(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  return formatted(
      "%s comes to be %+.3g %s off while the machine warms up, by the exponential approach of a time "
      "constant "
      "of %.2g min",
      channel.c_str(), valueOf(effect, "amplitude"), unitOf(channel),
      valueOf(effect, "time_constant_s") / 60.0);
}

std::string ofBursts(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  return formatted(
      "%s rings every %.4g s at %.4g Hz, at first with %.3g %s and dying out within %.2g ms: look for what "
      "knocks or switches in that beat",
      channel.c_str(), valueOf(effect, "period_s"), valueOf(effect, "frequency_hz"),
      valueOf(effect, "amplitude"), unitOf(channel), 1e3 * valueOf(effect, "decay_s"));
}

std::string ofTransfer(const FoundEffect& effect) {
  constexpr double NOTHING = 0.15;
  const std::string& channel = effect.words.at("channel");
  const double below = valueOf(effect, "below"), above = valueOf(effect, "above");
  const double corner = valueOf(effect, "corner_hz");
  if (std::abs(above) < NOTHING)
    return formatted(
        "%s loses what is quicker than %.3g Hz, as a low pass of first order does: look for a "
        "filter that is switched on",
        channel.c_str(), corner);
  if (std::abs(below) < NOTHING)
    return formatted(
        "%s loses what is slower than %.3g Hz, as a high pass of first order does: look at the "
        "time constant of its charge amplifier, %.2g s",
        channel.c_str(), corner, 1.0 / (units::TWO_PI * corner));
  return formatted("%s shows what is %s than %.3g Hz %.2f times as large as it is", channel.c_str(),
                   above != 1.0 ? "quicker" : "slower", corner, above != 1.0 ? above : below);
}

std::string ofResonance(const FoundEffect& effect) {
  const std::string &channel = effect.words.at("channel"), &from = effect.words.at("from");
  const std::string path = channel == from ? "beside itself" : "of what " + from + " carries";
  return formatted(
      "%s shows a resonance %s at %.4g Hz (damping %.2g %%, share %.2g): its sensor, or what it is "
      "bolted to, has a mode that the model lacks",
      channel.c_str(), path.c_str(), valueOf(effect, "frequency_hz"),
      100.0 * valueOf(effect, "damping_ratio"), valueOf(effect, "gain"));
}

std::string ofRevolution(const FoundEffect& effect) {
  return formatted(
      "at %.0f rpm and %.3g mm depth more comes again with each revolution than the model tells: the table "
      "serves between the feeds that were cut, and its cause is not known",
      valueOf(effect, "speed_rpm"), valueOf(effect, "depth_mm"));
}

}  // namespace

std::string sentenceOf(const FoundEffect& effect) {
  static const std::map<std::string, std::function<std::string(const FoundEffect&)>> SENTENCES{
      {"chip_thickness", ofChip},
      {"cutting_time", ofTime},
      {"depth_profile", ofProfile},
      {"lost_edge", ofLostEdge},
      {"curve", ofCurve},
      {"tone", ofTone},
      {"order", ofOrder},
      {"settling", ofSettling},
      {"tooth_factor", ofTeeth},
      {"edge_life", ofLife},
      {"step", ofStep},
      {"ramp", ofRamp},
      {"approach", ofApproach},
      {"bursts", ofBursts},
      {"transfer", ofTransfer},
      {"resonance", ofResonance},
      {"revolution", ofRevolution}};
  const EffectKind* kind = findEffect(effect.name);
  if (!kind || !kind->empirical()) return "";
  return SENTENCES.at(kind->form)(effect);
}

std::string sentenceOf(const Explanation& explanation) {
  std::string text;
  for (const FoundEffect& effect : explanation.effects) {
    const std::string one = sentenceOf(effect);
    if (!one.empty()) text += (text.empty() ? "No effect of the catalogue, but it repeats: " : "; ") + one;
  }
  return text.empty() ? text : text + ".";
}

}  // namespace smartmill::discrepancy
