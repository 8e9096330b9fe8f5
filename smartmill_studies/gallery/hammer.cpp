// Dunwoody chapter 4: the automatic hammer.

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "gallery/gallery.h"
#include "hammer/station_score.h"
#include "hammer/tip_figures.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill::studies {
namespace {

/// Section 4.3.1: a force of 0.4 ms at 50 kHz in a record of 0.2 s.
Drawn forceWindow(const std::string& folder, unsigned seed) {
  constexpr double RATE = 50000.0, WIDTH = 0.4e-3, AT = 2e-3;
  constexpr std::size_t SAMPLES = 10000;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  std::vector<double> force(SAMPLES);
  for (std::size_t i = 0; i < SAMPLES; ++i) {
    const double t = static_cast<double>(i) / RATE - AT;
    force[i] = noise(random) + (t > 0.0 && t < WIDTH ? 200.0 * std::sin(units::PI * t / WIDTH) : 0.0);
  }
  const std::vector<double> window = impactWindow(force);
  double power = 0.0;
  for (const double w : window) power += w * w / SAMPLES;
  const double left = std::sqrt(power);  // eq. 4.16
  std::vector<std::vector<double>> rows;
  for (std::size_t i = 50; i < 200; ++i)
    rows.push_back({1e3 * static_cast<double>(i) / RATE, force[i], 200.0 * window[i]});
  const std::string png = folder + "/dunwoody_4_3.png";
  Gnuplot plot(png, 900, 450, 12);
  plot.block("rows", rows);
  plot
      << "set grid\nset key above horizontal samplen 2\nset xlabel 'time [ms]'\nset ylabel 'force [N]'\nplot "
         "$rows using 1:2 with lines lw 1.5 "
         "lc rgb "
         "'#2060c0' title 'hammer', $rows using 1:3 with lines lw 2 dt 2 lc rgb '#c02020' title 'window, eq. "
         "4.17..4.19 (1 is 200 N)'\n";
  plot.draw();
  return {{png},
          {{Kind::reproduced, "error of the windowed spectrum over that of the raw one, section 4.3.1", "6 %",
            formatted("%.1f %%", 100.0 * left),
            std::abs(left - 0.06) < 0.005 ? Verdict::agrees : Verdict::differs,
            "printed digit; eq. 4.16 with this window; the thesis does not state the pulse shape, a half "
            "sine here"}}};
}

/// The first random machine that the station measures.
hammer::StationFrfs stationFrfs(unsigned seed) {
  hammer::StationStudy study;
  study.seed = seed;
  for (int number = 0; number < 20; ++number) {
    hammer::StationFrfs frfs;
    hammer::runStation(study, number, &frfs);
    if (frfs.measured.size() > 0) return frfs;
  }
  throw Error("none of twenty random stations was measured");
}

/// Norm of the difference over the norm [1], 250 to 4900 Hz.
double apart(const FrequencyResponse& estimated, const FrequencyResponse& truth) {
  double difference = 0.0, whole = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (truth.frequency[i] < hammer::BAND_LOW || truth.frequency[i] > hammer::BAND_HIGH) continue;
    difference += std::norm(estimated.value[i] - truth.value[i]);
    whole += std::norm(truth.value[i]);
  }
  return std::sqrt(difference / whole);
}

/// Stated standard deviations of an estimate over the norm of the truth [1], in the same band.
double statedDeviation(const FrequencyResponse& estimated, const FrequencyResponse& truth) {
  double variance = 0.0, whole = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (truth.frequency[i] < hammer::BAND_LOW || truth.frequency[i] > hammer::BAND_HIGH) continue;
    variance += std::pow(estimated.std_dev.at(i), 2);
    whole += std::norm(truth.value[i]);
  }
  return std::sqrt(variance / whole);
}

double peak(const FrequencyResponse& frf) {
  double most = 0.0;
  for (const auto& value : frf.band(hammer::BAND_LOW, hammer::BAND_HIGH).value)
    most = std::max(most, std::abs(value));
  return most;
}

double least(const StabilityLimit& limit) {
  return *std::min_element(limit.depth.begin(), limit.depth.end());
}

/// [rpm] of the deepest point above 10,000 rpm.
double pocket(const StabilityLimit& limit) {
  std::size_t best = limit.depth.size() - 1;
  for (std::size_t i = 0; i < limit.depth.size(); ++i)
    if (units::rpmFromRadPerSec(limit.spindle_speed[i]) > 10000.0 && limit.depth[i] > limit.depth[best])
      best = i;
  return units::rpmFromRadPerSec(limit.spindle_speed[best]);
}

/// Figures 4.5 to 4.8: a random tool in a random machine at the simulated station.
Drawn automaticHammer(const std::string& folder, unsigned seed) {
  const hammer::StationFrfs f = stationFrfs(seed);
  const TipCurve direct{"direct, at the tip", f.direct}, measured{"measured, no correction", f.measured},
      thesis{"eq. 4.44", f.thesis}, tip{"receptance coupling", f.tip};
  Drawn drawn;
  for (const char* number : {"5", "6", "7", "8"})
    drawn.pictures.push_back(folder + "/dunwoody_4_" + number + ".png");
  drawParts({{"true, at the heights of hammer and sensor", f.across}, measured}, drawn.pictures[0]);
  drawParts({direct, measured}, drawn.pictures[1]);
  drawParts({direct, measured, thesis, tip}, drawn.pictures[2]);
  const auto limits = drawSlotLimits({direct, measured, thesis, tip}, drawn.pictures[3]);
  const double stated = statedDeviation(f.measured, f.across), across = apart(f.measured, f.across),
               raw = apart(f.measured, f.direct), corrected = apart(f.thesis, f.direct),
               ours = apart(f.tip, f.direct);
  drawn.rows.push_back(
      {Kind::reproduced, "automatic hammer and true FRF of the same two heights, figure 4.5",
       "\"very similar\"", formatted("%.1f %% rms, stated deviation %.1f %%", 100.0 * across, 100.0 * stated),
       across < 1.96 * stated ? Verdict::agrees : Verdict::differs,
       "250 to 4900 Hz, within 1.96 stated deviations; the thesis compares with a manual hammer"});
  const double stiffer = peak(f.measured) / peak(f.direct);
  drawn.rows.push_back({Kind::reproduced, "largest peak, hit above the tip over hit at the tip, figure 4.6",
                        "stiffer: below 1", formatted("%.2f", stiffer),
                        stiffer < 1.0 ? Verdict::agrees : Verdict::differs,
                        "theirs at 2400 Hz; neither tool nor spindle is printed"});
  drawn.rows.push_back(
      {Kind::reproduced, "corrected FRF and true FRF of the tip, figure 4.7", "\"matches more closely\"",
       formatted("eq. 4.44 %.0f %%, uncorrected %.0f %% rms", 100.0 * corrected, 100.0 * raw),
       corrected < raw ? Verdict::agrees : Verdict::differs,
       "eq. 4.44 scales all modes equally, including that of the spindle"});
  drawn.rows.push_back({Kind::reproduced, "the same by receptance coupling", "\"matches more closely\"",
                        formatted("%.1f %% rms", 100.0 * ours),
                        ours < corrected ? Verdict::better : Verdict::differs,
                        "by the mode shapes of the beam"});
  const double high = least(limits[1]) / least(limits[0]), right = least(limits[3]) / least(limits[0]);
  drawn.rows.push_back(
      {Kind::reproduced, "least limit of a slot, uncorrected over the tip's, figure 4.8", "much higher",
       formatted("%.2f (eq. 4.44 %.2f, here %.2f)", high, least(limits[2]) / least(limits[0]), right),
       high > 1.05 ? Verdict::agrees : Verdict::differs, "aluminium, four teeth"});
  const double shift = pocket(limits[1]) / pocket(limits[0]);
  drawn.rows.push_back(
      {Kind::reproduced, "speed of the deepest pocket, uncorrected over the tip's, figure 4.8", "the same",
       formatted("%.3f", shift), std::abs(shift - 1.0) < 0.02 ? Verdict::agrees : Verdict::differs,
       "above 10,000 rpm"});
  return drawn;
}

}  // namespace

std::vector<Figure> hammerFigures() {
  return {{"dunwoody_4_3", "Dunwoody figure 4.3: the window of the force", forceWindow},
          {"dunwoody_4_5", "Dunwoody figures 4.5 to 4.8: the automatic hammer and the FRF of the tip",
           automaticHammer}};
}

}  // namespace smartmill::studies
