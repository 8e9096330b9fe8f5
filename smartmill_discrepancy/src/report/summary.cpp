#include "smartmill_discrepancy/report/summary.h"

#include "smartmill_core/formatted.h"

namespace smartmill::discrepancy {
std::string summaryOf(const Explanation& e) {
  std::string lines = std::string("verdict: ") + nameOf(e.verdict) + "\n";
  if (!e.sentence.empty()) lines += e.sentence + "\n";
  for (const RecalibratedValue& v : e.recalibrated)
    lines += v.name + formatted(": %.5g -> %.5g +- %.2g, %+.1f stated deviations\n", v.before, v.after,
                                v.std_dev, v.deviations);
  for (const FoundEffect& effect : e.effects) {
    lines += effect.name + ":";
    for (const auto& [key, word] : effect.words) lines += " " + key + " " + word;
    for (const FoundParameter& p : effect.parameters)
      lines += " " + p.key + formatted(" %.5g +- %.2g", p.known(), p.std_dev) +
               (p.modulo > 0.0 ? formatted(" modulo %.4g", p.modulo) : "");
    lines += "\n";
  }
  for (const Resemblance& r : e.resembles)
    lines +=
        "not named: " + r.name + (r.variant.empty() ? "" : " (" + r.variant + ")") + ", " + r.reason + "\n";
  for (const Finding& f : e.unexplained) {
    lines += "unexplained: " + f.channel + ", " + f.domain;
    for (const auto& [key, value] : f.location) lines += " " + key + formatted(" %.5g", value);
    lines += formatted(", amplitude %.3g, share %.3f\n", f.amplitude, f.share_of_gap);
  }
  lines += formatted("gap: fit %.4f -> %.4f, held out %.4f -> %.4f\n", e.before.fit, e.after.fit,
                     e.before.heldout, e.after.heldout);
  for (const ChannelShare& c : e.channels) {
    lines += formatted("%s: %.2f -> %.2f %% of the variance explained", c.channel.c_str(),
                       100.0 * c.explained_before, 100.0 * c.explained_after);
    lines += c.synchronous_share ? formatted(", %.2f %% synchronous with the spindle (floor: gap %.3f)\n",
                                             100.0 * *c.synchronous_share, c.floor_gap)
                                 : std::string("\n");
  }
  if (const std::string text = e.inspection.text(); !text.empty()) lines += text + "\n";
  if (e.spent_budget)
    lines += formatted("budget of %.3g s spent: effects found until then\n", *e.spent_budget);
  if (!e.not_tried.empty()) lines += "not tried: " + joined(e.not_tried) + "\n";
  if (e.interrupted) lines += "interrupted: effects found until then\n";
  return lines;
}

}  // namespace smartmill::discrepancy
