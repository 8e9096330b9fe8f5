// Burzoni chapters 4 and 6: the plant from taps, its confidence, and the maps of Q over speed.

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "gallery/spindle_sensor.h"
#include "kalman/expanded_disturbance.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/campaign_compensation.h"

namespace smartmill::studies {
namespace {

using Rows = std::vector<std::vector<double>>;
using kalman::BurzoniData;
using kalman::BurzoniTable;
using kalman::TuningMap;

FrequencyResponse tapped(const BurzoniData& data, std::size_t axis) {
  return kalman::averagedFrf(data.taps[axis].hammer, data.taps[axis].response, BURZONI_RATE)
      .band(20.0, BURZONI_BAND);
}

/// Figures 21, 31, 32: measured and fitted FRF, with confidence bands of the measured one.
Drawn plant(const std::string& folder, unsigned seed) {
  const BurzoniData& data = burzoniData(seed);
  Drawn drawn;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const FrequencyResponse frf = tapped(data, axis);
    Rows rows;
    double squares = 0.0, whole = 0.0;
    int inside_2 = 0, inside_3 = 0;
    for (std::size_t i = 0; i < frf.size(); ++i) {
      const std::complex<double> fit = data.sensor[axis].response(frf.frequency[i]);
      // The standard deviation is that of a complex value: half of the variance is along the magnitude (eq.
      // 6-3).
      const double size = std::abs(frf.value[i]), s = frf.std_dev[i] / std::sqrt(2.0);
      rows.push_back({frf.frequency[i], size, std::abs(fit), std::max(size - 3.0 * s, 1e-4), size + 3.0 * s,
                      std::max(size - 2.0 * s, 1e-4), size + 2.0 * s,
                      units::degFromRad(std::arg(frf.value[i])), units::degFromRad(std::arg(fit))});
      squares += std::norm(fit - frf.value[i]);
      whole += std::norm(frf.value[i]);
      inside_2 += std::abs(size - std::abs(fit)) < 2.0 * s;
      inside_3 += std::abs(size - std::abs(fit)) < 3.0 * s;
    }
    const std::string png = folder + "/burzoni_21_" + AXIS_NAMES[axis] + ".png";
    Gnuplot plot(png, 900, 800, 12);
    plot.block("frf", rows);
    plot
        << "set multiplot layout 2,1\nset grid\nset key above horizontal\nset lmargin 10\nset xlabel "
           "'frequency [Hz]'\nset xrange [0:2500]\nset logscale y\nset ylabel '|shown / applied|, "
        << AXIS_NAMES[axis]
        << "'\nplot $frf using 1:4:5 with filledcurves lc rgb '#f0d8c0' title '3 standard deviations', $frf "
           "using 1:6:7 with filledcurves lc rgb '#e0b890' title '2', $frf using 1:2 with lines lw 2 lc rgb "
           "'#808080' title 'nine taps', $frf using 1:3 with lines lw 1.5 lc rgb '#2060c0' title 'fitted'\n"
           "unset logscale y\nset ylabel 'phase [deg]'\nset yrange [-180:180]\nset ytics 90\nplot $frf using "
           "1:8 with lines lw 2 lc rgb '#808080' title 'nine taps', $frf using 1:9 with lines lw 1.5 lc rgb "
           "'#2060c0' title 'fitted'\nunset multiplot\n";
    plot.draw();
    drawn.pictures.push_back(png);
    const double off = std::sqrt(squares / whole);
    drawn.rows.push_back({Kind::restated,
                          formatted("fitted and measured FRF to 2.5 kHz, %s, figure 21", AXIS_NAMES[axis]),
                          "plotted, no number", formatted("%.1f %% rms", 100.0 * off),
                          off < 0.05 ? Verdict::agrees : Verdict::differs,
                          "three modes per axis, nine taps; the simulated sensor has modes, too"});
    const double n = static_cast<double>(frf.size());
    drawn.rows.push_back(
        {Kind::reproduced,
         formatted("lines within 2, 3 standard deviations of the fit, %s, figures 31, 32", AXIS_NAMES[axis]),
         "95.5, 99.7 %", formatted("%.1f, %.1f %%", 100.0 * inside_2 / n, 100.0 * inside_3 / n),
         inside_2 / n > 0.90 && inside_3 / n > 0.97 ? Verdict::agrees : Verdict::differs,
         "eq. 6-3 on nine taps: their standard deviation is uncertain by a quarter"});
  }
  return drawn;
}

/// [N] of the spectrum's lines, 1 / duration apart, of whole revolutions.
std::vector<double> amplitudes(const std::vector<double>& force, std::size_t from) {
  const std::vector<double> part(force.begin() + static_cast<std::ptrdiff_t>(from), force.end());
  std::vector<double> sizes;
  for (const auto& line : fourier(part))
    sizes.push_back(2.0 * std::abs(line) / static_cast<double>(part.size()));
  return sizes;
}

/// Figures 24 and 25.
Drawn spectra(const std::string& folder, unsigned seed) {
  constexpr std::size_t SPEED = 4, AXIS = 0;  // 9000 rpm along x
  const BurzoniData& data = burzoniData(seed);
  const BurzoniTable& table = burzoniTableOf(seed, 0);
  const double rpm = kalman::BURZONI_RPM[SPEED], tooth = data.flutes * rpm / 60.0,
               q = std::pow(2.0, table.rows[SPEED].exponent);
  const auto& cut = data.cuts[SPEED];
  const std::vector<double> force = kalman::expandedDisturbanceForce(cut.measured[AXIS], data.sensor[AXIS],
                                                                     BURZONI_RATE, tooth, q, table.r_cut);
  const double turn = 60.0 / rpm * BURZONI_RATE;
  const auto from = force.size() - static_cast<std::size_t>(std::lround(
                                       std::floor(0.75 * static_cast<double>(force.size()) / turn) * turn));
  const auto is = amplitudes(cut.truth[AXIS], from), told = amplitudes(force, from),
             measured_lines = amplitudes(cut.measured[AXIS], from);
  const double apart = BURZONI_RATE / static_cast<double>(force.size() - from);
  Rows rows, taps;
  for (std::size_t i = 1; static_cast<double>(i) * apart < BURZONI_BAND; ++i)
    rows.push_back({static_cast<double>(i) * apart, is[i], measured_lines[i], told[i]});
  const auto& hammer = data.taps[AXIS].hammer.front();
  const auto hit = fourier(hammer);
  const auto answer = fourier(kalman::expandedDisturbanceForce(
      data.taps[AXIS].response.front(), data.sensor[AXIS], BURZONI_RATE, tooth, q, table.r_tap));
  const auto raw = fourier(data.taps[AXIS].response.front());
  const std::vector<double> lines = fourierFrequencies(hammer.size(), BURZONI_RATE);
  for (std::size_t i = 1; i < lines.size() && lines[i] < BURZONI_BAND; ++i)
    taps.push_back({lines[i], 1e3 * std::abs(hit[i]) / BURZONI_RATE, 1e3 * std::abs(raw[i]) / BURZONI_RATE,
                    1e3 * std::abs(answer[i]) / BURZONI_RATE});
  const std::string png = folder + "/burzoni_24.png";
  Gnuplot plot(png, 900, 900, 12);
  plot.block("cut", rows);
  plot.block("taps", taps);
  const auto panel = [&](const char* block, const char* label, const char* reference) {
    plot << "set ylabel '" << label << "'\nplot $" << block
         << " using 1:3 with lines lw 1 lc rgb '#e0b890' title 'measured', $" << block
         << " using 1:2 with lines lw 4 lc rgb '#b0b0b0' title '" << reference << "', $" << block
         << " using 1:4 with lines lw 1.2 lc rgb '#2060c0' title 'compensated, Q of the taps'\n";
  };
  plot << "set multiplot layout 2,1\nset grid\nset key above horizontal\nset lmargin 10\nset xlabel "
          "'frequency "
          "[Hz]'\nset xrange [0:2500]\n";
  panel("cut", "slot at 9000 rpm, x [N]", "true force");
  panel("taps", "tap, x [mN s]", "hammer");
  plot << "unset multiplot\n";
  plot.draw();
  const kalman::CutScore score =
      kalman::scoreCut(force, cut.truth[AXIS], BURZONI_RATE, units::radPerSecFromRpm(rpm), data.flutes, from,
                       BURZONI_BAND, BURZONI_BAND);
  return {{png},
          {{Kind::another_machine, "RMSE of the harmonics at 9000 rpm, x, eq. 6-1, figure 24, table 8 [N]",
            formatted("%.3f", table.rows[SPEED].rmse_printed), formatted("%.3f", score.rmse), Verdict::shown,
            "his filter, Q of the taps; another machine, cut and force than his"}}};
}

std::vector<double> speedsOf(double step) {
  std::vector<double> speeds;
  for (double rpm = 1000.0; rpm <= 18000.0; rpm += step) speeds.push_back(units::radPerSecFromRpm(rpm));
  return speeds;
}

TuningMap mapOf(const BurzoniData& data, const ReferenceTaps& taps, std::size_t axis, double r, double step) {
  return kalman::expandedTapMap(taps, data.sensor[axis], BURZONI_RATE, r, speedsOf(step), data.flutes,
                                BURZONI_BAND);
}

/// Whether the least error is inside the range of exponents, not at its end.
bool ends(int exponent) {
  return exponent < kalman::MOST_EXPONENT;
}

/// Exponent of the best Q minus that of another map, at the speeds where the other map has an optimum.
std::vector<double> shifts(const TuningMap& map, const TuningMap& other) {
  std::vector<double> all;
  for (const double speed : map.speed) {
    if (ends(other.best(speed))) all.push_back(map.best(speed) - other.best(speed));
  }
  return all;
}

/// Speed and exponent of the best Q of each cut.
std::vector<std::pair<double, int>> dots(const BurzoniTable& table) {
  std::vector<std::pair<double, int>> all;
  for (const kalman::BurzoniRow& row : table.rows)
    all.emplace_back(units::radPerSecFromRpm(row.rpm), row.cut_exponent);
  return all;
}

/// Figures 27 and 28.
/// @param step [rpm] between the speeds of the maps
Drawn maps(const std::string& folder, unsigned seed, double step) {
  const BurzoniData& data = burzoniData(seed);
  Drawn drawn;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const std::size_t first = HYPOTHESES * axis;
    const BurzoniTable &low = burzoniTableOf(seed, first + 1), &mixed = burzoniTableOf(seed, first),
                       &high = burzoniTableOf(seed, first + 2);
    const TuningMap quiet = mapOf(data, data.taps[axis], axis, low.r_tap, step),
                    noisy = mapOf(data, data.taps[axis], axis, high.r_tap, step);
    const std::string png = folder + "/burzoni_27_" + AXIS_NAMES[axis] + ".png";
    kalman::drawMaps(
        {{formatted("%s: R of taps %.2g, of cuts %.2g N2", AXIS_NAMES[axis], mixed.r_tap, mixed.r_cut), quiet,
          dots(mixed)},
         {formatted("%s: R of taps %.2g, of cuts %.2g N2", AXIS_NAMES[axis], low.r_tap, low.r_cut), quiet,
          dots(low)},
         {formatted("%s: R of taps %.2g, of cuts %.2g N2", AXIS_NAMES[axis], high.r_tap, high.r_cut), noisy,
          dots(high)}},
        png);
    drawn.pictures.push_back(png);
    std::vector<double> found;
    for (const double speed : quiet.speed)
      if (ends(quiet.best(speed)) && ends(noisy.best(speed)))
        found.push_back(noisy.best(speed) - quiet.best(speed));
    const double shift = found.empty() ? std::nan("") : median(found),
                 expected = std::log2(high.r_tap / low.r_tap);
    drawn.rows.push_back(
        {Kind::restated,
         formatted("best Q of the taps as R rises from before taps to cutting air, %s, tables 8 and 10",
                   AXIS_NAMES[axis]),
         "x 64 (512 to 32,770)",
         formatted("x 2^%.1f, R x 2^%.1f (%zu of %zu speeds)", shift, expected, found.size(),
                   quiet.speed.size()),
         std::abs(shift - expected) <= 1.0 ? Verdict::agrees : Verdict::differs,
         "a filter depends only on Q over R: Q increases with R (his R by 67); at the other speeds the "
         "optimum is above 2^30: these taps have 300 N and a noise of 0.4 N"});
  }
  return drawn;
}

/// Figure 29: map of the taps, only at the speeds of the cuts.
Drawn overSpeed(const std::string& folder, unsigned seed) {
  const BurzoniTable& table = burzoniTableOf(seed, 0);
  std::vector<double> speeds;
  Rows rows;
  const BurzoniData& data = burzoniData(seed);
  for (const double rpm : kalman::BURZONI_RPM) speeds.push_back(units::radPerSecFromRpm(rpm));
  const TuningMap map = kalman::expandedTapMap(data.taps[0], data.sensor[0], BURZONI_RATE, table.r_tap,
                                               speeds, data.flutes, BURZONI_BAND);
  Rows best;
  int least = 99, most = 0;
  for (std::size_t k = 0; k < speeds.size(); ++k) {
    for (std::size_t i = 0; i < map.rmse.size(); ++i)
      rows.push_back({static_cast<double>(k),
                      static_cast<double>(kalman::LEAST_EXPONENT) + static_cast<double>(i), map.rmse[i][k]});
    const int told = map.best(speeds[k]);
    least = std::min(least, told);
    most = std::max(most, told);
    best.push_back({static_cast<double>(k), static_cast<double>(told),
                    static_cast<double>(table.rows[k].cut_exponent), std::log2(table.rows[k].q_printed)});
  }
  const std::string png = folder + "/burzoni_29.png";
  Gnuplot plot(png, 900, 550, 12);
  plot.block("map", rows);
  plot.block("best", best);
  plot << "set key above horizontal\nset logscale cb\nset cblabel 'RMSE of the taps [N s]'\nset xlabel "
          "'spindle "
          "speed [rpm]'\nset ylabel 'n of q = 2^n N2/s'\nset xrange [-0.5:6.5]\nset yrange [0.5:30.5]\nset "
          "xtics "
          "(";
  for (std::size_t k = 0; k < speeds.size(); ++k)
    plot << (k ? ", " : "") << "'" << kalman::BURZONI_RPM[k] << "' " << k;
  plot
      << ")\nplot $map using 1:2:3 with image notitle, $best using 1:2 with linespoints pt 7 lw 2 lc 'white' "
         "title 'best of the taps', $best using 1:3 with points pt 7 ps 1.5 lc 'red' title 'best of the "
         "cut', "
         "$best using 1:4 with points pt 6 ps 1.5 lw 2 lc 'black' title 'printed, taps (table 8)'\n";
  plot.draw();
  const auto [low, high] =
      std::minmax_element(table.rows.begin(), table.rows.end(),
                          [](const auto& a, const auto& b) { return a.q_printed < b.q_printed; });
  return {
      {png},
      {{Kind::another_machine, "best Q of the taps over seven speeds, x, figure 29, table 8",
        formatted("2^%.0f .. 2^%.0f", std::log2(low->q_printed), std::log2(high->q_printed)),
        ends(most) ? formatted("2^%d .. 2^%d", least, most) : formatted("2^%d and more", least),
        Verdict::shown,
        "the noise of the taps bounds Q (kalman_burzoni): little noise and a sensor accurate to half a per "
        "cent "
        "permit a large Q, at the higher speeds above 2^30; table 8 shows his Q with noisy taps"}}};
}

/// Tables 6 and 7.
Drawn variedPlants(const std::string& folder, unsigned seed) {
  const BurzoniData& data = burzoniData(seed);
  Drawn drawn;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const BurzoniTable& table = burzoniTableOf(seed, HYPOTHESES * axis);
    const FrequencyResponse frf =
        kalman::averagedFrf(data.taps[axis].hammer, data.taps[axis].response, BURZONI_RATE);
    std::vector<kalman::NamedMap> all;
    std::vector<double> smaller, larger, cuts;
    TuningMap as_measured;
    for (const double k : {0.0, -3.0, -2.0, 2.0, 3.0}) {
      const TuningMap map =
          mapOf(data, k == 0.0 ? data.taps[axis] : kalman::plantAt(data.taps[axis], frf, BURZONI_RATE, k),
                axis, table.r_tap, 1000.0);
      all.push_back({k == 0.0 ? formatted("%s: as measured", AXIS_NAMES[axis])
                              : formatted("%s: %+.0f standard deviations", AXIS_NAMES[axis], k),
                     map, dots(table)});
      if (k == 0.0) as_measured = map;
      for (const double by : shifts(map, as_measured)) (k < 0.0 ? smaller : larger).push_back(by);
    }
    const std::string png = folder + formatted("/burzoni_table_%zu.png", 6 + axis);
    kalman::drawMaps(all, png);
    drawn.pictures.push_back(png);
    for (const kalman::BurzoniRow& row : table.rows)
      if (ends(row.exponent) && ends(row.cut_exponent)) cuts.push_back(row.cut_exponent - row.exponent);
    const auto told = [](const std::vector<double>& by) {
      const auto [least, most] = std::minmax_element(by.begin(), by.end());
      return by.empty() ? std::string("no best Q below 2^30")
                        : formatted("x 2^%+.0f .. 2^%+.0f", *least, *most);
    };
    const bool right = !larger.empty() && median(smaller) >= 0.0 && median(larger) >= 0.0;
    drawn.rows.push_back(
        {Kind::reproduced,
         formatted("best Q of a plant 2, 3 deviations off, %s, table %zu", AXIS_NAMES[axis], 6 + axis),
         "a slight shift to higher Q",
         formatted("%s with a smaller gain than the model, %s with a larger one", told(smaller).c_str(),
                   told(larger).c_str()),
         right ? Verdict::agrees : Verdict::differs,
         "at the speeds where the taps have a best Q; a sensor with a smaller gain requires a larger filter "
         "gain, and vice versa"});
    const double most = larger.empty() ? 0.0 : std::max(median(smaller), median(larger));
    drawn.rows.push_back(
        {Kind::reproduced,
         formatted("best Q of the cuts over that of the taps, %s, tables 6 and 7", AXIS_NAMES[axis]),
         "higher, by more than the plants explain", told(cuts),
         !cuts.empty() && median(cuts) > most ? Verdict::agrees : Verdict::differs,
         "with R of the air cut in the cut and of rest in the taps, as his; at the other speeds the taps "
         "have no best Q"});
  }
  return drawn;
}

}  // namespace

std::vector<Figure> sensorPlantFigures() {
  return {{"burzoni_21", "Burzoni figures 21, 31 and 32: the sensor's FRF, its fit, its confidence", plant},
          {"burzoni_24", "Burzoni figures 24 and 25: spectra of a cut and of a tap", spectra},
          {"burzoni_27", "Burzoni figures 27 and 28: best Q over speed, by R",
           [](const std::string& folder, unsigned seed) { return maps(folder, seed, 500.0); },
           [](const std::string& folder, unsigned seed) { return maps(folder, seed, 4000.0); }},
          {"burzoni_29", "Burzoni figure 29: best Q at the speeds of the cuts", overSpeed},
          {"burzoni_table_6", "Burzoni tables 6 and 7: plants at the edge of the confidence", variedPlants}};
}

}  // namespace smartmill::studies
