#include "report_pictures.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "smartmill_core/cutting/lobe_flanks.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/units.h"

namespace smartmill::report {
namespace {

constexpr double DRAWN_REVOLUTIONS = 3.0;

/// A table for gnuplot; infinite values are not drawn.
class Table {
 public:
  explicit Table(const std::filesystem::path& file) : file_(file), out_(file) { out_.precision(9); }
  void row(const std::vector<double>& values) {
    for (const double value : values) {
      if (std::isfinite(value)) {
        out_ << value << ' ';
      } else {
        out_ << "nan ";
      }
    }
    out_ << '\n';
  }
  void gap() { out_ << "\n\n"; }
  /// Name in gnuplot's quotes.
  std::string close() {
    out_.close();
    if (!out_) throw Error(file_.string() + ": cannot be written");
    return Gnuplot::quoted(file_.string());
  }

 private:
  std::filesystem::path file_;
  std::ofstream out_;
};

void draw(const std::filesystem::path& png, int width, int height, const std::string& commands) {
  Gnuplot plot(png.string(), width, height);
  plot << "set termoption enhanced\nset grid\n" << commands << "\n";
  plot.draw();
}

std::string number(double value) {
  return formatted("%.9g", value);
}

/// -270..90 deg, so that the phase of a receptance, 0 to -180 deg, does not wrap.
double degrees(const std::complex<double>& value) {
  const double phase = units::degFromRad(std::arg(value));
  return phase > 90.0 ? phase - 360.0 : phase;
}

bool drawFrf(const SessionRecording& recording, const std::filesystem::path& folder) {
  std::vector<const MeasuredFrf*> measured;
  for (const char* axis : {"x", "y"}) {
    if (const MeasuredFrf* frf = recording.frf(false, POINT_TOOL_TIP, axis)) measured.push_back(frf);
  }
  if (measured.empty()) return false;
  double highest = 1000.0;
  for (const MeasuredModes& modes : recording.modes) {
    if (modes.point != POINT_TOOL_TIP) continue;
    for (const Mode& mode : modes.model.modes) highest = std::max(highest, 1.6 * mode.frequency);
  }
  std::vector<std::string> files, true_files;
  for (const MeasuredFrf* frf : measured) {
    Table table(folder / "data" / ("frf_" + frf->direction + ".dat"));
    for (std::size_t i = 0; i < frf->frf.size(); ++i) {
      const std::complex<double> value = frf->frf.value[i];
      table.row({frf->frf.frequency[i], std::abs(value) / units::UM, degrees(value),
                 i < frf->frf.coherence.size() ? frf->frf.coherence[i] : NOT_A_NUMBER});
    }
    files.push_back(table.close());
    const MeasuredFrf* truth = recording.frf(true, POINT_TOOL_TIP, frf->direction);
    if (!truth) continue;
    Table true_table(folder / "data" / ("frf_true_" + frf->direction + ".dat"));
    for (std::size_t i = 0; i < truth->frf.size(); ++i) {
      true_table.row(
          {truth->frf.frequency[i], std::abs(truth->frf.value[i]) / units::UM, degrees(truth->frf.value[i])});
    }
    true_files.push_back(true_table.close());
  }
  const bool with_truth = true_files.size() == files.size();
  std::string commands = "set multiplot layout 3," + std::to_string(files.size()) +
                         "\nset xrange [100:" + number(highest) + "]\n";
  struct Panel {
    const char* label;
    const char* settings;
    int column;
    bool with_true_frf;
  };
  for (const Panel& panel :
       {Panel{"magnitude [um/N]", "set logscale y\nset format y '10^{%T}'\nset autoscale y", 2, true},
        Panel{"phase [deg]", "unset logscale y\nset format y '%g'\nset yrange [-270:90]\nset ytics 90", 3,
              true},
        Panel{"coherence [1]", "unset logscale y\nset yrange [0:1.05]\nset ytics 0.2", 4, false}}) {
    commands += std::string(panel.settings) + "\nset ylabel '" + panel.label + "'\n";
    for (std::size_t i = 0; i < files.size(); ++i) {
      commands +=
          panel.column == 2 ? "set title 'tool tip, " + measured[i]->direction + "'\n" : "set title\n";
      commands += panel.column == 4 ? "set xlabel 'frequency [Hz]'\n" : "set xlabel\n";
      commands += "plot ";
      if (with_truth && panel.with_true_frf) {
        commands += true_files[i] + " using 1:" + std::to_string(panel.column) +
                    " with lines lw 3 lc rgb '#bbbbbb' title 'true', ";
      }
      commands += files[i] + " using 1:" + std::to_string(panel.column) +
                  " with lines lw 1 lc rgb '#0044aa' title 'measured'\n";
    }
  }
  draw(folder / "frf.png", 1400, 1000, commands + "unset multiplot\n");
  return true;
}

/// Margin to both flanks of the lobe at the recommended depth.
std::string marginOf(const StabilityChart& chart, const std::filesystem::path& folder) {
  const StabilityPoint& best = chart.recommended.front();
  const auto [below, above] = lobeFlanks(chart.limit, best.spindle_speed, best.axial_depth);
  Table margin(folder / "data" / "chart_margin.dat");
  for (const double speed : {best.spindle_speed - below, best.spindle_speed, best.spindle_speed + above})
    margin.row({units::rpmFromRadPerSec(speed), best.axial_depth / units::MM});
  return margin.close() + " using 1:2 with linespoints pt 3 lw 2.5 lc rgb '#008800' title 'recommended: " +
         formatted("-%.1f %% and +%.1f %% to the flanks'", 100.0 * below / best.spindle_speed,
                   100.0 * above / best.spindle_speed);
}

bool drawChart(const SessionRecording& recording, const Report& report,
               const std::optional<StabilityChart>& true_chart, const std::filesystem::path& folder) {
  if (!recording.chart || recording.chart->limit.spindle_speed.empty()) return false;
  const StabilityChart& chart = *recording.chart;
  double highest = 4.0 * chart.absolute_depth_limit;
  Table table(folder / "data" / "chart.dat");
  const auto at = [](const std::vector<double>& values, std::size_t i) {
    return i < values.size() ? values[i] / units::MM : NOT_A_NUMBER;
  };
  for (std::size_t i = 0; i < chart.limit.spindle_speed.size(); ++i) {
    table.row({units::rpmFromRadPerSec(chart.limit.spindle_speed[i]), at(chart.limit.depth, i),
               at(chart.torque_depth_limit, i), at(chart.power_depth_limit, i)});
  }
  const std::string file = table.close();
  std::string plot = "plot ";
  if (true_chart) {
    Table true_table(folder / "data" / "chart_true.dat");
    for (std::size_t i = 0; i < true_chart->limit.spindle_speed.size(); ++i) {
      true_table.row(
          {units::rpmFromRadPerSec(true_chart->limit.spindle_speed[i]), at(true_chart->limit.depth, i)});
    }
    plot += true_table.close() +
            " using 1:2 with lines lw 4 lc rgb '#bbbbbb' title 'limit of the true machine', ";
  }
  plot += file + " using 1:2 with lines lw 1.5 lc rgb '#0044aa' title 'measured limit'";
  const auto anyFinite = [](const std::vector<double>& values) {
    return std::any_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
  };
  if (anyFinite(chart.torque_depth_limit)) {
    plot += ", " + file + " using 1:3 with lines dt 2 lw 1.5 lc rgb '#cc7700' title 'spindle torque'";
  }
  if (anyFinite(chart.power_depth_limit)) {
    plot += ", " + file + " using 1:4 with lines dt 3 lw 1.5 lc rgb '#aa00aa' title 'spindle power'";
  }
  if (!chart.recommended.empty()) {
    plot += ", " + marginOf(chart, folder);
    highest = std::max(highest, 1.4 * chart.recommended.front().axial_depth);
  }
  for (const CutCheck& cut : report.cuts) {
    Table point(folder / "data" / (cut.name + ".dat"));
    point.row({units::rpmFromRadPerSec(cut.spindle_speed), cut.axial_depth / units::MM});
    highest = std::max(highest, 1.4 * cut.axial_depth);
    const bool chatter = cut.verdict.kind == session::CutVerdict::Kind::chatter;
    const bool stable = cut.verdict.kind == session::CutVerdict::Kind::stable;
    plot += ", " + point.close() + " using 1:2 with points ps 2.5 lw 3 pt " +
            (stable    ? "7 lc rgb '#008800' title 'cut: stable'"
             : chatter ? "2 lc rgb '#cc0000' title 'cut: chatter'"
                       : "4 lc rgb '#555555' title 'cut: no verdict'");
  }
  draw(folder / "chart.png", 1300, 700,
       "set key outside below\nset xlabel 'spindle speed [rpm]'\nset ylabel 'axial depth [mm]'\nset yrange "
       "[0:" +
           number(highest / units::MM) + "]\n" + plot);
  return true;
}

bool drawForce(const RecordedCut& cut, const std::filesystem::path& folder) {
  const auto [from, end] = evaluatedSamples(cut, SETTLE_REVOLUTIONS);
  const double rate = cut.compensated.sampleRate();
  const auto drawn =
      static_cast<std::uint64_t>(DRAWN_REVOLUTIONS * units::TWO_PI / cut.condition.spindle_speed * rate);
  if (from + drawn > end || drawn == 0) return false;
  const std::uint64_t to = from + drawn;
  std::vector<std::vector<double>> columns;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const ForceTrack* track : {&cut.raw, &cut.compensated, &cut.truth}) {
      columns.push_back(track->empty() ? std::vector<double>(drawn, NOT_A_NUMBER)
                                       : track->axis(axis, from, to));
    }
  }
  Table table(folder / "data" / "force.dat");
  for (std::uint64_t i = 0; i < drawn; ++i) {
    std::vector<double> row{static_cast<double>(i) / rate * 1e3};
    for (const auto& column : columns) row.push_back(column[i]);
    table.row(row);
  }
  const std::string file = table.close();
  std::string commands = "set multiplot layout 3,1 title 'three revolutions at " +
                         number(std::round(units::rpmFromRadPerSec(cut.condition.spindle_speed))) + " rpm'\n";
  for (int axis = 0; axis < 3; ++axis) {
    const auto column = [&](int which) { return " using 1:" + std::to_string(2 + 3 * axis + which); };
    commands +=
        std::string("set ylabel 'F_") + "xyz"[axis] + " [N]'\n" +
        (axis == 2 ? "set xlabel 'time [ms]'\n" : "") + "plot " + file + column(0) +
        " with lines lc rgb '#dd8800' title 'raw'" +
        (cut.truth.empty() ? ""
                           : ", " + file + column(2) + " with lines lw 4 lc rgb '#bbbbbb' title 'true'") +
        ", " + file + column(1) + " with lines lw 1.5 lc rgb '#0044aa' title 'compensated'\n";
  }
  draw(folder / "force.png", 1300, 1000, commands + "unset multiplot\n");
  return true;
}

}  // namespace

std::vector<std::string> drawPictures(const SessionRecording& recording, const Report& report,
                                      const std::optional<StabilityChart>& true_chart,
                                      const std::string& folder) {
  std::filesystem::create_directories(std::filesystem::path(folder) / "data");
  std::vector<std::string> drawn;
  if (drawFrf(recording, folder)) drawn.push_back("frf.png");
  if (drawChart(recording, report, true_chart, folder)) drawn.push_back("chart.png");
  const RecordedCut* cut = recording.cut("resonance");
  if (cut && drawForce(*cut, folder)) drawn.push_back("force.png");
  return drawn;
}

}  // namespace smartmill::report
