#include "stability/kim_figures.h"

#include <cmath>
#include <filesystem>
#include <utility>

#include "smartmill_core/io/gnuplot.h"

namespace smartmill::stability {
namespace {

std::vector<std::vector<double>> history(const TurningTrace& trace) {
  std::vector<std::vector<double>> rows;
  for (std::size_t i = 0; i < trace.time.size(); i += 10)
    rows.push_back({trace.time[i], 1e6 * trace.motion[i]});
  return rows;
}

/// Figures 4 and 5: motion of the tool relative to the workpiece, one panel per run.
void drawHistory(const std::string& png,
                 const std::vector<std::pair<std::string, const TurningTrace*>>& runs) {
  Gnuplot plot(png, 900, 80 + 370 * static_cast<int>(runs.size()), 12);
  for (std::size_t k = 0; k < runs.size(); ++k)
    plot.block("run" + std::to_string(k), history(*runs[k].second));
  plot << "set multiplot layout " << runs.size()
       << ",1\nset grid\nset lmargin 10\nunset key\nset xlabel 'time [s]'\nset ylabel 'tool against work "
          "[um]'\nset "
          "xrange [0:6.144]\n";
  for (std::size_t k = 0; k < runs.size(); ++k)
    plot << "set title " << Gnuplot::quoted(runs[k].first) << "\nplot $run" << k
         << " using 1:2 with lines lc rgb '#2060c0'\n";
  plot << "unset multiplot\n";
  plot.draw();
}

/// Figures 6 and 7: estimates at the end of a segment.
void drawTransfer(const std::string& png, const std::string& title, const KimFigures& f, std::size_t segment,
                  const SecondOrder& printed) {
  std::vector<std::vector<double>> lines, curves;
  const KimSegment &s = f.printed.segments.at(segment), &corrected = f.corrected.segments.at(segment);
  const SecondOrder &learnt = f.ours.learnt.at(segment).machine, &truth = f.truth;
  for (std::size_t i = 0; i < s.frequency.size(); ++i)
    lines.push_back({s.frequency[i], std::abs(s.ratio[i]), std::abs(s.used[i]), std::abs(corrected.used[i])});
  for (double w = 200.0; w <= 500.0; w += 0.5)
    curves.push_back(
        {w, std::abs(learnt.response(w)), std::abs(truth.response(w)), std::abs(printed.response(w))});
  Gnuplot plot(png, 900, 600, 12);
  plot.block("lines", lines);
  plot.block("curves", curves);
  plot << "set grid\nset key above horizontal samplen 2\nset logscale y\nset title " << Gnuplot::quoted(title)
       << "\nset xlabel 'frequency [rad/s]'\nset ylabel 'deflection over chip [1]'\nset xrange [200:500]\n"
          "plot $lines using 1:2 with linespoints pt 6 lc 'gray' title 'ratio of spectra', "
          "$lines using 1:3 with linespoints pt 7 lc rgb '#dd8800' title 'eq. 16 as printed', "
          "$lines using 1:4 with linespoints pt 5 lc rgb '#209060' title 'eq. 16 corrected', "
          "$curves using 1:4 with lines dt 3 lw 2 lc rgb '#aa0000' title 'his values', "
          "$curves using 1:3 with lines lw 3 lc 'black' title 'true', "
          "$curves using 1:2 with lines dt 2 lw 2 lc rgb '#0060ad' title 'this package'\n";
  plot.draw();
}

}  // namespace

KimFigures kimFigures(double growth, const std::string& folder) {
  std::filesystem::create_directories(folder);
  TurningLoop loop = kimLoop(growth);
  TurningLoop free = loop;
  free.controlled = false;
  TurningLoop ideal = loop;
  ideal.lathe.servo_frequency = 0.45 * loop.lathe.rate;  // his servo has no dynamics
  KimFigures f;
  f.free = runTurning(free);
  f.ours = runTurning(loop);
  f.printed = runKim(ideal, KimUpdate::printed);
  f.corrected = runKim(ideal, KimUpdate::corrected);
  for (const char* number : {"4", "5", "6", "7"})
    f.pictures.push_back(folder + "/kim_figure_" + number + ".png");
  drawHistory(f.pictures[0], {{"Kim figure 4: uncontrolled", &f.free}});
  drawHistory(f.pictures[1], {{"Kim figure 5: controlled, this package", &f.ours},
                              {"eq. 16 as printed", &f.printed.trace},
                              {"eq. 16 corrected", &f.corrected.trace}});
  drawTransfer(f.pictures[2], "Kim figure 6: second period, 2.049 to 4.096 s", f, 1, {0.15, 335.0, 0.06});
  drawTransfer(f.pictures[3], "Kim figure 7: third period, 4.097 to 6.144 s", f, 2, {0.15, 346.0, 0.07});
  return f;
}

double lastVibration(const TurningTrace& trace) {
  return trace.vibration(5.644, 6.144);
}

}  // namespace smartmill::stability
