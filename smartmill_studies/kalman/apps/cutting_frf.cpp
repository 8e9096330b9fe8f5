// rosrun smartmill_studies kalman_cutting_frf: identification of speed-dependent modes from cuts.

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "kalman/turning_tool.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"

namespace {

using namespace smartmill;

struct Request {
  int repeats = 20;
  double gyroscopic = 0.0;
  std::string out, campaign;
  std::uint64_t seed = 17;
};

/// One mode of one axis in repeated runs at one speed.
struct Seen {
  double rpm = 0.0;
  Mode truth;
  std::vector<Mode> found;
};

/// Error over standard deviation: RMS and share within 1.96.
std::array<double, 2> coverage(const Seen& seen, double Mode::*value, double Mode::*std_dev) {
  double squares = 0.0, inside = 0.0;
  for (const Mode& mode : seen.found) {
    const double z = (mode.*value - seen.truth.*value) / (mode.*std_dev);
    squares += z * z;
    inside += std::abs(z) < 1.96 ? 1.0 : 0.0;
  }
  const auto n = static_cast<double>(seen.found.size());
  return {std::sqrt(squares / n), inside / n};
}

double meanOf(const Seen& seen, double Mode::*value) {
  double sum = 0.0;
  for (const Mode& mode : seen.found) sum += mode.*value / static_cast<double>(seen.found.size());
  return sum;
}

void print(char axis, const Seen& seen, int repeats) {
  std::printf("%c %6.0f rpm, true %8.2f Hz %.5f, found in %zu of %d", axis, seen.rpm, seen.truth.frequency,
              seen.truth.damping_ratio, seen.found.size(), repeats);
  if (!seen.found.empty()) {
    const auto f = coverage(seen, &Mode::frequency, &Mode::frequency_std);
    const auto d = coverage(seen, &Mode::damping_ratio, &Mode::damping_ratio_std);
    const auto g = coverage(seen, &Mode::gain, &Mode::gain_std);
    std::printf(
        ": mean %8.2f +- %.2f Hz, %.5f +- %.5f; error over deviation %.2f %.2f %.2f (%.0f %.0f %.0f %%)",
        meanOf(seen, &Mode::frequency), meanOf(seen, &Mode::frequency_std),
        meanOf(seen, &Mode::damping_ratio), meanOf(seen, &Mode::damping_ratio_std), f[0], d[0], g[0],
        100.0 * f[1], 100.0 * d[1], 100.0 * g[1]);
  }
  std::printf("\n");
}

void draw(const kalman::TurningToolCase& c, const std::array<std::vector<Seen>, 2>& axes,
          const std::string& file) {
  Gnuplot plot(file, 1100, 900);
  plot << "set multiplot layout 2, 1\nset grid\nset xlabel 'speed of the spindle [rpm]'\n";
  for (const bool frequency : {true, false}) {
    std::string curves;
    plot << "set ylabel '" << (frequency ? "frequency [Hz]" : "damping ratio [1]") << "'\n";
    for (std::size_t a = 0; a < 2; ++a) {
      const ModalModel& standing = a == 0 ? c.model.tool_tip.x : c.model.tool_tip.y;
      std::vector<std::vector<double>> truth, found;
      for (double rpm = 0.0; rpm <= 20000.0; rpm += 200.0) {
        std::vector<double> row{rpm};
        for (const Mode& m : c.spindle.at(units::radPerSecFromRpm(rpm), standing).modes)
          row.push_back(frequency ? m.frequency : m.damping_ratio);
        truth.push_back(row);
      }
      for (const Seen& seen : axes[a]) {
        if (seen.found.empty()) continue;
        const Mode& m = seen.found.front();
        found.push_back({seen.rpm, frequency ? m.frequency : m.damping_ratio,
                         1.96 * (frequency ? m.frequency_std : m.damping_ratio_std)});
      }
      const std::string name = std::string(frequency ? "f" : "d") + (a == 0 ? "x" : "y");
      plot.block(name + "t", truth);
      plot.block(name, found);
      const std::string colour = a == 0 ? "'#1f77b4'" : "'#d62728'";
      const double rest = frequency ? standing.modes[0].frequency : standing.modes[0].damping_ratio;
      for (std::size_t column = 2; column <= truth.back().size(); ++column)
        curves += "$" + name + "t using 1:" + std::to_string(column) + " with lines lw 2 lc rgb " + colour +
                  (column == 2 ? std::string(" title 'true, ") + (a == 0 ? "x', " : "y', ") : " notitle, ");
      curves += std::to_string(rest) + " with lines dt 2 lc rgb " + colour + " title 'tap at rest', $" +
                name + " with yerrorbars pt 7 ps 1.2 lw 2 lc rgb " + colour + " title 'from cuts, 95 %'" +
                (a == 0 ? ", " : "");
    }
    plot << "plot [0:20000] " << curves << "\n";
  }
  plot.draw();
}

/// The modes of an axis for each speed in turn, lowest first.
std::array<std::vector<Seen>, 2> truths(const kalman::TurningToolCase& c) {
  std::array<std::vector<Seen>, 2> axes;
  for (std::size_t a = 0; a < 2; ++a)
    for (const double speed : c.speeds)
      for (const Mode& mode : c.spindle.at(speed, a == 0 ? c.model.tool_tip.x : c.model.tool_tip.y).modes)
        axes[a].push_back({units::rpmFromRadPerSec(speed), mode, {}});
  return axes;
}

/// Adds the modes found by a run for an axis, if their number is correct.
void collect(const kalman::TurningToolCase& c, std::size_t axis, const std::vector<kalman::SpeedFrf>& found,
             std::vector<Seen>& seen) {
  const std::size_t modes = seen.size() / c.speeds.size();
  for (std::size_t g = 0; g < found.size(); ++g) {
    if (!found[g].fit || found[g].fit->model.modes.size() != modes) {
      std::fprintf(stderr, "%c %.0f rpm: %s\n", axis == 0 ? 'x' : 'y', seen[g * modes].rpm,
                   found[g].fit ? "wrong number of modes" : found[g].reason.c_str());
      continue;
    }
    for (std::size_t m = 0; m < modes; ++m) seen[g * modes + m].found.push_back(found[g].fit->model.modes[m]);
  }
}

void run(const Request& request) {
  kalman::TurningToolCase c = kalman::turningToolCase();
  c.spindle.gyroscopic = request.gyroscopic;
  if (!request.campaign.empty()) c.write(request.campaign, request.seed);
  std::array<std::vector<Seen>, 2> axes = truths(c);
  for (int repeat = 0; repeat < request.repeats; ++repeat) {
    std::fprintf(stderr, "run %d of %d\n", repeat + 1, request.repeats);
    const auto found = c.identify(request.seed + static_cast<std::uint64_t>(repeat));
    for (std::size_t a = 0; a < 2; ++a) collect(c, a, found[a], axes[a]);
  }
  for (std::size_t a = 0; a < 2; ++a)
    for (const Seen& seen : axes[a]) print(a == 0 ? 'x' : 'y', seen, request.repeats);
  if (request.out.empty()) return;
  std::filesystem::create_directories(request.out);
  draw(c, axes, request.out + "/cutting_frf.png");
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Identification of a simulated tool with speed-dependent modes: modes from cuts around each of six "
      "speeds next to the true ones, with the coverage of their standard deviations over repeated runs."};
  line.option("--repeats", request.repeats, "runs at each speed, each with its own noise").showDefault();
  line.option("--gyroscopic", request.gyroscopic,
              "half the distance of backward and forward whirl at 18,000 rpm, as share of the frequency")
      .showDefault();
  line.option("--seed", request.seed, "").showDefault();
  line.option("-o,--out", request.out, "folder for cutting_frf.png");
  line.option("--campaign", request.campaign,
              "folder for the cuts as a campaign, for smartmill_kalman cutting_frf");
  return runProgram(line, argc, argv, [&] { run(request); });
}
