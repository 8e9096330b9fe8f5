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

// Which words describe a form.
struct SentenceOptions {
  double follows = 0.97;     ///< [1] of the variance that a power law must explain to be named
  double alike = 0.2;        ///< [1] spread of teeth over their distance to the one that differs
  double out = 0.1;          ///< [1] force of a tooth that hardly cuts
  double straight = 1500.0;  ///< [s] time constant beyond which a change is almost linear
  double nothing = 0.15;     ///< [1] gain of an attenuated band
};

const SentenceOptions LIMITS;

// Power law (h / reference)^-exponent: slope of the logarithms and explained share of their variance.
struct PowerLawFit {
  double exponent = 0.0, explained = 0.0;
};
PowerLawFit fitPowerLaw(const std::vector<double>& h, const std::vector<double>& factor) {
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
  const std::vector<double> h = seriesOf(effect, "h_um"), factor = seriesOf(effect, "factor");
  if (h.size() == 2) {
    const double slope = (h[1] * factor[1] - h[0] * factor[0]) / (h[1] - h[0]) / factor[0];
    return formatted(
        "the cutting force has a kink: above a chip thickness of %.3g um it rises %.0f %% as fast as below",
        h[0], 100.0 * slope);
  }
  std::string text = "the specific cutting force depends on the chip thickness: relative to the model it is";
  for (std::size_t k = 0; k < h.size(); ++k)
    text += formatted("%s %.2f at %.0f um", k ? "," : "", factor[k], h[k]);
  const PowerLawFit fit = fitPowerLaw(h, factor);
  if (fit.explained > LIMITS.follows)
    text += formatted(", a power law like size_effect with exponent %.2f", fit.exponent);
  return text;
}

// Force component of a form.
const char* shareOf(const FoundEffect& effect) {
  return effect.words.at("of") == "chip" ? "cutting force" : "edge force";
}

// The tooth that differs while the others agree; nothing if several differ.
std::optional<std::size_t> oddTooth(const std::vector<double>& factor) {
  for (std::size_t k = 0; k < factor.size(); ++k) {
    std::vector<double> others = factor;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    const auto [low, high] = std::minmax_element(others.begin(), others.end());
    if (*high - *low < LIMITS.alike * std::min(std::abs(factor[k] - *low), std::abs(factor[k] - *high)))
      return k;
  }
  return {};
}

std::string ofTeeth(const FoundEffect& effect) {
  const std::vector<double> factor = seriesOf(effect, "factor");
  if (const std::optional<std::size_t> odd = oddTooth(factor)) {
    const double ratio = factor[*odd] / factor[*odd == 0 ? 1 : 0];
    if (ratio < LIMITS.out) return formatted("tooth %zu hardly cuts", *odd + 1);
    return formatted(
        "one tooth differs from the others: the %s of tooth %zu is %.0f %% %s; check whether it is %s",
        shareOf(effect), *odd + 1, 100.0 * std::abs(ratio - 1.0), moreOrLess(ratio - 1.0),
        ratio > 1.0 ? "dull or chipped" : "of another grade or edge");
  }
  std::string text = formatted("the teeth differ: the %s of each relative to the model is", shareOf(effect));
  for (std::size_t k = 0; k < factor.size(); ++k) text += formatted("%s %.2f", k ? "," : "", factor[k]);
  return text;
}

std::string ofLife(const FoundEffect& effect) {
  const double amplitude = valueOf(effect, "amplitude"), constant = valueOf(effect, "time_constant_s");
  if (constant > LIMITS.straight)
    return formatted("the %s becomes %.2g %% %s per minute of cutting, linear like tool_wear",
                     shareOf(effect), 100.0 * std::abs(amplitude) * 60.0 / constant, moreOrLess(amplitude));
  return formatted(
      "during run-in of the edge its %s becomes %.0f %% %s, exponentially with a time constant of %.2g min "
      "of "
      "cutting",
      shareOf(effect), 100.0 * std::abs(amplitude), moreOrLess(amplitude), constant / 60.0);
}

std::string ofTime(const FoundEffect& effect) {
  const double amplitude = valueOf(effect, "amplitude");
  return formatted("a cut starts with %.0f %% %s cutting force, which decays with a time constant of %.3g s",
                   100.0 * std::abs(amplitude), moreOrLess(amplitude), valueOf(effect, "time_constant_s"));
}

std::string ofCourse(const FoundEffect& effect) {
  struct Words {
    const char *course, *unit, *check;
  };
  static const std::map<std::string, Words> WORDS{
      {"path", {"along the feed", "mm", "the work for hard spots and a change of its hardness"}},
      {"time", {"with the time in cut", "s", "the heating of tool and work"}},
      {"revolutions",
       {"with the revolutions in cut", "revolutions", "what repeats with the entry of a cut"}}};
  const Words& words = WORDS.at(effect.words.at("over"));
  const std::vector<double> at = seriesOf(effect, "at"), factor = seriesOf(effect, "factor");
  const auto [low, high] = std::minmax_element(factor.begin(), factor.end());
  const auto place = [&](std::vector<double>::const_iterator f) {
    return at[static_cast<std::size_t>(f - factor.begin())];
  };
  return formatted(
      "the cutting force changes %s, by the same factor in every cut: it is largest %.3g %s after the entry, "
      "%.2f times the one at %.3g %s, where it is smallest; check %s",
      words.course, place(high), words.unit, *high / *low, place(low), words.unit, words.check);
}

std::string ofProfile(const FoundEffect& effect) {
  const double extra = valueOf(effect, "factor") - 1.0;
  const bool surface = effect.words.at("from") == "surface";
  return formatted("the %s %.3g mm of the cut need %.0f %% %s cutting force: check for %s",
                   surface ? "uppermost" : "lowest", valueOf(effect, "height_mm"), 100.0 * std::abs(extra),
                   moreOrLess(extra),
                   surface ? "a hard skin of the stock" : "a worn corner or one of another shape");
}

std::string ofLostEdge(const FoundEffect& effect) {
  return formatted(
      "the lowest %.3g mm of tooth %.0f do not cut and the next tooth removes its chip; check for a broken "
      "corner",
      valueOf(effect, "height_mm"), valueOf(effect, "tooth"));
}

std::string ofCurve(const FoundEffect& effect) {
  const auto deviation = [&](double kn) {
    return kn * (valueOf(effect, "odd_per_kn") * std::abs(kn) + valueOf(effect, "even_per_kn") * kn +
                 valueOf(effect, "cubic_per_kn2") * kn * kn);
  };
  return formatted("%s is nonlinear: its error is %+.3g N at 300 N and %+.3g N at -300 N",
                   effect.words.at("channel").c_str(), 1e3 * deviation(0.3), 1e3 * deviation(-0.3));
}

std::string ofTone(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  return formatted("%s contains a tone of %.3g %s at %.5g Hz, %s", channel.c_str(),
                   valueOf(effect, "amplitude"), unitOf(channel), valueOf(effect, "frequency_hz"),
                   effect.words.at("while") == "turning" ? "at any spindle speed, but not at standstill"
                                                         : "independent of the spindle");
}

std::string ofOrder(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  return formatted(
      "%s contains a tone of %.3g %s at %.4g times the spindle frequency with a random phase in each record",
      channel.c_str(), valueOf(effect, "amplitude"), unitOf(channel), valueOf(effect, "order"));
}

std::string ofSettling(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  return formatted(
      "%s starts each record with an offset of %.3g %s, which decays with a time constant of %.3g s",
      channel.c_str(), valueOf(effect, "amplitude"), unitOf(channel), valueOf(effect, "time_constant_s"));
}

std::string ofStep(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  const double amplitude = valueOf(effect, "amplitude"), at = valueOf(effect, "at_s");
  if (effect.words.at("clock") == "record")
    return formatted("%s jumps by %+.3g %s %.4g s after the start of each record: check what switches then",
                     channel.c_str(), amplitude, unitOf(channel), at);
  return formatted(
      "%s has an offset of %+.3g %s from %.0f s after the start of the campaign: the setup changed between "
      "two tests",
      channel.c_str(), amplitude, unitOf(channel), at);
}

std::string ofRamp(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  const bool record = effect.words.at("clock") == "record";
  return formatted("%s drifts by %+.3g %s per minute %s, linear like charge_drift: check %s", channel.c_str(),
                   valueOf(effect, "per_min"), unitOf(channel),
                   record ? "from the start of each record" : "over the whole campaign",
                   record ? "its charge amplifier" : "the temperature of its mounting");
}

std::string ofApproach(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  const double amplitude = valueOf(effect, "amplitude"), constant = valueOf(effect, "time_constant_s");
  if (constant > LIMITS.straight)
    return formatted(
        "%s drifts by %+.3g %s per minute over the whole campaign, almost linearly: check the "
        "temperature of its mounting and its charge amplifier",
        channel.c_str(), 60.0 * amplitude / constant, unitOf(channel));
  return formatted(
      "%s reaches an offset of %+.3g %s while the machine warms up, exponentially with a time constant of "
      "%.2g min",
      channel.c_str(), amplitude, unitOf(channel), constant / 60.0);
}

std::string ofZero(const FoundEffect& effect) {
  return formatted(
      "the zero of %s differs from record to record, as the part without cut shows; %.0f %% of it act in the "
      "cut: reset its amplifier before each test",
      effect.words.at("channel").c_str(), 100.0 * valueOf(effect, "share"));
}

std::string ofBursts(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  return formatted(
      "%s rings every %.4g s at %.4g Hz with an initial amplitude of %.3g %s and a decay time of %.2g ms: "
      "check what knocks or switches with that period",
      channel.c_str(), valueOf(effect, "period_s"), valueOf(effect, "frequency_hz"),
      valueOf(effect, "amplitude"), unitOf(channel), 1e3 * valueOf(effect, "decay_s"));
}

std::string ofTransfer(const FoundEffect& effect) {
  const std::string& channel = effect.words.at("channel");
  const double below = valueOf(effect, "below"), above = valueOf(effect, "above");
  const double corner = valueOf(effect, "corner_hz");
  if (std::abs(above) < LIMITS.nothing)
    return formatted(
        "%s is attenuated above %.3g Hz like behind a first-order low pass: check for an active filter",
        channel.c_str(), corner);
  if (std::abs(below) < LIMITS.nothing)
    return formatted(
        "%s is attenuated below %.3g Hz like behind a first-order high pass: check the time constant of its "
        "charge amplifier, %.2g s",
        channel.c_str(), corner, 1.0 / (units::TWO_PI * corner));
  return formatted("%s is amplified %s %.3g Hz by %.2f", channel.c_str(), above != 1.0 ? "above" : "below",
                   corner, above != 1.0 ? above : below);
}

std::string ofResonance(const FoundEffect& effect) {
  const std::string &channel = effect.words.at("channel"), &from = effect.words.at("from");
  const std::string path = channel == from ? "" : " excited by " + from;
  return formatted(
      "%s has a resonance%s at %.4g Hz (damping %.2g %%, share %.2g): its sensor or mounting has a mode that "
      "the model lacks",
      channel.c_str(), path.c_str(), valueOf(effect, "frequency_hz"),
      100.0 * valueOf(effect, "damping_ratio"), valueOf(effect, "gain"));
}

std::string ofRevolution(const FoundEffect& effect) {
  return formatted(
      "at %.0f rpm and %.3g mm depth the residual is synchronous with the spindle: the table is valid "
      "between "
      "the measured feeds; its cause is unknown",
      valueOf(effect, "speed_rpm"), valueOf(effect, "depth_mm"));
}

}  // namespace

std::string sentenceOf(const FoundEffect& effect) {
  static const std::map<std::string, std::function<std::string(const FoundEffect&)>> SENTENCES{
      {"chip_thickness", ofChip},
      {"cutting_time", ofTime},
      {"force_course", ofCourse},
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
      {"zero", ofZero},
      {"revolution", ofRevolution}};
  const EffectKind* kind = findEffect(effect.name);
  if (!kind || !kind->empirical()) return "";
  return SENTENCES.at(kind->form)(effect);
}

std::string sentenceOf(const Explanation& explanation) {
  std::string text;
  for (const FoundEffect& effect : explanation.effects) {
    const std::string one = sentenceOf(effect);
    if (!one.empty()) text += (text.empty() ? "Not in the catalogue, but reproducible: " : "; ") + one;
  }
  return text.empty() ? text : text + ".";
}

}  // namespace smartmill::discrepancy
