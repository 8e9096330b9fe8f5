#include "gallery/gallery.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "smartmill_core/formatted.h"

namespace smartmill::studies {

const char* nameOf(Verdict verdict) {
  switch (verdict) {
    case Verdict::agrees:
      return "agrees";
    case Verdict::better:
      return "better";
    case Verdict::differs:
      return "differs";
    default:
      return "shown";
  }
}

const char* nameOf(Kind kind) {
  switch (kind) {
    case Kind::reproduced:
      return "reproduced";
    case Kind::restated:
      return "restated";
    default:
      return "another machine";
  }
}

Compared::Compared(Kind of, std::string name, std::string printed, std::string computed, Verdict result,
                   std::string reason)
    : kind(of),
      what(std::move(name)),
      seed(std::move(printed)),
      ours(std::move(computed)),
      verdict(result),
      why(std::move(reason)) {
  if ((kind == Kind::another_machine) != (verdict == Verdict::shown))
    throw std::logic_error(what + ": a number is only shown if, and only if, it is of another machine");
  if (kind == Kind::restated && verdict == Verdict::better)
    throw std::logic_error(what + ": a restated number cannot be better");
}

std::vector<Figure> allFigures() {
  std::vector<Figure> all;
  for (const auto& some : {loadMeterFigures(), hammerFigures(), dynamometerFigures(), chartFigures(),
                           turningFigures(), spindleSensorFigures(), plateFigures(), motorFigures()})
    all.insert(all.end(), some.begin(), some.end());
  return all;
}

Compared compareNumber(Kind kind, const std::string& what, double seed, double ours, double ours_std,
                       double share, const std::string& why) {
  const bool near = std::abs(ours - seed) <= std::max(share * std::abs(seed), 1.96 * ours_std);
  const std::string our_text =
      ours_std > 0.0 ? formatted("%.4g +- %.2g", ours, ours_std) : formatted("%.4g", ours);
  return {kind, what, formatted("%.4g", seed), our_text, near ? Verdict::agrees : Verdict::differs, why};
}

KindCount countOf(const std::vector<Compared>& rows, Kind kind) {
  KindCount count;
  for (const Compared& row : rows) {
    if (row.kind != kind) continue;
    count.agree += row.verdict == Verdict::agrees;
    count.better += row.verdict == Verdict::better;
    count.differ += row.verdict == Verdict::differs;
    count.shown += row.verdict == Verdict::shown;
  }
  return count;
}

std::string summaryOf(const std::vector<Compared>& rows, Kind kind) {
  const KindCount n = countOf(rows, kind);
  if (kind == Kind::another_machine) return formatted("%s: %zu, shown next to ours", nameOf(kind), n.shown);
  const std::string better = kind == Kind::reproduced ? formatted(", %zu better here", n.better) : "";
  return formatted("%s: %zu agree%s, %zu differ", nameOf(kind), n.agree, better.c_str(), n.differ);
}

}  // namespace smartmill::studies
