// Dunwoody chapter 6: stability charts.

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "gallery/gallery.h"
#include "hammer/offset_cases.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::studies {
namespace {

using Rows = std::vector<std::vector<double>>;

constexpr double SLOWEST = 3000.0, FASTEST = 20000.0;  // [rpm]
constexpr double KT = 936e6;                           // [N/m2] eq. 3.22
constexpr int TEETH = 4;

std::vector<double> speeds() {
  std::vector<double> all;
  for (double rpm = SLOWEST; rpm <= FASTEST; rpm += 20.0) all.push_back(units::radPerSecFromRpm(rpm));
  return all;
}

stability::RegenerativeProcess slot(double kt, double radial) {
  return {TEETH, 0.0, units::PI, kt, radial};
}

double least(const StabilityLimit& limit) {
  return *std::min_element(limit.depth.begin(), limit.depth.end());
}

/// [rpm] of the deepest point between two speeds.
double pocket(const StabilityLimit& limit, double from, double to) {
  std::size_t best = 0;
  for (std::size_t i = 0; i < limit.depth.size(); ++i) {
    const double rpm = units::rpmFromRadPerSec(limit.spindle_speed[i]);
    if (rpm < from || rpm > to) continue;
    if (limit.depth[i] > limit.depth[best] || best == 0) best = i;
  }
  return units::rpmFromRadPerSec(limit.spindle_speed[best]);
}

void draw(const std::string& png, const std::vector<StabilityLimit>& limits,
          const std::vector<std::string>& names) {
  Rows rows;
  for (std::size_t i = 0; i < limits[0].depth.size(); ++i) {
    rows.push_back({units::rpmFromRadPerSec(limits[0].spindle_speed[i])});
    for (const StabilityLimit& limit : limits) rows.back().push_back(1e3 * limit.depth[i]);
  }
  const char* styles[] = {"lw 4 lc rgb '#b0b0b0'", "lw 1.5 lc rgb '#c08040'", "lw 1.5 lc rgb '#2060c0'"};
  Gnuplot plot(png, 900, 500, 12);
  plot.block("rows", rows);
  plot << "set grid\nset key above horizontal samplen 2\nset xlabel 'spindle speed [rpm]'\nset ylabel 'limit "
          "of a slot [mm]'\nset yrange [0:*]\n";
  for (std::size_t k = 0; k < limits.size(); ++k)
    plot << (k == 0 ? "plot" : ",") << " $rows using 1:" << k + 2 << " with lines " << styles[k] << " title "
         << Gnuplot::quoted(names[k]);
  plot << "\n";
  plot.draw();
}

/// Figure 6.2: radial ratio 0.25 and 0.5.
Drawn radialRatio(const std::string& folder, unsigned) {
  // The thesis prints no FRF: a spindle mode and a tool mode near 2400 Hz, stiff enough for 6 mm.
  ModalModel tip;
  tip.modes = {{720.0, 0.035, 1.0 / 70e6}, {2400.0, 0.02, 1.0 / 38e6}};
  const auto response = stability::responseOf(tip, tip, 50.0, 6000.0, 4000);
  std::vector<StabilityLimit> limits;
  for (const double radial : {0.25, 0.5})
    limits.push_back(stability::zeroOrderLimit(slot(KT, radial), response, speeds()));
  const std::string png = folder + "/dunwoody_6_2.png";
  draw(png, limits, {"Kr 0.25", "Kr 0.5"});
  const double ratio = least(limits[1]) / least(limits[0]);
  const double first = pocket(limits[0], 6000.0, 14000.0), second = pocket(limits[1], 6000.0, 14000.0);
  return {
      {png},
      {{Kind::reproduced, "least limit with Kr 0.5 over that with Kr 0.25, figure 6.2", "1.00 (6 mm both)",
        formatted("%.2f", ratio), std::abs(ratio - 1.0) < 0.1 ? Verdict::agrees : Verdict::differs,
        "x and y are equal here; the thesis prints no FRFs"},
       {Kind::reproduced, "speed of the deepest pocket, 6,000 .. 14,000 rpm, with Kr 0.5 over Kr 0.25",
        "\"very similar\"", formatted("%.3f", second / first),
        std::abs(second / first - 1.0) < 0.05 ? Verdict::agrees : Verdict::differs, ""}}};
}

/// The chart of a machine by three methods.
struct Chain {
  StabilityLimit art, thesis, ours;
  double thesis_off = 0.0, ours_off = 0.0;  ///< [1] error of the least limit relative to the state of the art
  double frequency = 0.0;                   ///< [Hz] of the chatter there
};

Chain chainOf(std::mt19937_64& random) {
  const OffsetOutcome outcome = judgeOffset(drawOffsetCase(random), 0.005, random);
  const auto limitOf = [](const FrequencyResponse& frf, double kt, double radial) {
    return stability::zeroOrderLimit(slot(kt, radial), stability::responseOf(frf, frf), speeds());
  };
  const auto frfOf = [&](TipMethod w) -> const FrequencyResponse& {
    return outcome.frf[static_cast<int>(w)];
  };
  Chain chain;
  chain.art = limitOf(outcome.truth, KT, 0.21);
  // Procedure of the thesis: eq. 4.44, eq. 3.20 over 3.22, and 0.3 for any radial ratio.
  chain.thesis = limitOf(frfOf(TipMethod::thesis), 1.11 * KT, 0.3);
  chain.ours = limitOf(frfOf(TipMethod::two_heights), KT, 0.21);
  chain.thesis_off = std::abs(least(chain.thesis) / least(chain.art) - 1.0);
  chain.ours_off = std::abs(least(chain.ours) / least(chain.art) - 1.0);
  const auto lowest = std::min_element(chain.art.depth.begin(), chain.art.depth.end());
  chain.frequency = chain.art.chatter_frequency[static_cast<std::size_t>(lowest - chain.art.depth.begin())];
  return chain;
}

/// Figure 6.3 (and 4.8): the automatic chain with the coefficient of a load meter, compared with a tap test
/// at the tip and the coefficients of a dynamometer.
Drawn automaticChain(const std::string& folder, unsigned seed) {
  constexpr int MACHINES = 21;
  constexpr double HIGHEST = 5000.0;  // [Hz] of the hammer's band
  std::mt19937_64 random(seed);
  std::vector<Chain> chains;
  int beyond = 0;
  for (int i = 0; i < MACHINES; ++i) {
    const Chain chain = chainOf(random);
    // A limiting mode beyond the hammer's band has an uncertainty as large as its value.
    if (chain.frequency > HIGHEST)
      ++beyond;
    else
      chains.push_back(chain);
  }
  std::sort(chains.begin(), chains.end(),
            [](const Chain& a, const Chain& b) { return a.ours_off < b.ours_off; });
  std::vector<double> theirs, mine;
  for (const Chain& chain : chains) {
    theirs.push_back(100.0 * chain.thesis_off);
    mine.push_back(100.0 * chain.ours_off);
  }
  const Chain& middle = chains[chains.size() / 2];
  const std::string png = folder + "/dunwoody_6_3.png";
  draw(png, {middle.art, middle.thesis, middle.ours},
       {"tap at the tip, dynamometer", "thesis: eq. 4.44, load meter 11 % high, Kr 0.3", "here"});
  const auto say = [](const std::vector<double>& e) {
    return formatted("median %.1f %%, 95 %% of machines %.1f %%", percentile(e, 0.5), percentile(e, 0.95));
  };
  return {
      {png},
      {{Kind::reproduced,
        formatted("least limit, error of the automatic chain relative to tap test and dynamometer, %zu "
                  "random machines, figures 4.8, 6.3",
                  chains.size()),
        "\"gross features\"; their procedure here: " + say(theirs), say(mine),
        percentile(mine, 0.5) < percentile(theirs, 0.5) && percentile(mine, 0.95) < percentile(theirs, 0.95)
            ? Verdict::better
            : Verdict::differs,
        formatted("taps at two heights; %d more machines are limited by a mode beyond 5 kHz; the median "
                  "machine is drawn",
                  beyond)}}};
}

}  // namespace

std::vector<Figure> chartFigures() {
  return {
      {"dunwoody_6_2", "Dunwoody figure 6.2: charts with two radial ratios", radialRatio},
      {"dunwoody_6_3", "Dunwoody figure 6.3: the automatic chain and the state of the art", automaticChain}};
}

}  // namespace smartmill::studies
