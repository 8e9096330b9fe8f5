// Burzoni section 6.4: cuts in time.

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "gallery/spindle_sensor.h"
#include "kalman/expanded_disturbance.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/testing/reference_case.h"
#include "smartmill_core/units.h"

namespace smartmill::studies {
namespace {

using Rows = std::vector<std::vector<double>>;
using kalman::BurzoniData;
using kalman::BurzoniTable;

/// A cut of a table with the output of his filter.
struct Compensated {
  double rpm = 0.0, turn = 0.0;  ///< [rpm], [samples]
  std::vector<double> truth, measured, filtered, harmonics;
  std::size_t from = 0;  ///< settled
};

/// The printed Q over the printed R, with the R found here.
double printedQ(const BurzoniTable& table, std::size_t speed) {
  return table.rows[speed].q_printed * table.r_cut / table.r_cut_printed;
}

/// @param q [N2/s]
Compensated compensated(unsigned seed, std::size_t number, std::size_t speed, double q) {
  const BurzoniData& data = burzoniData(seed);
  const BurzoniTable& table = burzoniTableOf(seed, number);
  const auto& cut = data.cuts[speed];
  const double rpm = kalman::BURZONI_RPM[speed];
  Compensated c{rpm,
                60.0 / rpm * BURZONI_RATE,
                cut.truth[table.axis],
                cut.measured[table.axis],
                {},
                cut.compensated[table.axis],
                0};
  c.filtered = kalman::expandedDisturbanceForce(c.measured, data.sensor[table.axis], BURZONI_RATE,
                                                data.flutes * rpm / 60.0, q, table.r_cut);
  c.from = c.truth.size() / 2;
  return c;
}

/// [N] of the mean revolution, from the 5 % to the 95 % quantile.
double range(const Compensated& c, const std::vector<double>& force) {
  constexpr std::size_t BINS = 90;
  std::vector<double> sum(BINS, 0.0), count(BINS, 0.0);
  for (std::size_t i = c.from; i < force.size(); ++i) {
    const double angle = std::fmod(static_cast<double>(i) / c.turn, 1.0);
    const auto bin = std::min(static_cast<std::size_t>(angle * BINS), BINS - 1);
    sum[bin] += force[i];
    count[bin] += 1.0;
  }
  for (std::size_t k = 0; k < BINS; ++k) sum[k] /= std::max(count[k], 1.0);
  return percentile(sum, 0.95) - percentile(sum, 0.05);
}

/// [%]
double rangeError(const Compensated& c, const std::vector<double>& force) {
  return 100.0 * (range(c, force) / range(c, c.truth) - 1.0);
}

/// [%] RMS error over the RMS of the true force, up to the end of the band.
double waveError(const Compensated& c, const std::vector<double>& force) {
  return 100.0 *
         bandError(force, c.truth, BURZONI_RATE, c.from, force.size() - force.size() / 10, BURZONI_BAND);
}

/// Two revolutions and a half, over time.
void block(Gnuplot& plot, const std::string& name, const Compensated& c) {
  Rows rows;
  for (std::size_t i = 0; i < static_cast<std::size_t>(2.5 * c.turn); ++i) {
    const std::size_t at = c.from + i;
    rows.push_back({1e3 * static_cast<double>(i) / BURZONI_RATE, c.truth[at], c.measured[at], c.filtered[at],
                    c.harmonics[at]});
  }
  plot.block(name, rows);
}

void panel(Gnuplot& plot, const std::string& name, const std::string& label) {
  plot << "set ylabel '" << label << " [N]'\nplot $" << name
       << " using 1:3 with lines lw 1 lc rgb '#e0b890' title 'measured', $" << name
       << " using 1:2 with lines lw 4 lc rgb '#b0b0b0' title 'true force', $" << name
       << " using 1:4 with lines lw 1.5 lc rgb '#c02020' title 'his filter, Q over R as printed', $" << name
       << " using 1:5 with lines lw 1.5 lc rgb '#2060c0' title 'this package'\n";
}

constexpr const char* FRAME =
    "set grid\nset lmargin 10\nset key above horizontal samplen 2\nset xlabel 'time [ms]'\n";

/// Figures 39 to 42.
Drawn inTime(const std::string& folder, unsigned seed) {
  const std::string png = folder + "/burzoni_39.png";
  Gnuplot plot(png, 900, 1400, 12);
  plot << "set multiplot layout 4,1\n" << FRAME;
  Drawn drawn{{png}, {}};
  const BurzoniTable& table = burzoniTableOf(seed, 0);
  struct PrintedCut {
    std::size_t speed;
    const char* printed;
  };
  for (const PrintedCut& s : {PrintedCut{4, "plotted, no number"}, PrintedCut{1, "about 10 % off"},
                              PrintedCut{3, "underestimated"}, PrintedCut{5, "up to 30 % off"}}) {
    const Compensated c = compensated(seed, 0, s.speed, printedQ(table, s.speed));
    const Compensated best = compensated(seed, 0, s.speed, std::pow(2.0, table.rows[s.speed].cut_exponent));
    const std::string name = formatted("cut%zu", s.speed);
    block(plot, name, c);
    panel(plot, name, formatted("x at %.0f rpm", c.rpm));
    const double his = rangeError(c, c.filtered), ours = rangeError(c, c.harmonics);
    drawn.rows.push_back(
        {Kind::another_machine, formatted("amplitude by his filter, %.0f rpm, x, figures 39 to 42", c.rpm),
         s.printed,
         formatted("%+.0f %%; with the cut's best Q %+.0f %%; this package %+.1f %%", his,
                   rangeError(best, best.filtered), ours),
         Verdict::shown,
         formatted(
             "Q over R as printed; range of the mean revolution; another sensor and cut; waveform error "
             "%.0f %%, with the cut's best Q %.0f %%, this package %.1f %%",
             waveError(c, c.filtered), waveError(best, best.filtered), waveError(c, c.harmonics))});
  }
  plot << "unset multiplot\n";
  plot.draw();
  return drawn;
}

/// Figure 46: 9000 rpm with R of the taps in the cut, frequency above, time below.
Drawn lowNoise(const std::string& folder, unsigned seed) {
  constexpr std::size_t TABLE = 1, SPEED = 4;
  const Compensated c = compensated(seed, TABLE, SPEED, printedQ(burzoniTableOf(seed, TABLE), SPEED));
  const auto lines = [&](const std::vector<double>& force) {
    const auto whole = static_cast<std::size_t>(
        std::lround(std::floor(static_cast<double>(force.size() - c.from) / c.turn) * c.turn));
    const std::vector<double> part(force.end() - static_cast<std::ptrdiff_t>(whole), force.end());
    std::vector<double> sizes;
    for (const auto& line : fourier(part)) sizes.push_back(2.0 * std::abs(line) / static_cast<double>(whole));
    return std::pair(sizes, BURZONI_RATE / static_cast<double>(whole));
  };
  const auto [is, apart] = lines(c.truth);
  const auto measured_lines = lines(c.measured).first, filtered = lines(c.filtered).first,
             ours = lines(c.harmonics).first;
  Rows rows;
  for (std::size_t i = 1; static_cast<double>(i) * apart < BURZONI_BAND; ++i)
    rows.push_back({static_cast<double>(i) * apart, is[i], measured_lines[i], filtered[i], ours[i]});
  const std::string png = folder + "/burzoni_46.png";
  Gnuplot plot(png, 900, 900, 12);
  plot.block("lines", rows);
  block(plot, "cut", c);
  plot << "set multiplot layout 2,1\n" << FRAME << "set xlabel 'frequency [Hz]'\n";
  panel(plot, "lines", "x at 9000 rpm");
  plot << "set xlabel 'time [ms]'\n";
  panel(plot, "cut", "x at 9000 rpm");
  plot << "unset multiplot\n";
  plot.draw();
  const kalman::BurzoniRow& r = burzoniTableOf(seed, TABLE).rows[SPEED];
  return {{png},
          {{Kind::another_machine, "RMSE at 9000 rpm, R of the taps in both, x, table 9, figure 46 [N]",
            formatted("%.3f, the worst", r.rmse_printed),
            formatted("his filter %.3f, with noisy taps %.3f; this package %.3f", r.rmse, r.noisy_rmse,
                      r.harmonics),
            Verdict::shown,
            "his sensor has almost no response at 500 .. 700 Hz; the simulated one has no such gap"}}};
}

/// Figure 57: y at 17,600 rpm by R, and the effect of a Q other than the best.
Drawn fastest(const std::string& folder, unsigned seed) {
  constexpr std::size_t SPEED = 6, HIGH = 4, LOW = 5;  // tables 12 and 13
  const BurzoniTable &cut_high = burzoniTableOf(seed, HIGH), &cut_low = burzoniTableOf(seed, LOW);
  const Compensated high = compensated(seed, HIGH, SPEED, printedQ(cut_high, SPEED)),
                    low = compensated(seed, LOW, SPEED, printedQ(cut_low, SPEED));
  const std::string png = folder + "/burzoni_57.png";
  Gnuplot plot(png, 900, 900, 12);
  block(plot, "high", high);
  block(plot, "low", low);
  plot << "set multiplot layout 2,1\n" << FRAME;
  panel(plot, "high", formatted("y, 17,600 rpm, R %.1f N2", cut_high.r_cut));
  panel(plot, "low", formatted("y, 17,600 rpm, R %.2f N2", cut_low.r_cut));
  plot << "unset multiplot\n";
  plot.draw();
  Drawn drawn{{png}, {}};
  for (const BurzoniTable* table : {&cut_high, &cut_low}) {
    const kalman::BurzoniRow& r = table->rows[SPEED];
    drawn.rows.push_back({Kind::another_machine,
                          formatted("RMSE at 17,600 rpm, y, %s, figure 57 [N]", table->name.c_str()),
                          formatted("%.3f", r.rmse_printed),
                          formatted("his filter %.3f, with noisy taps %.3f; this package %.3f", r.rmse,
                                    r.noisy_rmse, r.harmonics),
                          Verdict::shown, "another machine, cut and force than his"});
  }
  const int best = cut_high.rows[SPEED].cut_exponent;
  const Compensated above = compensated(seed, HIGH, SPEED, std::pow(2.0, best + 6));
  const double left = rangeError(high, high.filtered), right = rangeError(above, above.filtered);
  drawn.rows.push_back(
      {Kind::reproduced, "amplitude with Q below and above the best of the cut, y at 17,600 rpm, section 6.4",
       "too small, too large",
       formatted("%+.0f %% (Q over R as printed), %+.0f %% (64 times the best)", left, right),
       left < 0.0 && right > 0.0 ? Verdict::agrees : Verdict::differs,
       "range of the mean revolution; too large a Q lets the noise through"});
  return drawn;
}

}  // namespace

std::vector<Figure> sensorCutFigures() {
  return {{"burzoni_39", "Burzoni figures 39 to 42: cuts in time, x, R of table 8", inTime},
          {"burzoni_46", "Burzoni figure 46: 9000 rpm with R of the taps, in frequency and time", lowNoise},
          {"burzoni_57", "Burzoni figure 57: 17,600 rpm by R, y", fastest}};
}

}  // namespace smartmill::studies
