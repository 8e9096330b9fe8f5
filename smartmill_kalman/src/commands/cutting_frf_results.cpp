#include "commands/cutting_frf_results.h"

#include <cstdio>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {

void printRest(const CuttingFrfAxis& axis, bool receptance) {
  for (const Mode& m : axis.rest.modes) {
    const double gain = receptance ? 1.0 / m.gain / units::N_PER_UM : m.gain;
    std::printf("%s, tap at rest: %9.2f +- %.2f Hz, damping %.5f +- %.5f, %s %.4g%s\n", AXIS_NAMES[axis.axis],
                m.frequency, m.frequency_std, m.damping_ratio, m.damping_ratio_std,
                receptance ? "stiffness" : "gain", gain, receptance ? " N/um" : "");
  }
}

std::string suffixOf(const CuttingFrfAxis& axis, const SpeedFrf& frf) {
  return formatted("_%s_%.0f", AXIS_NAMES[axis.axis], units::rpmFromRadPerSec(frf.speed));
}

void printFrf(const CuttingFrfAxis& axis, const SpeedFrf& frf, bool receptance, CsvWriter& table) {
  const double rpm = units::rpmFromRadPerSec(frf.speed);
  std::printf("%s, %.0f rpm (%.0f..%.0f), %zu lines", AXIS_NAMES[axis.axis], rpm,
              units::rpmFromRadPerSec(frf.lowest), units::rpmFromRadPerSec(frf.highest), frf.frf.size());
  if (!frf.fit) {
    std::printf(": no modes: %s\n", frf.reason.c_str());
    return;
  }
  std::printf("\n");
  for (const Mode& m : frf.fit->model.modes) {
    const double gain = receptance ? 1.0 / m.gain / units::N_PER_UM : m.gain;
    const double gain_std = receptance ? gain * m.gain_std / m.gain : m.gain_std;
    std::printf("  %9.2f +- %.2f Hz, damping %.5f +- %.5f, %s %.4g +- %.2g%s\n", m.frequency, m.frequency_std,
                m.damping_ratio, m.damping_ratio_std, receptance ? "stiffness" : "gain", gain, gain_std,
                receptance ? " N/um" : "");
    table.row(AXIS_NAMES[axis.axis], rpm, m.frequency, m.frequency_std, m.damping_ratio, m.damping_ratio_std,
              gain, gain_std);
  }
}

void drawAxis(const CuttingFrfAxis& axis, const CuttingFrfRequest& request) {
  Gnuplot plot(request.out + "/frf_" + AXIS_NAMES[axis.axis] + ".png", 1100, 700);
  const bool tool = request.of == "tool";
  const double scale = tool ? 1.0 / units::UM : 1.0;
  plot << "set logscale y\nset grid\nset xlabel 'frequency [Hz]'\nset ylabel '"
       << (tool ? "magnitude [um/N]" : "magnitude [1]") << "'\nset title 'In the cut, "
       << AXIS_NAMES[axis.axis] << ", by speed of the spindle; black: at rest'\nset key right top\n";
  std::string curves;
  std::vector<std::vector<double>> rest;
  for (double f = request.options.low; f <= request.options.high; f += 5.0)
    rest.push_back({f, scale * std::abs(axis.rest.response(f))});
  const bool known = !axis.rest.modes.empty();
  if (known) plot.block("rest", rest);
  if (known) curves = "$rest with lines lw 2 lc rgb 'black' title 'at rest'";
  for (std::size_t i = 0; i < axis.found.size(); ++i) {
    const SpeedFrf& found = axis.found[i];
    std::vector<std::vector<double>> lines, fit;
    for (std::size_t k = 0; k < found.frf.size(); ++k)
      lines.push_back(
          {found.frf.frequency[k], scale * std::abs(found.frf.value[k]), scale * found.frf.std_dev[k]});
    for (const std::vector<double>& row : rest)
      if (found.fit) fit.push_back({row[0], scale * std::abs(found.fit->model.response(row[0]))});
    const std::string name = "s" + std::to_string(i), colour = " lc " + std::to_string(i + 1);
    plot.block(name, lines);
    curves += (curves.empty() ? "$" : ", $") + name + " with yerrorbars pt 7 ps 0.6" + colour + " title '" +
              formatted("%.0f rpm'", units::rpmFromRadPerSec(found.speed));
    if (fit.empty()) continue;
    plot.block(name + "f", fit);
    curves += ", $" + name + "f with lines" + colour + " notitle";
  }
  plot << "plot " << curves << "\n";
  plot.draw();
}

}  // namespace smartmill::kalman
