// Burzoni chapter 3: constants of the sensor, their verification, unbalance.

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "gallery/spindle_sensor.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::studies {
namespace {

using Rows = std::vector<std::vector<double>>;
using kalman::BurzoniStatics;
using kalman::LengthDependence;
using kalman::SpindleSensorCalibration;

constexpr double LENGTH = 0.139;  // [m] 138 mm in section 6.3

const BurzoniStatics& statics(unsigned seed) {
  static std::map<unsigned, BurzoniStatics> gathered;
  auto at = gathered.find(seed);
  if (at == gathered.end())
    at = gathered.emplace(seed, kalman::gatherStatics(readMachineModel(GALLERY_MODEL), seed)).first;
  return at->second;
}

/// A constant of tables 2 and 3.
struct Constant {
  const char* name;
  double printed;  ///< table 2
  std::optional<LengthDependence> table_3, found;
};

std::vector<Constant> constantsOf(unsigned seed) {
  const SpindleSensorCalibration printed = SpindleSensorCalibration::table3();
  const SpindleSensorCalibration& found = statics(seed).calibration;
  return {{"cx", 18.0, printed.x, found.x},     {"cy", 18.2, printed.y, found.y},
          {"cz", 62.0, printed.z, found.z},     {"cYx", 26.5, printed.yx, found.yx},
          {"cYz", 139.3, printed.yz, found.yz}, {"cXz", -341.0, printed.xz, found.xz}};
}

/// Tables 2 and 3.
Drawn constants(const std::string& folder, unsigned seed) {
  const std::vector<Constant> all = constantsOf(seed);
  const std::string png = folder + "/burzoni_table_2.png";
  Gnuplot plot(png, 900, 1050, 12);
  for (std::size_t k = 0; k < all.size(); ++k) {
    Rows rows;
    for (double length = 0.100; length <= 0.1801; length += 0.002)
      rows.push_back(
          {1e3 * length, all[k].table_3->at(length), all[k].found ? all[k].found->at(length) : std::nan("")});
    plot.block(formatted("line%zu", k), rows);
    plot.block(formatted("points%zu", k), {{138.0, all[k].printed}});
  }
  plot << "set multiplot layout 3,2\nset grid\nset key above horizontal samplen 2\nset xtics 20\nset xlabel "
          "'tool and "
          "holder "
          "[mm]'\n";
  for (std::size_t k = 0; k < all.size(); ++k)
    plot << "set ylabel '" << all[k].name << " [1]'\nplot $line" << k
         << " using 1:2 with lines lw 4 lc rgb '#b0b0b0' title 'table 3', $points" << k
         << " using 1:2 with points pt 7 ps 1.5 lc rgb '#c02020' title 'table 2', $line" << k
         << " using 1:3 with lines lw 1.5 lc rgb '#2060c0' title 'calibrated here'\n";
  plot << "unset multiplot\n";
  plot.draw();
  Drawn drawn{{png}, {}};
  for (const Constant& c : all) {
    drawn.rows.push_back(compareNumber(
        Kind::restated, formatted("%s by the line of table 3 at 139 mm, tables 2 and 3", c.name), c.printed,
        c.table_3->at(LENGTH), 0.0, 0.02, "a disagreement here is one between the tables of the document"));
    if (!c.found) continue;
    drawn.rows.push_back(
        compareNumber(Kind::restated, formatted("%s calibrated with his weights, table 3 at 139 mm", c.name),
                      c.table_3->at(LENGTH), c.found->at(LENGTH), 0.0, 0.03,
                      "the simulated ring has his constants at 139 mm; over length it bends as a beam"));
  }
  return drawn;
}

/// Figures 13 and 15.
Drawn verification(const std::string& folder, unsigned seed) {
  const BurzoniStatics& s = statics(seed);
  const std::string png = folder + "/burzoni_13.png";
  Gnuplot plot(png, 900, 1100, 12);
  double worst = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Rows rows;
    for (std::size_t i = 0; i < s.hung[axis].size(); ++i) {
      rows.push_back({s.hung[axis][i], s.sensor_output[axis][i]});
      worst = std::max(worst, std::abs(s.sensor_output[axis][i] - s.hung[axis][i]) / 311.5);
    }
    plot.block(formatted("hung%zu", axis), rows);
  }
  for (std::size_t axis = 0; axis < 2; ++axis) {
    Rows rows;
    for (std::size_t i = 0; i < s.pressed[axis].size(); i += 16)
      rows.push_back({static_cast<double>(i) / BURZONI_RATE, s.on_table[axis][i] - s.on_table[axis][0],
                      s.pressed[axis][i] - s.pressed[axis][0]});
    plot.block(formatted("pressed%zu", axis), rows);
  }
  plot << "set multiplot layout 3,1\nset grid\nset key above horizontal\nset xlabel 'weight hung [N]'\nset "
          "ylabel "
          "'by the sensor [N]'\nplot x with lines lw 4 lc rgb '#b0b0b0' title 'equal'";
  for (std::size_t axis = 0; axis < 3; ++axis)
    plot << ", $hung" << axis << " using 1:2 with points pt " << 5 + 2 * axis << " ps 1.2 lc rgb '"
         << BURZONI_COLOURS[axis] << "' title '" << AXIS_NAMES[axis] << "'";
  plot << "\nset xlabel 'time under load [s]'\n";
  for (std::size_t axis = 0; axis < 2; ++axis)
    plot << "set ylabel 'tool on workpiece, " << AXIS_NAMES[axis] << " [N]'\nplot $pressed" << axis
         << " using 1:2 with lines lw 4 lc rgb '#b0b0b0' title 'table dynamometer', $pressed" << axis
         << " using 1:3 with lines lw 1 lc rgb '#2060c0' title 'sensor in the spindle'\n";
  plot << "unset multiplot\n";
  plot.draw();
  const double verified = *std::max_element(s.verified.begin(), s.verified.end());
  const auto row = [](Kind kind, const char* what, const char* printed, double ours, const char* why) {
    return Compared{kind,
                    what,
                    printed,
                    formatted("at most %.1f %%", 100.0 * ours),
                    ours < 0.05 ? Verdict::agrees : Verdict::differs,
                    why};
  };
  return {{png},
          {row(Kind::restated, "measured and applied weights, x, y, z, figure 13", "on the line", worst,
               "of the largest weight; drift removed between first and last measurement"),
           row(Kind::restated, "tool pressed against the workpiece, sensor and dynamometer, figure 15",
               "less than 5 %", verified,
               "at 120 mm, a length without weights; the simulated ring is linear in the length as its "
               "calibration is")}};
}

/// [N] amplitude of spindle order 1.
double onceARevolution(const std::vector<double>& force, double rpm) {
  std::complex<double> sum = 0.0;
  const double turns = std::floor(static_cast<double>(force.size()) / BURZONI_RATE * rpm / 60.0);
  const auto count = static_cast<std::size_t>(turns * 60.0 / rpm * BURZONI_RATE);
  for (std::size_t i = 0; i < count; ++i)
    sum += force[i] * std::polar(2.0 / static_cast<double>(count),
                                 -units::radPerSecFromRpm(rpm) * static_cast<double>(i) / BURZONI_RATE);
  return std::abs(sum);
}

/// Figure 16 and eq. 3-6.
Drawn unbalance(const std::string& folder, unsigned seed) {
  const BurzoniStatics& s = statics(seed);
  const std::string png = folder + "/burzoni_16.png";
  Gnuplot plot(png, 900, 800, 12);
  std::array<std::size_t, 2> shown{1, 3};
  plot << "set multiplot layout 2,1\nset grid\nset key above horizontal\nset xlabel 'revolutions'\n";
  for (const std::size_t k : shown) {
    Rows rows;
    const double turn = 60.0 / s.turning[k] * BURZONI_RATE;
    for (std::size_t i = 0; i < 6 * static_cast<std::size_t>(turn); ++i)
      rows.push_back({static_cast<double>(i) / turn, s.unbalanced[k][i] - mean(s.unbalanced[k]),
                      s.balanced[k][i] - mean(s.balanced[k])});
    plot.block(formatted("turn%zu", k), rows);
    plot << "set ylabel 'x cutting air at " << s.turning[k] << " rpm [N]'\nplot $turn" << k
         << " using 1:2 with lines lw 1.5 lc rgb '#c08040' title 'measured', $turn" << k
         << " using 1:3 with lines lw 1.5 lc rgb '#2060c0' title 'without unbalance'\n";
  }
  plot << "unset multiplot\n";
  plot.draw();
  std::vector<double> raw, left;
  for (std::size_t k = 0; k < s.turning.size(); ++k) {
    raw.push_back(onceARevolution(s.unbalanced[k], s.turning[k]));
    left.push_back(onceARevolution(s.balanced[k], s.turning[k]));
  }
  Drawn drawn{{png}, {}};
  const double deviation = standardDeviation(s.unbalanced[0]) / std::sqrt(0.5 * BURZONI_RATE);  // white noise
  drawn.rows.push_back(compareNumber(Kind::restated, "unbalance at 10,000 over that at 1000 rpm, eq. 3-6",
                                     100.0, raw[2] / raw[0], raw[2] / raw[0] * deviation / raw[0], 0.15,
                                     "order 1; at 1000 rpm a fifth of a newton in the noise"));
  drawn.rows.push_back({Kind::restated, "residual unbalance at 17,600 rpm, figure 16", "subtracted",
                        formatted("%.2f of %.2f N", left[3], raw[3]),
                        left[3] < 0.05 * raw[3] ? Verdict::agrees : Verdict::differs,
                        "identified in air cuts at other speeds, as mass times radius"});
  const double noise = standardDeviation(s.balanced[1]);
  drawn.rows.push_back({Kind::another_machine, "noise and unbalance at 4500 rpm, figure 16",
                        "\"noise is dominating\"",
                        formatted("noise %.2f N, unbalance %.2f N rms", noise, raw[1] / std::sqrt(2.0)),
                        Verdict::shown, "the simulated spindle's unbalance is 20 g mm"});
  return drawn;
}

}  // namespace

std::vector<Figure> sensorStaticFigures() {
  return {{"burzoni_table_2", "Burzoni tables 2 and 3: constants of the sensor over tool length", constants},
          {"burzoni_13", "Burzoni figures 13 and 15: weights, tool against the workpiece", verification},
          {"burzoni_16", "Burzoni figure 16: unbalance", unbalance}};
}

}  // namespace smartmill::studies
