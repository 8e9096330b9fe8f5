// rosrun smartmill_studies stability_turning --growth 1 -o FOLDER

#include <cstdio>
#include <string>
#include <utility>

#include "smartmill_core/program.h"
#include "stability/kim_figures.h"

namespace {

using namespace smartmill;
using stability::lastVibration;
using stability::SecondOrder;

void row(const char* name, const SecondOrder& one, const char* printed) {
  std::printf("  %-34s %7.1f rad/s %7.4f %7.4f   %s\n", name, one.frequency, one.damping_ratio, one.gain,
              printed);
}

void run(double growth, const std::string& folder) {
  std::fprintf(stderr, "lathe without control, with control, with Kim's update\n");
  const stability::KimFigures f = stability::kimFigures(growth, folder);
  const char* printed[] = {"327 rad/s 0.05, K/Km 0.15 (printed)",
                           "332 rad/s 0.11, by eq. 16 335 rad/s 0.06 (printed)", "346 rad/s 0.07 (printed)"};
  std::printf("true machine 350 rad/s, 0.02, K/Km 0.1; free vibration grows by e^%.1f a segment of 2.048 s\n",
              growth);
  for (std::size_t s = 0; s < 3 && s < f.ours.learnt.size(); ++s) {
    std::printf("segment %zu\n", s + 1);
    row("this package", f.ours.learnt[s].machine, "");
    row("eq. 16 as printed, peak and width", f.printed.segments[s].read, printed[s]);
    row("eq. 16 corrected, peak and width", f.corrected.segments[s].read, "");
  }
  std::printf(
      "vibration, rms of the half second before 2.048, 4.096, 6.144 s [um]; eq. 16 acts from 4.096 s\n");
  for (const auto& [name, trace] :
       {std::pair("free", &f.free), std::pair("this package", &f.ours),
        std::pair("eq. 16 as printed", &f.printed.trace), std::pair("eq. 16 corrected", &f.corrected.trace)})
    std::printf("  %-34s %10.4g %10.4g %10.4g\n", name, 1e6 * trace->vibration(1.548, 2.048),
                1e6 * trace->vibration(3.596, 4.096), 1e6 * lastVibration(*trace));
  std::printf("commands late %llu\n", static_cast<unsigned long long>(f.ours.late));
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Figures 4 to 7 of Kim's paper on the simulated lathe: his update, as printed and corrected, next to "
      "the "
      "control of this "
      "package.");
  double growth = 1.0;
  std::string folder;
  line.option("--growth", growth, "logarithm of the free vibration's growth over a segment of 2.048 s")
      .showDefault()
      .within(0.3, 4.0);
  line.option("-o", folder, "folder of the pictures").required();
  return runProgram(line, argc, argv, [&] { run(growth, folder); });
}
