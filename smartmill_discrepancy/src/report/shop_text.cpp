#include "smartmill_discrepancy/report/shop_text.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "smartmill_core/formatted.h"
#include "smartmill_core/model/effect_catalogue.h"

namespace smartmill::discrepancy {
namespace {

// Of the first digit, after rounding to three.
int magnitudeOf(double value) {
  return value == 0.0 ? 0 : static_cast<int>(std::floor(std::log10(std::abs(value) * 1.0005)));
}

// Channels of the supplied model that differ by more than the noise, the largest over the noise first.
std::string largestDifferences(const Explanation& e) {
  constexpr double MORE_THAN_NOISE = 1.2;
  constexpr std::size_t MOST = 3;
  std::vector<std::pair<double, std::string>> channels;
  for (const auto& [channel, noise] : e.noise) {
    const double difference = differenceOf(
        e.gaps, false, [&c = channel](const TestGap& g) { return g.channel == c && !g.heldout; });
    const ChannelWords words = channelWords(channel);
    if (difference > MORE_THAN_NOISE)
      channels.emplace_back(difference, words.title + " " + words.text(difference * noise) +
                                            " with a noise of " + words.text(noise));
  }
  std::sort(channels.rbegin(), channels.rend());
  std::string text;
  for (std::size_t k = 0; k < std::min(MOST, channels.size()); ++k)
    text += (k ? ", " : " (") + channels[k].second;
  return text.empty() ? "" : text + "; RMS over the fitted tests)";
}

std::string causesOf(const Explanation& e) {
  std::vector<std::string> causes;
  for (const FoundEffect& f : e.effects) causes.push_back(causeWithRivals(e, f.name));
  return joined(causes, "; ");
}

}  // namespace

std::string shortText(double value) {
  constexpr int DIGITS = 3, MOST_DECIMALS = 6;
  return formatted("%.*f", std::clamp(DIGITS - 1 - magnitudeOf(value), 0, MOST_DECIMALS), value);
}

std::string intervalText(double value, double std_dev) {
  constexpr double SIDES = 1.96;
  constexpr int DIGITS = 4;  // significant ones at most
  if (std_dev <= 0.0 || !std::isfinite(std_dev)) return shortText(value);
  const double half = SIDES * std_dev;
  const int decimals = std::clamp(std::min(1 - magnitudeOf(half), DIGITS - 1 - magnitudeOf(value)), 0, 9);
  const double step = std::pow(10.0, -decimals);
  return formatted("%.*f", decimals, value) + " &plusmn; " +
         (half < 0.5 * step ? "less than " + formatted("%.*f", decimals, step)
                            : formatted("%.*f", decimals, half));
}

ChannelWords channelWords(const std::string& channel) {
  static const std::map<std::string, ChannelWords> WORDS{
      {"fx", {"force x", "N", 1.0}},
      {"fy", {"force y", "N", 1.0}},
      {"fz", {"force z", "N", 1.0}},
      {"load_meter", {"spindle load meter", "mV", 1e3}},
      {"tool_x", {"tool tip displacement x", "&micro;m", 1e6}},
      {"tool_y", {"tool tip displacement y", "&micro;m", 1e6}},
      {"displacement", {"displacement", "&micro;m", 1e6}},
      {"acceleration", {"acceleration", "m/s&sup2;", 1.0}}};
  const auto found = WORDS.find(channel);
  return found == WORDS.end() ? ChannelWords{channel, "", 1.0} : found->second;
}

std::string causeTitle(const std::string& effect) {
  const EffectKind& kind = *findEffect(effect);
  if (!kind.empirical()) return kind.title;
  std::string form = kind.form;
  std::replace(form.begin(), form.end(), '_', ' ');
  return "an effect without a name in the catalogue (" + form + ")";
}

std::string causeWithRivals(const Explanation& e, const std::string& effect) {
  std::string text = causeTitle(effect);
  for (const auto& group : e.not_separable) {
    if (std::find(group.begin(), group.end(), effect) == group.end()) continue;
    for (const std::string& other : group) {
      if (other != effect) text += " or " + causeTitle(other);
    }
  }
  return text;
}

double differenceOf(const std::vector<TestGap>& cells, bool corrected,
                    const std::function<bool(const TestGap&)>& chosen) {
  double squares = 0.0, samples = 0.0;
  for (const TestGap& g : cells) {
    if (!chosen(g)) continue;
    const double weight = g.std_dev > 0.0 ? 0.5 / (g.std_dev * g.std_dev) : 1.0;  // number of samples
    squares += weight * std::pow(corrected ? g.after : g.before, 2);
    samples += weight;
  }
  return samples > 0.0 ? std::sqrt(squares / samples) : 0.0;
}

bool gotWorse(const TestGap& cell) {
  constexpr double BEYOND_CHANCE = 3.0;  // standard deviations
  return cell.after > std::max(cell.before, 1.0) + BEYOND_CHANCE * cell.std_dev;
}

std::string searchText(const Explanation& e) {
  const std::size_t checked = e.testable - std::min(e.testable, e.not_tried.size());
  if (!e.not_tried.empty())
    return formatted("The search was not complete: %zu of %zu causes that these tests can show were checked.",
                     checked, e.testable);
  if (e.interrupted || e.spent_budget)
    return formatted(
        "All %zu causes that these tests can show were checked, but the last steps of the search "
        "were cut short.",
        e.testable);
  return formatted("All %zu causes that these tests can show were checked.", e.testable);
}

std::string verdictText(const Explanation& e) {
  if (e.verdict == Verdict::no_disagreement)
    return formatted(
        "Measurement and simulation agree: they differ by %.2f times the noise. Nothing is missing "
        "in the supplied model.",
        e.before.fit);
  std::string text =
      formatted("Measurement and simulation with the supplied model differ by %s times the noise%s. ",
                shortText(e.before.fit).c_str(), largestDifferences(e).c_str());
  if (e.verdict == Verdict::recalibrated)
    text += "No cause is missing: some values of the supplied model are wrong. ";
  else if (e.effects.empty())
    text += "None of the causes that were checked explains this. ";
  else
    text += (e.effects.size() > 1 ? "Causes: <b>" : "Cause: <b>") + causesOf(e) + "</b>. ";
  text += formatted("With the corrected model the difference is %.2f times the noise", e.after.fit);
  if (e.after.heldout > 0.0) text += formatted(", in the held-out tests %.2f times", e.after.heldout);
  text += ". ";
  if (!e.effects.empty() && !e.unexplained.empty() && !e.named_only)
    text += "A part is not explained (below). ";
  return text + searchText(e);
}

}  // namespace smartmill::discrepancy
