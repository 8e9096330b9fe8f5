// Dunwoody chapter 5 on a dynamometer that is not of the filter's class.

#include <array>
#include <cmath>
#include <complex>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "gallery/dynamometer_rig.h"
#include "gallery/gallery.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/campaign_compensation.h"
#include "smartmill_kalman/filter/harmonic_filter.h"

namespace smartmill::studies {
namespace {

using kalman::HarmonicFilter;
using kalman::HarmonicFilterParameters;
using Rows = std::vector<std::vector<double>>;

constexpr double RATE = DynamometerRig::RATE;

/// True, measured and compensated force of a steady slot over the spindle angle [rad].
struct Cut {
  std::vector<double> angle, truth, measured, compensated;
};

/// The last eight revolutions of a cut, after the filter has settled.
Cut cutAt(double rpm, std::size_t axis, const ModalModel& sensor, unsigned seed) {
  const auto revolution = static_cast<std::size_t>(60.0 / rpm * RATE);
  const std::size_t settled = static_cast<std::size_t>(0.5 * RATE) + 8 * revolution;
  const DynamometerRig::Cut record = DynamometerRig::slot(rpm, settled + 8 * revolution, seed);
  HarmonicFilter filter(sensor, units::radPerSecFromRpm(rpm), RATE, {});
  Cut cut;
  for (std::size_t i = 0; i < record.angle.size(); ++i) {
    const double compensated = filter.step(record.measured[axis][i]);
    if (i < settled) continue;
    cut.angle.push_back(record.angle[i]);
    cut.truth.push_back(record.applied[axis][i]);
    cut.measured.push_back(record.measured[axis][i]);
    cut.compensated.push_back(compensated);
  }
  return cut;
}

/// Sensor of an axis from nine taps, identified by the product as shipped.
struct Identified {
  FrequencyResponse measured;
  ModalModel model;
};

/// All figures show the same sensor.
const Identified& identified(std::size_t axis, unsigned seed) {
  static std::map<std::pair<std::size_t, unsigned>, Identified> sensors;
  const auto [at, is_new] = sensors.try_emplace({axis, seed});
  if (is_new) {
    const DynamometerRig::Taps taps = DynamometerRig::taps(axis, 9, seed);
    at->second = {kalman::averagedFrf(taps.hammer, taps.response, RATE),
                  kalman::identifySensor(taps.hammer, taps.response, RATE, {}).model};
  }
  return at->second;
}

double rangeOf(const std::vector<double>& force) {
  return percentile(force, 0.9) - percentile(force, 0.1);
}

/// Figures 5.2 and 5.3 with 5.4 and 5.5.
Drawn transferFunctions(const std::string& folder, unsigned seed) {
  Drawn drawn;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto& [frf, sensor] = identified(axis, seed);
    // Linear and time-invariant: an impulse response gives the complete FRF.
    HarmonicFilterParameters parameters;
    parameters.memory_revolutions = parameters.settling_revolutions;
    HarmonicFilter filter(sensor, units::TWO_PI * 930.0 / 4.0, RATE, parameters);
    std::vector<double> answer(1 << 16);
    for (std::size_t i = 0; i < answer.size(); ++i) answer[i] = filter.step(i == 0 ? 1.0 : 0.0);
    const auto spectrum = fourier(answer);
    const std::vector<double> lines = fourierFrequencies(answer.size(), RATE);
    const std::vector<std::complex<double>> response = DynamometerRig::response(axis, lines);
    Rows rows, gains;
    for (std::size_t i = 0; i < frf.size(); ++i) {
      if (frf.frequency[i] < 50.0 || frf.frequency[i] > 5000.0) continue;
      const std::complex<double> fit = sensor.response(frf.frequency[i]);
      rows.push_back({frf.frequency[i], std::abs(frf.value[i]), std::abs(fit)});
    }
    double at_tooth = 0.0;
    for (std::size_t i = 0; i < lines.size() && lines[i] < 5000.0; ++i) {
      if (lines[i] < 50.0) continue;
      gains.push_back({lines[i], std::abs(spectrum[i]), std::abs(spectrum[i] * response[i])});
      if (std::abs(lines[i] - 930.0) < 0.5 * lines[1]) at_tooth = gains.back()[2];
    }
    const std::string png = folder + "/dunwoody_5_2_" + AXIS_NAMES[axis] + ".png";
    Gnuplot plot(png, 900, 800, 12);
    plot.block("frf", rows);
    plot.block("gains", gains);
    plot << "set multiplot layout 2,1\nset grid\nset key above horizontal samplen 2\nset lmargin 10\nset "
            "logscale y\nset xlabel 'frequency [Hz]'\n"
            "set ylabel '|measured / applied|'\nplot $frf using 1:2 with lines lw 3 lc rgb '#b0b0b0' title "
            "'nine "
            "taps, "
         << AXIS_NAMES[axis]
         << "', $frf using 1:3 with lines lw 1.5 lc rgb '#2060c0' title 'model'\nset ylabel '|gain|'\nset "
            "yrange "
            "[0.01:20]\nplot $gains using 1:2 with lines lw 1 lc rgb '#2060c0' title 'filter at 930 Hz tooth "
            "passing', $gains using 1:3 with lines lw 1 lc rgb '#c02020' title 'sensor and filter'\nunset "
            "multiplot\n";
    plot.draw();
    drawn.pictures.push_back(png);
    drawn.rows.push_back(
        {Kind::reproduced,
         formatted("sensor and filter together at 930 Hz, axis %s, figures 5.4, 5.5", AXIS_NAMES[axis]),
         "1 (drawn)", formatted("%.3f", at_tooth),
         std::abs(at_tooth - 1.0) < 0.05 ? Verdict::agrees : Verdict::differs,
         "a dynamometer of 51 modes, tapped 5 mm below the cut, against the filter's four"});
  }
  return drawn;
}

double waveformError(const Cut& cut, const std::vector<double>& estimated) {
  double error = 0.0, norm = 0.0;
  for (std::size_t i = 0; i < estimated.size(); ++i) {
    error += std::pow(estimated[i] - cut.truth[i], 2);
    norm += std::pow(cut.truth[i], 2);
  }
  return std::sqrt(error / norm);
}

/// Figures 5.6 and 5.7.
Drawn atResonance(const std::string& folder, unsigned seed) {
  Drawn drawn;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const ModalModel& sensor = identified(axis, seed).model;
    const Cut fast = cutAt(13950.0, axis, sensor, seed), slow = cutAt(750.0, axis, sensor, seed);
    const auto rowsOf = [](const Cut& cut) {
      Rows rows;
      for (std::size_t i = 0; i < cut.angle.size(); ++i)
        rows.push_back({units::degFromRad(cut.angle[i]), cut.measured[i], cut.compensated[i]});
      return rows;
    };
    const std::string png = folder + "/dunwoody_5_6_" + AXIS_NAMES[axis] + ".png";
    Gnuplot plot(png, 900, 500, 12);
    plot.block("fast", rowsOf(fast));
    plot.block("slow", rowsOf(slow));
    plot << "set grid\nset key above horizontal samplen 2\nset xlabel 'spindle angle [deg]'\nset xrange "
            "[0:360]\nset xtics 45\nset ylabel 'force "
         << AXIS_NAMES[axis] << " [N]'\nplot ";
    const auto points = [&](const char* block, int column, const char* colour, const char* title) {
      plot << "$" << block << " using 1:" << column << " with points pt 7 ps 0.4 lc rgb '" << colour
           << "' notitle, NaN with points pt 7 ps 1.2 lc rgb '" << colour << "' title '" << title << "'";
    };
    points("slow", 2, "#909090", "750 rpm, measured");
    plot << ", ";
    points("fast", 2, "#c08040", "13,950 rpm, measured");
    plot << ", ";
    points("fast", 3, "#2060c0", "13,950 rpm, compensated");
    plot << "\n";
    plot.draw();
    drawn.pictures.push_back(png);
    const double amplitude = rangeOf(fast.compensated) / rangeOf(slow.measured);
    drawn.rows.push_back(
        {Kind::reproduced,
         formatted("range at 13,950 rpm over that of the test at 750 rpm, axis %s, figures "
                   "5.6, 5.7",
                   AXIS_NAMES[axis]),
         "\"correct overall amplitude\"",
         formatted("%.3f (measured %.2f)", amplitude, rangeOf(fast.measured) / rangeOf(slow.measured)),
         std::abs(amplitude - 1.0) < 0.05 ? Verdict::agrees : Verdict::differs,
         "as in section 5.3, the reference is the measured force at 750 rpm"});
    drawn.rows.push_back(
        {Kind::another_machine,
         formatted("waveform at 13,950 rpm, axis %s, figures 5.6, 5.7", AXIS_NAMES[axis]), "\"less well\"",
         formatted("rms error %.1f %% (measured %.0f %%)", 100.0 * waveformError(fast, fast.compensated),
                   100.0 * waveformError(fast, fast.measured)),
         Verdict::shown,
         "against the applied force; the filter contains harmonics to 5 kHz and four modes, "
         "the sensor of the thesis could not be modelled above its first one"});
  }
  return drawn;
}

/// Figures 5.8 and 5.9: six speeds from 50 to 1200 Hz of tooth passing.
Drawn ranges(const std::string& folder, unsigned seed) {
  Drawn drawn;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const ModalModel& sensor = identified(axis, seed).model;
    Rows rows;
    double worst = 0.0, worst_raw = 0.0;
    for (const double rpm : {750.0, 4500.0, 9000.0, 13950.0, 16200.0, 18000.0}) {
      const Cut cut = cutAt(rpm, axis, sensor, seed);
      rows.push_back({rpm / 15.0, percentile(cut.measured, 0.1), percentile(cut.measured, 0.9),
                      percentile(cut.compensated, 0.1), percentile(cut.compensated, 0.9),
                      percentile(cut.truth, 0.1), percentile(cut.truth, 0.9)});
      worst = std::max(worst, std::abs(rangeOf(cut.compensated) / rangeOf(cut.truth) - 1.0));
      worst_raw = std::max(worst_raw, std::abs(rangeOf(cut.measured) / rangeOf(cut.truth) - 1.0));
    }
    const std::string png = folder + "/dunwoody_5_8_" + AXIS_NAMES[axis] + ".png";
    Gnuplot plot(png, 900, 500, 12);
    plot.block("rows", rows);
    plot << "set grid\nset key above horizontal samplen 2\nset xlabel 'tooth-passing frequency [Hz]'\nset "
            "ylabel 'force "
         << AXIS_NAMES[axis]
         << ", 10 to 90 % [N]'\nplot for [k=6:7] $rows using 1:k with lines lw 4 lc rgb '#b0b0b0' title (k "
            "== 6 ? "
            "'applied' : ''), for [k=2:3] $rows using 1:k with linespoints dt 2 pt 6 lc rgb '#c08040' title "
            "(k == "
            "2 ? "
            "'measured' : ''), for [k=4:5] $rows using 1:k with linespoints pt 7 lc rgb '#2060c0' title (k "
            "== 4 ? "
            "'compensated' : '')\n";
    plot.draw();
    drawn.pictures.push_back(png);
    drawn.rows.push_back(
        {Kind::reproduced,
         formatted("range of the force over 50 .. 1200 Hz, axis %s, figures 5.8, 5.9", AXIS_NAMES[axis]),
         "\"approximately constant\"",
         formatted("within %.1f %% (measured %.0f %%)", 100.0 * worst, 100.0 * worst_raw),
         worst < 0.05 ? Verdict::agrees : Verdict::differs,
         "six speeds of section 5.3; beyond 5 % where the tooth passes the resonance of the other axis, of "
         "which 1 % "
         "is in this channel and not in its sensor model"});
  }
  return drawn;
}

}  // namespace

std::vector<Figure> dynamometerFigures() {
  return {{"dunwoody_5_2", "Dunwoody figures 5.2 to 5.5: the dynamometer's FRF, its model, the filter",
           transferFunctions},
          {"dunwoody_5_6", "Dunwoody figures 5.6 and 5.7: a slot at 13,950 rpm, tooth passing on the mode",
           atResonance},
          {"dunwoody_5_8", "Dunwoody figures 5.8 and 5.9: range of the force over tooth-passing frequency",
           ranges}};
}

}  // namespace smartmill::studies
