// rosrun smartmill_studies loadmeter_rounding --cases 40 --seed 1 -o FOLDER

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <string>
#include <vector>

#include "loadmeter/machine_cases.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/statistics.h"
#include "study_case.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

constexpr double MILLIVOLT = 1e-3;

constexpr double STEPS[] = {0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0};  // [mV]

struct Step {
  std::vector<double> thesis, ours;  // [%]
  int inside = 0;

  void add(double thesis_error, double error, bool within) {
    thesis.push_back(thesis_error);
    ours.push_back(error);
    inside += within;
  }
};

struct Request {
  int cases = 40;
  unsigned seed = 1;
  double noise_mv = 0.2;
  std::string folder;
  StudyCase one;
};

/// One random machine at one resolution. @param millivolt resolution
void tryMachine(const Request& request, double millivolt, int number, Step& step) {
  Faults faults;
  faults.resolution = millivolt * MILLIVOLT;
  faults.noise = request.noise_mv * MILLIVOLT;
  faults.depth_error = 0.0;  // only the load meter has errors
  const CaseErrors e = judge(drawCase(request.seed + static_cast<unsigned>(number), faults), faults);
  step.add(100.0 * std::abs(e.thesis_ktc), 100.0 * std::abs(e.ktc), std::abs(e.z_ktc) < 1.96);
}

std::string nameOf(double millivolt) {
  return formatted("step_%.1f_mv", millivolt);
}

void runOne(const Request& request) {
  nlohmann::json line{{"case", request.one.number}};
  for (const double millivolt : STEPS) {
    Step step;
    tryMachine(request, millivolt, request.one.number, step);
    line[nameOf(millivolt)] = {{"thesis_percent", step.thesis.front()},
                               {"percent", step.ours.front()},
                               {"inside", step.inside == 1}};
  }
  request.one.print(line);
}

void report(const Request& request, const std::vector<Step>& steps) {
  std::vector<std::vector<double>> rows;
  std::printf("noise %.1f mV before rounding; error of Ktc [%%]\n%10s %21s %21s %8s\n", request.noise_mv,
              "step [mV]", "thesis median, 95 %", "package median, 95 %", "inside");
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const Step& s = steps[k];
    rows.push_back(
        {STEPS[k], median(s.thesis), percentile(s.thesis, 0.95), median(s.ours), percentile(s.ours, 0.95)});
    std::printf("%10.1f %10.2f %10.2f %10.2f %10.2f %7.1f%%\n", STEPS[k], rows.back()[1], rows.back()[2],
                rows.back()[3], rows.back()[4], 100.0 * s.inside / static_cast<double>(s.ours.size()));
  }
  std::filesystem::create_directories(request.folder);
  Gnuplot plot(request.folder + "/load_meter_rounding.png", 1000, 600, 12);
  plot.block("steps", rows);
  plot << "set grid\nset logscale xy\nset key top left\nset xlabel 'Rounding of the load meter [mV]'\n"
          "set ylabel 'Error of Ktc [%]'\nset arrow from 0.3, graph 0 to 0.3, graph 1 nohead dt 2 lc 'gray'\n"
          "plot $steps using 1:2 with linespoints lc 'gray' lw 2 title 'thesis procedure, median', "
          "$steps using 1:3 with linespoints lc 'gray' dt 2 title '95 %', "
          "$steps using 1:4 with linespoints lc rgb '#0060ad' lw 2 title 'this package, median', "
          "$steps using 1:5 with linespoints lc rgb '#0060ad' dt 2 title '95 %'\n";
  plot.draw();
}

void run(const Request& request) {
  request.one.check(request.cases);
  if (request.one.one()) return runOne(request);
  std::vector<Step> steps(std::size(STEPS));
  if (request.one.scores()) {
    const auto lines = readJsonLines(request.one.lines);
    if (lines.empty()) throw Error(request.one.lines + ": no case");
    for (std::size_t k = 0; k < steps.size(); ++k)
      for (const nlohmann::json& line : lines) {
        const nlohmann::json& at = line.at(nameOf(STEPS[k]));
        steps[k].add(at.at("thesis_percent"), at.at("percent"), at.at("inside"));
      }
    return report(request, steps);
  }
  for (std::size_t k = 0; k < steps.size(); ++k)
    for (int i = 0; i < request.cases; ++i) {
      if (isatty(STDERR_FILENO))
        std::fprintf(stderr, "\r%.1f mV: case %d of %d ", STEPS[k], i + 1, request.cases);
      tryMachine(request, STEPS[k], i, steps[k]);
    }
  if (isatty(STDERR_FILENO)) std::fprintf(stderr, "\n");
  report(request, steps);
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Error of Ktc over the resolution of the load meter (0.3 mV as in the thesis, and coarser).");
  Request request;
  request.one.addTo(line, "--cases", request.cases, "random machines for each resolution");
  request.one.addScore(line);
  line.option("--seed", request.seed, "of the first").showDefault();
  line.option("--noise-mv", request.noise_mv, "RMS noise before rounding [mV]")
      .showDefault()
      .within(0.0, 1000.0);
  line.option("-o", request.folder, "folder of the picture").required();
  return runProgram(line, argc, argv, [&] { run(request); });
}
