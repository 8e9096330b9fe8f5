// Kim: adaptive control of turning.

#include <cmath>
#include <string>
#include <vector>

#include "gallery/gallery.h"
#include "smartmill_core/formatted.h"
#include "stability/kim_figures.h"

namespace smartmill::studies {
namespace {

Drawn turning(const std::string& folder, unsigned) {
  const stability::KimFigures f = stability::kimFigures(1.0, folder);
  const double printed[][2] = {{327.0, 0.05}, {335.0, 0.06}, {346.0, 0.07}};
  Drawn drawn;
  drawn.pictures = f.pictures;
  for (std::size_t s = 0; s < 3 && s < f.ours.learnt.size(); ++s) {
    const stability::SecondOrder& ours = f.ours.learnt[s].machine;
    const auto off = [&](double frequency, double damping) {
      return std::hypot(frequency / f.truth.frequency - 1.0, damping / f.truth.damping_ratio - 1.0);
    };
    drawn.rows.push_back(
        {Kind::restated,
         formatted("machine as learnt after period %zu, section 4 (true 350 rad/s, 0.02)", s + 1),
         formatted("%.0f rad/s, %.2f", printed[s][0], printed[s][1]),
         formatted("%.1f rad/s, %.4f", ours.frequency, ours.damping_ratio),
         off(ours.frequency, ours.damping_ratio) < off(printed[s][0], printed[s][1]) ? Verdict::agrees
                                                                                     : Verdict::differs,
         "spectra are compared with those of the model output, so that both contain the leakage of the "
         "window"});
  }
  drawn.rows.push_back(
      {Kind::restated, "K / K_m as learnt after period 1, section 4 (true 0.1)", "0.15",
       formatted("%.4f", f.ours.learnt.front().machine.gain),
       std::abs(f.ours.learnt.front().machine.gain - 0.1) < 0.05 ? Verdict::agrees : Verdict::differs, ""});
  const stability::SecondOrder& read = f.kim.segments.at(1).read;
  drawn.rows.push_back({Kind::reproduced,
                        "the machine by his update after period 2 (he estimates 332, 0.11 before it)",
                        "335 rad/s, 0.06", formatted("%.0f rad/s, %.2f", read.frequency, read.damping_ratio),
                        std::abs(read.frequency / 335.0 - 1.0) < 0.05 ? Verdict::agrees : Verdict::differs,
                        "eq. 16 as printed, computed here, from its peak and half-power width"});
  const double free = stability::lastVibration(f.free), ours = stability::lastVibration(f.ours),
               kim = stability::lastVibration(f.kim.trace);
  drawn.rows.push_back(
      {Kind::reproduced, "vibration after 6.144 s, figures 4 and 5", "\"virtually\" ended",
       formatted("%.2g of the uncontrolled one (eq. 16 as printed here: %.2g)", ours / free, kim / free),
       ours < 0.01 * free ? Verdict::agrees : Verdict::differs,
       "eq. 16 divides by a difference of two spectra that may vanish line by line"});
  return drawn;
}

}  // namespace

std::vector<Figure> turningFigures() {
  return {{"kim_4", "Kim figures 4 to 7: chatter in turning, learnt and ended", turning}};
}

}  // namespace smartmill::studies
