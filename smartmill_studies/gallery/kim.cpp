// Kim: adaptive control of turning.

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "gallery/gallery.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "stability/kim_figures.h"

namespace smartmill::studies {
namespace {

using stability::KimUpdate;

// Resolution of his spectra, 512 points of 1 ms: lines [rad/s], width of a Hamming window [lines].
constexpr double LINE = units::TWO_PI * 1000.0 / 512.0, HAMMING = 1.36;

const std::string AS_PRINTED =
    "numerator Y_w of the last segment minus Y_t of the one before it, spectra of the motions (eq. 12); to "
    "the "
    "resolution of his spectra";
const std::string CORRECTED =
    "secant of Y_w - Y_t: both of the last segment, over the chip of their segment; to the resolution of his "
    "spectra";
const std::string BEFORE_IT =
    "eq. 16 acts from 4.096 s on; before, the controller read off the first estimate acts alone";
const std::string NO_STATED_SPEED =
    "he states no spindle speed; here the free vibration grows by e a segment";

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
  const double free = stability::lastVibration(f.free), ours = stability::lastVibration(f.ours);
  // His updates; printed[1] and printed[2] are the results of his first and second application.
  for (const auto& [update, kim] :
       {std::pair(KimUpdate::printed, &f.printed), std::pair(KimUpdate::corrected, &f.corrected)}) {
    for (std::size_t s = 1; s < 3; ++s) {
      const stability::SecondOrder& read = kim->segments.at(s).read;
      const bool near = std::abs(read.frequency - printed[s][0]) < LINE &&
                        std::abs(read.damping_ratio - printed[s][1]) < HAMMING * LINE / (2.0 * printed[s][0]);
      drawn.rows.push_back(
          {Kind::reproduced, formatted("%s, machine after period %zu, section 4", nameOf(update), s + 1),
           formatted("%.0f rad/s, %.2f", printed[s][0], printed[s][1]),
           formatted("%.0f rad/s, %.3f", read.frequency, read.damping_ratio),
           near ? Verdict::agrees : Verdict::differs, update == KimUpdate::printed ? AS_PRINTED : CORRECTED});
    }
    const double left = stability::lastVibration(kim->trace), early = kim->trace.vibration(3.596, 4.096);
    drawn.rows.push_back({Kind::reproduced,
                          formatted("%s, vibration after 6.144 s, figures 4 and 5", nameOf(update)),
                          "\"virtually\" ended",
                          formatted("%.2g of the uncontrolled one; after 4.096 s %.2g", left / free,
                                    early / f.free.vibration(3.596, 4.096)),
                          left < 0.01 * free ? Verdict::agrees : Verdict::differs, BEFORE_IT});
  }
  drawn.rows.push_back({Kind::reproduced, "this package, vibration after 6.144 s, figures 4 and 5",
                        "\"virtually\" ended", formatted("%.2g of the uncontrolled one", ours / free),
                        ours < 0.01 * free ? Verdict::agrees : Verdict::differs, NO_STATED_SPEED});
  return drawn;
}

}  // namespace

std::vector<Figure> turningFigures() {
  return {{"kim_4", "Kim figures 4 to 7: chatter in turning, learnt and ended", turning}};
}

}  // namespace smartmill::studies
