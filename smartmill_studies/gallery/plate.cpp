// Bachrathy and Stepan: inversion of a plate dynamometer with all its channels.

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "gallery/gallery.h"
#include "kalman/record_inversion.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman_testing/plate_sensor.h"
#include "smartmill_kalman_testing/reference_case.h"
#include "smartmill_loadmeter/identification/force_law.h"

namespace smartmill::studies {
namespace {

using Rows = std::vector<std::vector<double>>;
using Forces = std::array<std::vector<double>, 3>;

constexpr double RATE = 51200.0, BAND = 8000.0;                // [Hz]
constexpr std::array<double, 3> POINT{{0.026, -0.020, 0.03}};  // [m] not tapped

/// The sensor with three taps at each of 14 points, as in figure 1.
struct Plate {
  explicit Plate(unsigned seed)
      : random(seed),
        six(kalman::identifyTransferMatrix(kalman::tapPlate(sensor, RATE, 6, 3, random), RATE)) {}

  kalman::PlateSensor sensor;
  std::mt19937 random;
  kalman::TransferMatrix six;
};

Drawn matrix(const std::string& folder, unsigned seed) {
  const Plate plate(seed);
  const std::vector<std::string> channels{"Fx", "Fy", "Fz", "Mx", "My", "Mz"};
  const std::string png = folder + "/bachrathy_2.png";
  Gnuplot plot(png, 1100, 1000);
  double low_diagonal = 0.0, low_beside = 0.0;
  const Eigen::VectorXd scale = plate.six.scale();
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) {
      Rows rows;
      for (std::size_t i = 0; i < plate.six.frequency.size(); i += 4) {
        const double f = plate.six.frequency[i];
        if (f < 100.0 || f > BAND) continue;
        const double size = std::abs(plate.six.inverse[i](row, column)) * scale(column) / scale(row);
        rows.push_back({1e-3 * f, size});
        if (f > 500.0) continue;
        if (row == column)
          low_diagonal = std::max(low_diagonal, std::abs(size - 1.0));
        else
          low_beside = std::max(low_beside, size);
      }
      plot.block(formatted("h%d%d", row, column), rows);
    }
  }
  plot << "set multiplot layout 6,6 title 'gain [1] over frequency [kHz], moments over the mean distance of "
          "the "
          "taps' margins 0.06,0.99,0.05,0.93 spacing 0.012,0.035\nset logscale y\nset yrange [0.001:10]\nset "
          "xrange [0:8]\nset xtics 0,2,6\nset grid\nunset key\n";
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column)
      plot << "set format y '" << (column == 0 ? "10^%T" : "") << "'\nset format x '"
           << (row == 5 ? "%g" : "") << "'\nset title '" << channels[row] << " of " << channels[column]
           << "' offset 0,-0.8\nplot $h" << row << column << " using 1:2 with lines lc rgb '#2060c0'\n";
  }
  plot << "unset multiplot\n";
  plot.draw();
  return {
      {png},
      {{Kind::restated, "diagonal of H_FM below 500 Hz, figure 2", "\"almost unitary\"",
        formatted("1 within %.1f %%", 100.0 * low_diagonal),
        low_diagonal < 0.1 ? Verdict::agrees : Verdict::differs,
        "moments over the taps' mean distance; feet that measure are 1 at 0 Hz"},
       {Kind::restated, "off the diagonal below 500 Hz, figure 2", "\"almost zero\"",
        formatted("at most %.3f", low_beside), low_beside < 0.1 ? Verdict::agrees : Verdict::differs, ""}}};
}

double rmsShare(const std::vector<double>& estimated, const std::vector<double>& truth, std::size_t from,
                std::size_t to) {
  double error = 0.0, whole = 0.0;
  for (std::size_t i = from; i < to; ++i) {
    error += std::pow(estimated[i] - truth[i], 2);
    whole += std::pow(truth[i], 2);
  }
  return std::sqrt(error / whole);
}

Drawn bouncing(const std::string& folder, unsigned seed) {
  Plate plate(seed);
  const std::vector<double> contact = kalman::bouncingContact(RATE, 0.12, 0.01);
  const std::array<double, 3> direction{{0.30, 0.20, -0.9327}};
  Forces applied;
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const double f : contact) applied[axis].push_back(f * direction[axis]);
  const auto measured = plate.sensor.measure(applied, POINT, RATE, 6, plate.random);
  const auto estimated = kalman::invertRecord(plate.six, measured, RATE, BAND);
  constexpr std::size_t FROM = 256, TO = 2304;  // 5 .. 45 ms
  Rows rows;
  for (std::size_t i = FROM; i < TO; ++i)
    rows.push_back({1e3 * static_cast<double>(i) / RATE, -applied[2][i], -measured[2][i], -estimated[2][i]});
  const std::string png = folder + "/bachrathy_3.png";
  Gnuplot plot(png, 900, 800, 12);
  plot.block("rows", rows);
  plot << "set multiplot layout 2,1\nset grid\nset key above horizontal samplen 2\nset xlabel 'time "
          "[ms]'\nset ylabel '-Fz [N]'\nplot $rows "
          "using 1:2 with "
          "lines lw 3 lc rgb '#b0b0b0' title 'hammer', $rows using 1:3 with lines lc rgb '#c08040' title "
          "'measured'\n"
          "plot $rows using 1:2 with lines lw 3 lc rgb '#b0b0b0' title 'hammer', $rows using 1:4 with lines "
          "lc rgb "
          "'#2060c0' title 'six channels compensated'\nunset multiplot\n";
  plot.draw();
  const double raw = rmsShare(measured[2], applied[2], FROM, TO),
               left = rmsShare(estimated[2], applied[2], FROM, TO);
  return {{png},
          {{Kind::reproduced, "bouncing hammer, compensated force and hammer, figure 3",
            "\"almost the same signal\"",
            formatted("rms error %.1f %% (measured %.0f %%)", 100.0 * left, 100.0 * raw),
            left < 0.1 ? Verdict::agrees : Verdict::differs,
            "all frequencies; the band ends at 8 kHz, as theirs"}}};
}

/// Table 1.1 at one speed: force on the workpiece, measured and compensated force.
struct Milled {
  std::vector<double> angle;
  Forces applied;
  std::vector<std::vector<double>> measured, estimated;
};

const ToolGeometry& toolOfTable() {
  static const ToolGeometry tool{2, 12e-3, units::radFromDeg(30.0), {}};
  return tool;
}
Engagement cutOfTable(double feed) {
  return {0.5 * units::PI, units::PI, 2e-3, feed};
}
constexpr CuttingCoefficients MATERIAL{800e6, 250e6, 80e6, 20e3, 20e3, 5e3};  // not printed

Milled mill(Plate& plate, double rpm, double feed) {
  const MechanisticForce process(toolOfTable(), MATERIAL, cutOfTable(feed));
  const double speed = units::radPerSecFromRpm(rpm);
  Milled milled;
  for (std::size_t i = 0; i < 25600; ++i) {
    const double t = static_cast<double>(i) / RATE;
    const double share = std::clamp(std::min(t - 0.02, 0.46 - t) / 0.005, 0.0, 1.0);
    const CuttingForce f = process.at(speed * t);
    milled.angle.push_back(speed * t);
    milled.applied[0].push_back(-share * f.fx);
    milled.applied[1].push_back(-share * f.fy);
    milled.applied[2].push_back(-share * f.fz);
  }
  milled.measured = plate.sensor.measure(milled.applied, POINT, RATE, 6, plate.random);
  milled.estimated = kalman::invertRecord(plate.six, milled.measured, RATE, BAND);
  return milled;
}

Drawn twoSpeeds(const std::string& folder, unsigned seed) {
  Plate plate(seed);
  Drawn drawn;
  for (const double rpm : {5000.0, 20000.0}) {
    const Milled m = mill(plate, rpm, 2e-4);
    const std::string png = folder + formatted("/bachrathy_4_%.0f.png", rpm);
    Rows rows;
    const auto from = static_cast<std::size_t>(0.2 * RATE),
               to = from + static_cast<std::size_t>(120.0 / rpm * RATE);
    for (std::size_t i = from; i < to; ++i)
      rows.push_back({units::degFromRad(m.angle[i] - m.angle[from]), m.applied[0][i], m.measured[0][i],
                      m.estimated[0][i], m.applied[1][i], m.measured[1][i], m.estimated[1][i]});
    Gnuplot plot(png, 900, 800, 12);
    plot.block("rows", rows);
    plot << "set multiplot layout 2,1\nset grid\nset key above horizontal samplen 2\nset xlabel 'spindle "
            "angle [deg]'\n";
    for (int axis = 0; axis < 2; ++axis)
      plot << "set ylabel 'F"
           << "xy"[axis] << " [N]'\nplot $rows using 1:" << 2 + 3 * axis
           << " with lines lw 3 lc rgb '#b0b0b0' title 'applied', $rows using 1:" << 3 + 3 * axis
           << " with lines lc rgb '#c08040' title 'measured', $rows using 1:" << 4 + 3 * axis
           << " with lines lc rgb '#2060c0' title 'compensated'\n";
    plot << "unset multiplot\n";
    plot.draw();
    drawn.pictures.push_back(png);
    const auto error = [&](const std::vector<double>& x, std::size_t axis) {
      return 100.0 * bandError(x, m.applied[axis], RATE, 2560, 22528, BAND);
    };
    const double worst = std::max(error(m.estimated[0], 0), error(m.estimated[1], 1));
    drawn.rows.push_back(
        {Kind::another_machine, formatted("milling at %.0f rpm, worst of x and y to 8 kHz, figure 4", rpm),
         rpm < 1e4 ? "\"a better function\"" : "\"an acceptable result\"",
         formatted("error %.1f %% (measured %.0f %%)", worst,
                   std::max(error(m.measured[0], 0), error(m.measured[1], 1))),
         Verdict::shown, "no error is printed, only a visual judgement; the material is not stated"});
  }
  return drawn;
}

/// Of the four feeds.
constexpr const char* COLOURS[] = {"#2060c0", "#209060", "#c08040", "#c02020"};

/// Figure 5, top: compensated forces of one revolution over the spindle's angle, and the nominal chip.
std::string overAngle(const std::string& folder, unsigned seed) {
  Plate plate(seed);
  const std::string png = folder + "/bachrathy_5_xy.png";
  Gnuplot plot(png, 900, 1000, 12);
  const auto from = static_cast<std::size_t>(0.2 * RATE),
             to = from + static_cast<std::size_t>(60.0 / 20000.0 * RATE);
  std::vector<std::string> feeds;
  for (double feed = 1e-4; feed < 3.3e-4; feed += 7.5e-5) {
    const Milled m = mill(plate, 20000.0, feed);
    const Engagement cut = cutOfTable(feed);
    Rows rows;
    for (std::size_t i = from; i < to; ++i) {
      const double angle = std::fmod(m.angle[i], units::TWO_PI);
      double chip = 0.0;
      for (const double tooth : {angle, std::fmod(angle + units::PI, units::TWO_PI)})
        if (tooth > cut.entry && tooth < cut.exit) chip += feed * std::sin(tooth);
      rows.push_back({units::degFromRad(angle), m.estimated[0][i], m.estimated[1][i], 1e3 * chip});
    }
    std::sort(rows.begin(), rows.end());
    plot.block(formatted("feed%zu", feeds.size()), rows);
    feeds.push_back(formatted("%.3f mm per tooth", 1e3 * feed));
  }
  plot
      << "set multiplot layout 3,1\nset grid\nset lmargin 10\nset key above horizontal samplen 2\nset xlabel "
         "'angle of tooth 1 [deg]'\nset xrange [0:360]\nset xtics 45\n";
  const char* labels[] = {"Fx [N]", "Fy [N]", "chip at the tip [mm]"};
  for (int column = 0; column < 3; ++column) {
    plot << "set ylabel '" << labels[column] << "'\n";
    for (std::size_t k = 0; k < feeds.size(); ++k)
      plot << (k ? ", " : "plot ") << "$feed" << k << " using 1:" << column + 2 << " with lines lw 2 lc rgb '"
           << COLOURS[k % 4] << "' title '" << feeds[k] << "'";
    plot << "\n";
  }
  plot << "unset multiplot\n";
  plot.draw();
  return png;
}

Drawn forceOverChip(const std::string& folder, unsigned seed) {
  Plate plate(seed);
  const std::string png = folder + "/bachrathy_5.png";
  Gnuplot plot(png, 900, 800, 12);
  std::string radial, tangential;
  double square[2] = {}, whole[2] = {};  // radial, tangential
  int k = 0;
  for (double feed = 1e-4; feed < 3.3e-4; feed += 7.5e-5, ++k) {
    const Milled m = mill(plate, 20000.0, feed);
    std::vector<double> fx, fy, angle;
    for (std::size_t i = 10240; i < 20480; ++i) {  // 0.2 .. 0.4 s, well within the cut
      fx.push_back(-m.estimated[0][i]);
      fy.push_back(-m.estimated[1][i]);
      angle.push_back(m.angle[i]);
    }
    Rows rows;
    for (const loadmeter::ForcePoint& p :
         loadmeter::forcePoints(fx, fy, angle, toolOfTable(), cutOfTable(feed))) {
      rows.push_back({1e3 * p.chip, 1e-3 * p.radial, 1e-3 * p.tangential});
      const double truth[2] = {MATERIAL.krc * p.chip + MATERIAL.kre, MATERIAL.ktc * p.chip + MATERIAL.kte};
      for (int way = 0; way < 2; ++way) {
        square[way] += std::pow((way == 0 ? p.radial : p.tangential) - truth[way], 2);
        whole[way] += truth[way] * truth[way];
      }
    }
    plot.block(formatted("feed%d", k), rows);
    const auto curve = [&](int column) {
      return formatted(
          "%s $feed%d using 1:%d with points pt 7 ps 0.3 lc rgb '%s' notitle, NaN with points pt 7 ps 1.2 lc "
          "rgb '%s' title '%s'",
          k == 0 ? "plot" : ",", k, column, COLOURS[k % 4], COLOURS[k % 4],
          formatted("%.3f mm", 1e3 * feed).c_str());
    };
    radial += curve(2);
    tangential += curve(3);
  }
  const auto law = [](double edge, double slope, const char* name) {
    return formatted(", %g + %g * x with lines lw 2 lc rgb '#404040' title 'the material, %s'\n", 1e-3 * edge,
                     1e-6 * slope, name);
  };
  plot << "set multiplot layout 2,1\nset grid\nset key above horizontal samplen 2\nset xlabel 'chip "
          "thickness [mm]'\nset ylabel "
          "'radial "
          "[N/mm]'\n"
       << radial << law(MATERIAL.kre, MATERIAL.krc, "radial") << "set ylabel 'tangential [N/mm]'\n"
       << tangential << law(MATERIAL.kte, MATERIAL.ktc, "tangential") << "unset multiplot\n";
  plot.draw();
  Drawn drawn{{overAngle(folder, seed), png}, {}};
  for (int way = 0; way < 2; ++way) {
    const double error = std::sqrt(square[way] / whole[way]);
    drawn.rows.push_back(
        {Kind::restated,
         formatted("%s force over chip thickness, feeds 0.1 .. 0.325 mm at 20,000 rpm, figure 5",
                   way == 0 ? "radial" : "tangential"),
         "\"overlap with very small noise\"", formatted("rms %.1f %% off the material's law", 100.0 * error),
         error < 0.1 ? Verdict::agrees : Verdict::differs,
         way == 0 ? "their radial force bends \"unexpectedly\"; that of the simulated material is straight"
                  : "a helical edge is evaluated at its mean lag, so that the ends of the arc deviate"});
  }
  return drawn;
}

}  // namespace

std::vector<Figure> plateFigures() {
  return {{"bachrathy_2", "Bachrathy and Stepan figure 2: transfer matrix of the plate, 6 x 6", matrix},
          {"bachrathy_3", "Bachrathy and Stepan figure 3: a bouncing hammer", bouncing},
          {"bachrathy_4", "Bachrathy and Stepan figure 4 and table 1.1: milling at 5,000 and 20,000 rpm",
           twoSpeeds},
          {"bachrathy_5", "Bachrathy and Stepan figure 5: force over chip thickness", forceOverChip}};
}

}  // namespace smartmill::studies
