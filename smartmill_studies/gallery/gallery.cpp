#include "gallery/gallery.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/formatted.h"

namespace smartmill::studies {

const char* nameOf(Verdict verdict) {
  switch (verdict) {
    case Verdict::agrees:
      return "agrees";
    case Verdict::better:
      return "better";
    default:
      return "differs";
  }
}

std::vector<Figure> allFigures() {
  std::vector<Figure> all;
  for (const auto& some : {loadMeterFigures(), hammerFigures(), dynamometerFigures(), chartFigures(),
                           turningFigures(), spindleSensorFigures(), plateFigures(), motorFigures()})
    all.insert(all.end(), some.begin(), some.end());
  return all;
}

Compared compareNumber(const std::string& what, double seed, double ours, double ours_std, double share,
                       const std::string& why) {
  const bool near = std::abs(ours - seed) <= std::max(share * std::abs(seed), 1.96 * ours_std);
  const std::string our_text =
      ours_std > 0.0 ? formatted("%.4g +- %.2g", ours, ours_std) : formatted("%.4g", ours);
  return {what, formatted("%.4g", seed), our_text, near ? Verdict::agrees : Verdict::differs, why};
}

}  // namespace smartmill::studies
