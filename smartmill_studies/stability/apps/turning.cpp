// rosrun smartmill_studies stability_turning --growth 1 -o FOLDER

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>

#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "stability/turning_loop.h"

namespace {

using namespace smartmill;
using stability::KimRun;
using stability::SecondOrder;
using stability::TurningLoop;
using stability::TurningTrace;

std::vector<std::vector<double>> history(const TurningTrace& trace) {
  std::vector<std::vector<double>> rows;
  for (std::size_t i = 0; i < trace.time.size(); i += 10)
    rows.push_back({trace.time[i], 1e6 * trace.motion[i]});
  return rows;
}

/// Figures 4 and 5: motion of the tool against the work.
void drawHistory(const std::string& png, const std::string& title, const TurningTrace& ours,
                 const TurningTrace* kim) {
  Gnuplot plot(png, 1100, 500, 12);
  plot.block("ours", history(ours));
  if (kim) plot.block("kim", history(*kim));
  plot << "set grid\nset title " << Gnuplot::quoted(title)
       << "\nset xlabel 'Time [s]'\nset ylabel 'Tool against work [um]'\nset xrange [0:6.144]\nplot ";
  if (kim) plot << "$kim using 1:2 with lines lc 'gray' title 'his own update, line by line', ";
  plot << "$ours using 1:2 with lines lc rgb '#0060ad' title '" << (kim ? "this package" : "no control")
       << "'\n";
  plot.draw();
}

/// Figures 6 and 7: what was learnt by the end of a segment.
void drawTransfer(const std::string& png, const std::string& title, const KimRun& kim, std::size_t segment,
                  const SecondOrder& learnt, const SecondOrder& truth, const SecondOrder& printed) {
  std::vector<std::vector<double>> lines, curves;
  const auto& s = kim.segments.at(segment);
  for (std::size_t i = 0; i < s.frequency.size(); ++i)
    lines.push_back({s.frequency[i], std::abs(s.ratio[i]), std::abs(s.used[i])});
  for (double w = 200.0; w <= 500.0; w += 0.5)
    curves.push_back(
        {w, std::abs(learnt.response(w)), std::abs(truth.response(w)), std::abs(printed.response(w))});
  Gnuplot plot(png, 1100, 600, 12);
  plot.block("lines", lines);
  plot.block("curves", curves);
  plot << "set grid\nset logscale y\nset title " << Gnuplot::quoted(title)
       << "\nset xlabel 'Frequency [rad/s]'\nset ylabel 'Deflection over chip [1]'\nset xrange [200:500]\n"
          "plot $lines using 1:2 with linespoints pt 6 lc 'gray' title 'ratio of spectra', "
          "$lines using 1:3 with linespoints pt 7 lc rgb '#dd8800' title 'eq. 16, line by line', "
          "$curves using 1:4 with lines dt 3 lw 2 lc rgb '#aa0000' title 'as Kim prints it', "
          "$curves using 1:3 with lines lw 3 lc 'black' title 'true', "
          "$curves using 1:2 with lines dt 2 lw 2 lc rgb '#0060ad' title 'this package'\n";
  plot.draw();
}

void row(const char* name, const SecondOrder& one, const char* printed) {
  std::printf("  %-34s %7.1f rad/s %7.4f %7.4f   %s\n", name, one.frequency, one.damping_ratio, one.gain,
              printed);
}

void run(double growth, const std::string& folder) {
  std::filesystem::create_directories(folder);
  TurningLoop loop = stability::kimLoop(growth);
  TurningLoop free = loop;
  free.controlled = false;
  TurningLoop ideal = loop;
  ideal.lathe.servo_frequency = 0.45 * loop.lathe.rate;  // his servo has no dynamics
  std::fprintf(stderr, "lathe without control, with control, with Kim's update\n");
  const TurningTrace alone = runTurning(free), ours = runTurning(loop);
  const KimRun kim = runKim(ideal);
  const SecondOrder truth{0.1, 350.0, 0.02};
  const char* printed[] = {"327 rad/s 0.05, K/Km 0.15 (printed)",
                           "332 rad/s 0.11, by eq. 16 335 rad/s 0.06 (printed)", "346 rad/s 0.07 (printed)"};
  std::printf("true machine 350 rad/s, 0.02, K/Km 0.1; free vibration grows by e^%.1f a segment of 2.048 s\n",
              growth);
  for (std::size_t s = 0; s < 3 && s < ours.learnt.size(); ++s) {
    std::printf("segment %zu\n", s + 1);
    row("this package", ours.learnt[s].machine, "");
    row("Kim's update, read off", kim.segments[s].read, printed[s]);
  }
  std::printf(
      "vibration, rms of the last half second [um]: free %.4g, this package %.4g, Kim's update %.4g; "
      "commands late %llu\n",
      1e6 * alone.vibration(5.644, 6.144), 1e6 * ours.vibration(5.644, 6.144),
      1e6 * kim.trace.vibration(5.644, 6.144), static_cast<unsigned long long>(ours.late));
  drawHistory(folder + "/kim_figure_4.png", "Kim figure 4: uncontrolled", alone, nullptr);
  drawHistory(folder + "/kim_figure_5.png", "Kim figure 5: controlled", ours, &kim.trace);
  drawTransfer(folder + "/kim_figure_6.png", "Kim figure 6: second period, 2.049 to 4.096 s", kim, 1,
               ours.learnt.at(1).machine, truth, {0.15, 335.0, 0.06});
  drawTransfer(folder + "/kim_figure_7.png", "Kim figure 7: third period, 4.097 to 6.144 s", kim, 2,
               ours.learnt.at(2).machine, truth, {0.15, 346.0, 0.07});
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Figures 4 to 7 of Kim's paper on the simulated lathe: his own update beside this package's control.");
  double growth = 1.0;
  std::string folder;
  line.option("--growth", growth, "logarithm of the free vibration's growth over a segment of 2.048 s")
      .showDefault()
      .within(0.3, 4.0);
  line.option("-o", folder, "folder of the pictures").required();
  return runProgram(line, argc, argv, [&] { run(growth, folder); });
}
