#include "smartmill_discrepancy/report/summary.h"

#include <cstdio>

namespace smartmill::discrepancy {
namespace {

template <class... Values>
std::string text(const char* format, Values... values) {
  char line[200];
  std::snprintf(line, sizeof line, format, values...);
  return line;
}

}  // namespace

std::string summaryOf(const Explanation& e) {
  std::string lines = std::string("verdict: ") + nameOf(e.verdict) + "\n";
  for (const FoundEffect& effect : e.effects) {
    lines += effect.name + ":";
    for (const auto& [key, word] : effect.words) lines += " " + key + " " + word;
    for (const FoundParameter& p : effect.parameters)
      lines += " " + p.key + text(" %.5g +- %.2g", p.value, p.std_dev);
    lines += "\n";
  }
  for (const Finding& f : e.unexplained) {
    lines += "unexplained: " + f.channel + ", " + f.domain;
    for (const auto& [key, value] : f.location) lines += " " + key + text(" %.5g", value);
    lines += text(", amplitude %.3g, share %.3f\n", f.amplitude, f.share_of_gap);
  }
  lines += text("gap: fit %.4f -> %.4f, held out %.4f -> %.4f\n", e.before.fit, e.after.fit, e.before.heldout,
                e.after.heldout);
  if (e.interrupted) lines += "interrupted: this is what was found until then\n";
  return lines;
}

}  // namespace smartmill::discrepancy
