// Burzoni section 6.4: cuts with R and Q of the taps, tables 8 to 15.

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "gallery/spindle_sensor.h"
#include "kalman/expanded_disturbance.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill::studies {
namespace {

using Rows = std::vector<std::vector<double>>;
using kalman::BurzoniRow;
using kalman::BurzoniTable;

const std::string OTHER_CUT =
    "his filter on another machine, cut and force than his; his errors arise with the noisy taps";

Rows curveOf(const BurzoniRow& row) {
  Rows rows;
  for (std::size_t i = 0; i < row.curve.size(); ++i)
    rows.push_back({std::pow(2.0, kalman::LEAST_EXPONENT + static_cast<double>(i)), row.curve[i]});
  return rows;
}

/// Upper half: RMSE of each cut over Q, with Q of the taps as dots; lower half: RMSE over speed, printed and
/// here.
void drawTable(const BurzoniTable& table, const std::string& png) {
  Gnuplot plot(png, 900, 950, 12);
  Rows dots, speeds;
  for (std::size_t k = 0; k < table.rows.size(); ++k) {
    const BurzoniRow& r = table.rows[k];
    plot.block(formatted("curve%zu", k), curveOf(r));
    dots.push_back({std::pow(2.0, r.exponent), r.rmse});
    speeds.push_back({r.rpm, r.rmse_printed, r.rmse, r.noisy_rmse, r.harmonics});
  }
  plot.block("dots", dots);
  plot.block("speeds", speeds);
  plot << "set multiplot layout 2,1\nset grid\nset lmargin 10\nset key above horizontal samplen 2\nset "
          "logscale "
          "xy\nset format x '10^%T'\nset xlabel 'Q [N2/s]'\nset ylabel 'RMSE of the harmonics, "
       << AXIS_NAMES[table.axis] << " [N]'\n";
  for (std::size_t k = 0; k < table.rows.size(); ++k)
    plot << (k ? ", " : "plot ") << "$curve" << k << " using 1:2 with lines lw 2 lc rgb '"
         << BURZONI_COLOURS[k] << "' title '" << table.rows[k].rpm << " rpm'";
  plot
      << ", $dots using 1:2 with points pt 7 ps 1.2 lc rgb '#e00000' title 'Q of the taps'\n"
         "unset logscale x\nset format x '%g'\nset xlabel 'spindle speed [rpm]'\nset xrange [0:18000]\nplot "
         "$speeds using 1:2 with linespoints pt 7 lw 3 lc rgb '#b0b0b0' title 'printed, "
      << table.name
      << "', $speeds using 1:3 with linespoints pt 7 lc rgb '#c08040' title 'his filter here, Q of the "
         "taps', "
         "$speeds using 1:4 with linespoints pt 7 lc rgb '#c02020' title 'his filter here, Q of noisy taps', "
         "$speeds using 1:5 with linespoints pt 7 lc rgb '#2060c0' title 'this package'\nunset multiplot\n";
  plot.draw();
}

std::string powerOfTwo(double q) {
  return formatted("2^%.0f", std::log2(q));
}

Drawn tableOf(const std::string& folder, unsigned seed, std::size_t number) {
  const BurzoniTable& table = burzoniTableOf(seed, number);
  const std::string png = folder + formatted("/burzoni_table_%zu.png", 8 + number);
  drawTable(table, png);
  Drawn drawn{{png}, {}};
  double worst_printed = 0.0, worst = 0.0, worst_noisy = 0.0, worst_harmonics = 0.0;
  std::vector<double> printed, noisy;
  for (const BurzoniRow& r : table.rows) {
    drawn.rows.push_back(
        {Kind::another_machine,
         formatted("%s, %.0f rpm: RMSE with the taps' Q [N]", table.name.c_str(), r.rpm),
         formatted("%.3f (Q %.0f, %s)", r.rmse_printed, r.q_printed, powerOfTwo(r.q_printed).c_str()),
         formatted("his filter %.3f (Q 2^%d), with noisy taps %.3f (Q 2^%d); this package %.3f", r.rmse,
                   r.exponent, r.noisy_rmse, r.noisy_exponent, r.harmonics),
         Verdict::shown, OTHER_CUT});
    worst_printed = std::max(worst_printed, r.rmse_printed);
    worst = std::max(worst, r.rmse);
    worst_noisy = std::max(worst_noisy, r.noisy_rmse);
    worst_harmonics = std::max(worst_harmonics, r.harmonics);
    printed.push_back(std::log2(r.q_printed));
    noisy.push_back(r.noisy_exponent);
  }
  drawn.rows.push_back({Kind::another_machine,
                        formatted("largest RMSE of seven speeds, %s [N]", table.name.c_str()),
                        formatted("%.2f", worst_printed),
                        formatted("his filter %.2f, with noisy taps %.2f; this package %.2f", worst,
                                  worst_noisy, worst_harmonics),
                        Verdict::shown, OTHER_CUT});
  drawn.rows.push_back(
      {Kind::restated, formatted("Q of noisy taps, median of seven speeds, %s [N2/s]", table.name.c_str()),
       formatted("2^%.0f", median(printed)), formatted("2^%.0f", median(noisy)),
       std::abs(median(noisy) - std::round(median(printed))) <= 1.0 ? Verdict::agrees : Verdict::differs,
       formatted(
           "noise of the taps %g times the root of R, one number for all tables; the others follow from "
           "the ratio of the R's",
           kalman::BURZONI_TAP_NOISE)});
  return drawn;
}

/// R of section 6.2 and the kurtosis of 5-17.
Drawn noise(const std::string& folder, unsigned seed) {
  const kalman::BurzoniData& data = burzoniData(seed);
  const std::string png = folder + "/burzoni_5_17.png";
  Gnuplot plot(png, 900, 450, 12);
  Drawn drawn{{png}, {}};
  plot << "set grid\nset key above horizontal\nset xlabel 'deviations from the mean'\nset ylabel 'share of "
          "the "
          "samples'\nset xrange [-5:5]\nset logscale y\nset yrange [1e-5:1]\n";
  const auto histogram = [&](const char* name, const std::vector<double>& values) {
    constexpr double WIDTH = 0.25;
    const double middle = mean(values), s = standardDeviation(values);
    std::vector<double> counts(40, 0.0);
    for (const double v : values) {
      const double bin = std::floor((v - middle) / s / WIDTH) + 20.0;
      if (bin >= 0.0 && bin < 40.0)
        counts[static_cast<std::size_t>(bin)] += 1.0 / static_cast<double>(values.size());
    }
    Rows rows;
    for (std::size_t i = 0; i < counts.size(); ++i)
      if (counts[i] > 0.0) rows.push_back({(static_cast<double>(i) - 19.5) * WIDTH, counts[i]});
    plot.block(name, rows);
  };
  histogram("still", data.still[0]);
  histogram("air", data.air[0]);
  plot << "plot 0.25 / sqrt(2 * pi) * exp(-x * x / 2) with lines lw 4 lc rgb '#b0b0b0' title 'Gaussian', "
          "$still "
          "using 1:2 with points pt 7 lc rgb '#2060c0' title 'at rest, x', $air using 1:2 with points pt 6 "
          "ps 1.3 "
          "lc rgb '#c02020' title 'cutting air at 9000 rpm, x'\n";
  plot.draw();
  const auto row = [&](const char* what, double printed, const std::array<double, 2>& ours) {
    const double worst =
        std::max(std::abs(std::log2(ours[0] / printed)), std::abs(std::log2(ours[1] / printed)));
    drawn.rows.push_back({Kind::restated, what, formatted("%g", printed),
                          formatted("x %.2f, y %.2f", ours[0], ours[1]),
                          worst < 0.5 ? Verdict::agrees : Verdict::differs,
                          "the noise of the simulated sensor is designed for these two values; within half a "
                          "step of q = 2^n, as the filter depends on Q over R"});
  };
  row("R before taps, section 6.2 [N2]", 0.15, data.r_tap);
  row("R cutting air, section 6.2 [N2]", 10.0, data.r_air);
  const auto kurtosis = [&](const char* what, const std::vector<double>& values) {
    // Standard deviation of the kurtosis of n independent Gaussian samples: sqrt(24 / n).
    drawn.rows.push_back(compareNumber(Kind::restated, what, 3.0, kalman::kurtosis(values),
                                       std::sqrt(24.0 / static_cast<double>(values.size())), 0.0,
                                       "of a Gaussian"));
  };
  kurtosis("kurtosis at rest, eq. 5-17", data.still[0]);
  kurtosis("kurtosis in an air cut, without unbalance, eq. 5-17", data.air[0]);
  return drawn;
}

/// Figures 43 and 44, of y 51 and 52: curves of the cuts by R.
Drawn byNoise(const std::string& folder, unsigned seed, std::size_t axis) {
  const BurzoniTable &high = burzoniTableOf(seed, HYPOTHESES * axis),
                     &low = burzoniTableOf(seed, HYPOTHESES * axis + 1);
  const std::size_t figure = axis == 0 ? 43 : 51;
  const std::string png = folder + formatted("/burzoni_%zu.png", figure);
  Gnuplot plot(png, 900, 950, 12);
  Rows bars;
  std::vector<double> shift, minima;
  for (std::size_t k = 0; k < high.rows.size(); ++k) {
    plot.block(formatted("high%zu", k), curveOf(high.rows[k]));
    plot.block(formatted("low%zu", k), curveOf(low.rows[k]));
    bars.push_back({high.rows[k].rpm, low.rows[k].cut_rmse, high.rows[k].cut_rmse});
    shift.push_back(high.rows[k].cut_exponent - low.rows[k].cut_exponent);
    minima.push_back(std::abs(low.rows[k].cut_rmse / high.rows[k].cut_rmse - 1.0));
  }
  plot.block("bars", bars);
  plot << "set multiplot layout 2,1\nset grid\nset lmargin 10\nset key above horizontal samplen 2\nset "
          "logscale "
          "xy\nset format x '10^%T'\nset xlabel 'Q [N2/s]; dashed: R of the taps, full: R of air'\nset "
          "ylabel "
          "'RMSE of the cut, "
       << AXIS_NAMES[axis] << " [N]'\n";
  for (std::size_t k = 0; k < high.rows.size(); ++k)
    plot << (k ? ", " : "plot ") << "$high" << k << " using 1:2 with lines lw 2 lc rgb '"
         << BURZONI_COLOURS[k] << "' title '" << high.rows[k].rpm << " rpm', $low" << k
         << " using 1:2 with lines lw 2 dt 2 lc rgb '" << BURZONI_COLOURS[k] << "' notitle";
  plot
      << "\nunset logscale\nset format x '%g'\nset xlabel 'spindle speed [rpm]'\nset ylabel 'RMSE with the "
         "best Q of the cut [N]'\nset xrange [0:18000]\nset yrange [0:*]\nplot $bars using 1:2 with "
         "linespoints pt "
         "6 ps "
         "1.4 lc rgb '#c08040' title 'R of the taps', $bars using 1:3 with linespoints pt 7 lc rgb '#2060c0' "
         "title 'R of cutting air'\nunset multiplot\n";
  plot.draw();
  const double most = *std::max_element(minima.begin(), minima.end());
  return {
      {png},
      {{Kind::restated,
        formatted("best Q of a cut as R falls from that of air to that of taps, %s, figure %zu",
                  AXIS_NAMES[axis], figure),
        "\"lower Q\"", formatted("/ 2^%.1f (R / 2^%.1f)", median(shift), std::log2(high.r_cut / low.r_cut)),
        median(shift) > 0.0 ? Verdict::agrees : Verdict::differs,
        "median of seven speeds; a filter depends only on Q over R"},
       {Kind::restated,
        formatted("RMSE at the best Q of each R, %s, figure %zu", AXIS_NAMES[axis], figure + 1),
        "\"almost unchanged\"", formatted("within %.0f %%", 100.0 * most),
        most < 0.1 ? Verdict::agrees : Verdict::differs, "a filter depends only on Q over R"}}};
}

double worstOf(const BurzoniTable& table, double BurzoniRow::*what) {
  double worst = 0.0;
  for (const BurzoniRow& r : table.rows) worst = std::max(worst, r.*what);
  return worst;
}

/// Figure 49, of y 56: comparison of the hypotheses.
Drawn overview(const std::string& folder, unsigned seed, std::size_t axis) {
  const std::size_t figure = axis == 0 ? 49 : 56;
  const std::string png = folder + formatted("/burzoni_%zu.png", figure);
  Rows rows;
  std::array<double, HYPOTHESES> printed{}, here{}, noisy{};
  std::string names[HYPOTHESES];
  for (std::size_t k = 0; k < kalman::BURZONI_RPM.size(); ++k) rows.push_back({kalman::BURZONI_RPM[k]});
  for (std::size_t h = 0; h < HYPOTHESES; ++h) {
    const BurzoniTable& table = burzoniTableOf(seed, HYPOTHESES * axis + h);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      rows[k].push_back(table.rows[k].rmse_printed);
      rows[k].push_back(table.rows[k].rmse);
    }
    printed[h] = worstOf(table, &BurzoniRow::rmse_printed);
    here[h] = worstOf(table, &BurzoniRow::rmse);
    noisy[h] = worstOf(table, &BurzoniRow::noisy_rmse);
    names[h] = formatted("R %g taps, %g cuts", table.r_tap_printed, table.r_cut_printed);
  }
  Gnuplot plot(png, 900, 900, 12);
  plot.block("rows", rows);
  plot
      << "set multiplot layout 2,1\nset grid\nset lmargin 10\nset key above horizontal samplen 2\nset xlabel "
         "'spindle speed [rpm]'\nset xrange [0:18000]\nset yrange [0:*]\n";
  for (const auto& [label, first] : {std::pair("printed", 2), std::pair("his filter here", 3)}) {
    plot << "set ylabel 'RMSE " << AXIS_NAMES[axis] << ", " << label << " [N]'\n";
    for (std::size_t h = 0; h < HYPOTHESES; ++h)
      plot << (h ? ", " : "plot ") << "$rows using 1:" << static_cast<std::size_t>(first) + 2 * h
           << " with linespoints pt 7 lw 1.5 lc rgb '" << BURZONI_COLOURS[h] << "' title '" << names[h]
           << "'";
    plot << "\n";
  }
  plot << "unset multiplot\n";
  plot.draw();
  const auto told = [](const std::array<double, HYPOTHESES>& worst) {
    return formatted("%.2f; %.2f; %.2f; %.2f", worst[0], worst[1], worst[2], worst[3]);
  };
  // "Excluding manual calibrations", which is the fourth.
  const bool first = here[0] < 0.95 * std::min(here[1], here[2]);
  return {
      {png},
      {{Kind::reproduced,
        formatted(
            "largest RMSE by R of taps and cuts (0.15, 10; 0.15, 0.15; 10, 10; 2, 10), %s, figure %zu [N]",
            AXIS_NAMES[axis], figure),
        told(printed) + ": the first is best", told(here) + "; noisy taps: " + told(noisy),
        first ? Verdict::agrees : Verdict::differs,
        "his filter; his advice is based on noise in the cut that is absent in taps; if Q over R of the taps "
        "suits the cut, equal R suit as well"}}};
}

}  // namespace

std::vector<Figure> sensorTableFigures() {
  constexpr std::size_t DRAWN_AS[] = {38, 45, 47, 48, 50, 53, 54, 55};
  std::vector<Figure> all{{"burzoni_5_17", "Burzoni eq. 5-17 and R of section 6.2: the noise", noise}};
  for (std::size_t number = 0; number < kalman::BURZONI_TABLES; ++number)
    all.push_back(
        {formatted("burzoni_table_%zu", 8 + number),
         formatted("Burzoni table %zu and figure %zu: Q of the taps in seven cuts, %s", 8 + number,
                   DRAWN_AS[number], AXIS_NAMES[number / HYPOTHESES]),
         [number](const std::string& folder, unsigned seed) { return tableOf(folder, seed, number); }});
  for (std::size_t axis = 0; axis < 2; ++axis) {
    all.push_back({axis == 0 ? "burzoni_43" : "burzoni_51",
                   axis == 0 ? "Burzoni figures 43 and 44: best Q of the cuts by R, x"
                             : "Burzoni figures 51 and 52: best Q of the cuts by R, y",
                   [axis](const std::string& folder, unsigned seed) { return byNoise(folder, seed, axis); }});
    all.push_back(
        {axis == 0 ? "burzoni_49" : "burzoni_56",
         axis == 0 ? "Burzoni figure 49: comparison of the hypotheses for R, x"
                   : "Burzoni figure 56: comparison of the hypotheses for R, y",
         [axis](const std::string& folder, unsigned seed) { return overview(folder, seed, axis); }});
  }
  return all;
}

}  // namespace smartmill::studies
