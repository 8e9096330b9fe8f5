// Burzoni: force sensors in the spindle, Q and R from taps.

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "gallery/gallery.h"
#include "kalman/burzoni_tables.h"
#include "kalman/expanded_disturbance.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"

namespace smartmill::studies {
namespace {

using Rows = std::vector<std::vector<double>>;

/// Table 3 at the length of table 2.
Drawn constants(const std::string&, unsigned) {
  constexpr double LENGTH = 0.139;  // [m] 138 mm told in section 6.3
  const auto c = kalman::SpindleSensorCalibration::table3();
  const std::string why = "the line of table 3 at 139 mm";
  Drawn drawn;
  drawn.rows = {compareNumber("cx, tables 2 and 3", 18.0, c.x.at(LENGTH), 0.0, 0.02, why),
                compareNumber("cy, tables 2 and 3", 18.2, c.y.at(LENGTH), 0.0, 0.02, why),
                compareNumber("cz, tables 2 and 3", 62.0, c.z.at(LENGTH), 0.0, 0.02, why)};
  const auto cross = [&](const char* what, double seed, const std::optional<kalman::LengthLine>& line) {
    if (line)
      drawn.rows.push_back(compareNumber(what, seed, line->at(LENGTH), 0.0, 0.02,
                                         "the document's own tables do not agree where this does not"));
  };
  cross("cYx, tables 2 and 3", 26.5, c.yx);
  cross("cYz, tables 2 and 3", 139.3, c.yz);
  cross("cXz, tables 2 and 3", -341.0, c.xz);
  return drawn;
}

/// Tables 8 and 12 with figures 38, 43, 50, 51; the R of section 6.2 and the kurtosis of 5-17.
Drawn tuning(const std::string& folder, unsigned seed) {
  constexpr double BAND = 2500.0;  // [Hz]
  const kalman::BurzoniData data = kalman::gatherBurzoni(readMachineModel(GALLERY_MODEL), seed, BAND);
  Drawn drawn;
  const auto noise = [&](const char* what, double printed, const std::array<double, 2>& ours) {
    const double worst = std::max(std::abs(ours[0] / printed - 1.0), std::abs(ours[1] / printed - 1.0));
    drawn.rows.push_back({what, formatted("%g", printed), formatted("x %.2f, y %.2f", ours[0], ours[1]),
                          worst < 0.5 ? Verdict::agrees : Verdict::differs,
                          "the simulated sensor's noise is laid out after these two numbers"});
  };
  noise("R before taps, section 6.2 [N2]", 0.15, data.r_tap);
  noise("R cutting air, section 6.2 [N2]", 10.0, data.r_air);
  for (const std::size_t number : {0u, 4u}) {
    const kalman::BurzoniTable table = kalman::burzoniTable(data, number, BAND);
    Rows rows;
    double worst_printed = 0.0, worst = 0.0, worst_harmonics = 0.0;
    for (const kalman::BurzoniRow& r : table.rows) {
      rows.push_back({r.rpm, r.rmse_printed, r.rmse, r.harmonics});
      worst_printed = std::max(worst_printed, r.rmse_printed);
      worst = std::max(worst, r.rmse);
      worst_harmonics = std::max(worst_harmonics, r.harmonics);
    }
    const std::string png = folder + formatted("/burzoni_table_%zu.png", 8 + number);
    Gnuplot plot(png, 1000, 500);
    plot.block("rows", rows);
    plot
        << "set grid\nset key left top\nset logscale y\nset xlabel 'spindle speed [rpm]'\nset ylabel 'RMSE "
           "of the "
           "harmonics [N]'\nplot $rows using 1:2 with linespoints pt 7 lw 3 lc rgb '#b0b0b0' title 'printed, "
        << table.name
        << "', $rows using 1:3 with linespoints pt 7 lc rgb '#c08040' title 'his filter here, Q of the "
           "taps', $rows "
           "using 1:4 with linespoints pt 7 lc rgb '#2060c0' title 'this package'\n";
    plot.draw();
    drawn.pictures.push_back(png);
    drawn.rows.push_back({formatted("largest RMSE of seven speeds, %s [N]", table.name.c_str()),
                          formatted("%.2f", worst_printed),
                          formatted("%.2f (his filter here %.2f)", worst_harmonics, worst),
                          worst_harmonics < worst_printed ? Verdict::better : Verdict::differs,
                          "another machine, cut and force than his: the same filter errs less here, too"});
  }
  const auto kurtosis = [&](const char* what, const std::vector<double>& values) {
    drawn.rows.push_back(compareNumber(what, 3.0, kalman::kurtosis(values), 0.0, 0.1, "of a Gaussian"));
  };
  kurtosis("kurtosis at rest, eq. 5-17", data.still[0]);
  kurtosis("kurtosis cutting air, unbalance taken off, eq. 5-17", data.air[0]);
  return drawn;
}

}  // namespace

std::vector<Figure> spindleSensorFigures() {
  return {{"burzoni_table_2", "Burzoni tables 2 and 3: constants of the sensor over tool length", constants},
          {"burzoni_table_8", "Burzoni tables 8 and 12: Q and R from taps, seven speeds", tuning}};
}

}  // namespace smartmill::studies
