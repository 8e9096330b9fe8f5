// Dunwoody chapter 4: the automatic hammer.

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "gallery/gallery.h"
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
  Gnuplot plot(png, 1000, 450);
  plot.block("rows", rows);
  plot
      << "set grid\nset xlabel 'time [ms]'\nset ylabel 'force [N]'\nplot $rows using 1:2 with lines lw 1.5 "
         "lc rgb "
         "'#2060c0' title 'hammer', $rows using 1:3 with lines lw 2 dt 2 lc rgb '#c02020' title 'window, eq. "
         "4.17..4.19 (1 is 200 N)'\n";
  plot.draw();
  return {
      {png},
      {{"error of the windowed spectrum over the raw one's, section 4.3.1", "6 %",
        formatted("%.1f %%", 100.0 * left), std::abs(left - 0.06) < 0.01 ? Verdict::agrees : Verdict::differs,
        "eq. 4.16 with this window; the thesis does not tell the pulse's shape, a half sine here"}}};
}

}  // namespace

std::vector<Figure> hammerFigures() {
  return {{"dunwoody_4_3", "Dunwoody figure 4.3: the force's window", forceWindow}};
}

}  // namespace smartmill::studies
