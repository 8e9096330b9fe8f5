// Dunwoody chapter 3: the spindle's load meter.

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "gallery/gallery.h"
#include "loadmeter/machine_cases.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/math/running_line.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/machine_calibration.h"
#include "smartmill_sim/twin/spindle_drive.h"

namespace smartmill::studies {
namespace {

using Rows = std::vector<std::vector<double>>;
using loadmeter::AirCut;

/// Printed values of the Mori-Seiki NMV-5000 (eq. 3.10, 3.11, 3.12, section 3.2.1).
constexpr double KB = 1.43e-7, KTCF = -2.51e-5, K = 3.88e-4, STEP = 3e-4, BANDWIDTH = 7.0;
/// Below 2000 rpm friction rises (Stribeck), as in figure 3.4 of the thesis, which assumes none.
constexpr double ZERO_BELOW_RPM = 2000.0, BREAKAWAY = 0.15, STRIBECK_RPM = 900.0;
constexpr double NOISE = 2e-4;  // [V] RMS of a measurement before rounding
constexpr int READINGS = 50;    // per mean: one second at 50 Hz

Spindle moriSeiki() {
  Spindle spindle;
  spindle.viscous = KB / K;
  spindle.coulomb = KTCF / K;
  spindle.load_meter_gain = K;
  spindle.load_meter_bandwidth = BANDWIDTH;
  spindle.load_meter_resolution = STEP;
  return spindle;
}

/// The machine with its load meter: mean of the controller's values in a steady cut [V].
class Meter {
 public:
  explicit Meter(unsigned seed) : drive_(moriSeiki(), 0.02), random_(seed) {}

  double mean(double torque, double speed) {
    drive_.setFriction(stribeck(speed), 1.0);
    drive_.reset(speed);
    for (int i = 0; i < 100; ++i) drive_.step(torque, speed);
    double sum = 0.0;
    for (int i = 0; i < READINGS; ++i)
      sum += drive_.rounded(drive_.step(torque, speed) + NOISE * normal_(random_));
    return sum / READINGS;
  }

  /// [N m] true friction torque of the machine.
  double friction(double speed) const { return moriSeiki().friction().at(speed, stribeck(speed)); }

 private:
  static double stribeck(double speed) {
    return BREAKAWAY * std::exp(-std::pow(units::rpmFromRadPerSec(speed) / STRIBECK_RPM, 2));
  }

  sim::SpindleDrive drive_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
};

struct Idle {
  std::vector<AirCut> cuts;
  loadmeter::IdleVoltage fit;
};

Idle idleOf(Meter& meter) {
  Idle idle;
  for (double rpm = 1000.0; rpm <= 20000.0; rpm += 1000.0) {
    const double speed = units::radPerSecFromRpm(rpm);
    idle.cuts.push_back({speed, meter.mean(0.0, speed), 0.0});
  }
  idle.fit = loadmeter::fitIdleVoltage(idle.cuts, units::radPerSecFromRpm(ZERO_BELOW_RPM), STEP);
  return idle;
}

Drawn airCutting(const std::string& folder, unsigned seed) {
  Meter meter(seed);
  const Idle idle = idleOf(meter);
  Rows volts, torques, fits;
  for (const AirCut& cut : idle.cuts) {
    const double rpm = units::rpmFromRadPerSec(cut.speed);
    volts.push_back({rpm, cut.voltage});
    torques.push_back({rpm, cut.voltage / (K * cut.speed), meter.friction(cut.speed)});
  }
  for (double rpm = 200.0; rpm <= 20000.0; rpm += 100.0) {
    const double w = units::radPerSecFromRpm(rpm);
    fits.push_back({rpm, idle.fit.at(w), (KB * w + KTCF) * w, idle.fit.at(w) / (K * w), (KB * w + KTCF) / K,
                    meter.friction(w)});
  }
  const std::string png = folder + "/dunwoody_3_1.png";
  Gnuplot plot(png, 900, 900, 12);
  plot.block("volts", volts);
  plot.block("torques", torques);
  plot.block("fits", fits);
  plot << "set multiplot layout 2,1\nset grid\nset key above horizontal samplen 2\nset lmargin 12\nset "
          "xlabel 'spindle speed "
          "[rpm]'\nset ylabel 'load meter in air [V]'\n"
          "plot $fits using 1:3 with lines lw 4 lc rgb '#b0b0b0' title 'thesis, eq. 3.6 with 3.11', "
          "$fits using 1:2 with lines lw 1.5 lc rgb '#2060c0' title 'fitted here', "
          "$volts using 1:2 with points pt 7 lc rgb '#c02020' title 'measured'\n"
          "set ylabel 'torque in air [N m]'\nset yrange [-0.2:1]\n"
          "plot $fits using 1:5 with lines lw 4 lc rgb '#b0b0b0' title 'thesis, eq. 3.11', "
          "$fits using 1:6 with lines dt 2 lc rgb '#606060' title 'the machine, with Stribeck', "
          "$fits using 1:4 with lines lw 1.5 lc rgb '#2060c0' title 'fitted here', "
          "$torques using 1:2 with points pt 7 lc rgb '#c02020' title 'measured'\nunset multiplot\n";
  plot.draw();
  const std::string why =
      "the simulated machine has the constants of the thesis, which are recovered from air cuts with a "
      "resolution of 3e-4 V";
  const auto& f = idle.fit;
  return {
      {png},
      {compareNumber(Kind::restated, "Kb, figure 3.1 [V s2/rad2]", KB, f.kb.value, f.kb.std_dev, 0.02, why),
       compareNumber(Kind::restated, "K Tcf, figure 3.1 [V s/rad]", KTCF, f.ktcf.value, f.ktcf.std_dev, 0.10,
                     why),
       compareNumber(Kind::restated, "b, eq. 3.11 [N m s/rad]", 3.70e-4, f.kb.value / K, f.kb.std_dev / K,
                     0.02, "1.43e-7 / 3.88e-4 is 3.686e-4; the thesis prints 3.70e-4"),
       compareNumber(Kind::restated, "Tcf, eq. 3.11 [N m]", -0.0647, f.ktcf.value / K, f.ktcf.std_dev / K,
                     0.10, why)}};
}

/// A slot of about 2.5 N m: the thesis states "between 2-3 Nm".
constexpr double TORQUE = 2.5;  // [N m]

Drawn sensitivity(const std::string& folder, unsigned seed) {
  Meter meter(seed);
  const Idle idle = idleOf(meter);
  Rows points, lines;
  double wy = 0.0, ww = 0.0;
  for (double rpm = 1000.0; rpm <= 20000.0; rpm += 1000.0) {
    const double w = units::radPerSecFromRpm(rpm);
    const double friction = rpm < ZERO_BELOW_RPM ? 0.0 : idle.fit.at(w);
    const double ratio = (meter.mean(TORQUE, w) - friction) / TORQUE;  // eq. 3.10
    points.push_back({rpm, ratio});
    wy += w * ratio;
    ww += w * w;
  }
  const double slope = wy / ww;
  for (const double rpm : {0.0, 20000.0}) {
    const double w = units::radPerSecFromRpm(rpm);
    lines.push_back({rpm, slope * w, K * w});
  }
  const std::string png = folder + "/dunwoody_3_2.png";
  Gnuplot plot(png, 900, 500, 12);
  plot.block("points", points);
  plot.block("lines", lines);
  plot << "set grid\nset key above horizontal samplen 2\nset xlabel 'spindle speed [rpm]'\nset ylabel '(V - "
          "Vf) / Tc [V/(N "
          "m)]'\n"
          "plot $lines using 1:3 with lines lw 4 lc rgb '#b0b0b0' title 'thesis, 3.88e-4 V/W', "
          "$lines using 1:2 with lines lw 1.5 lc rgb '#2060c0' title 'fitted here', "
          "$points using 1:2 with points pt 7 lc rgb '#c02020' title 'slots, 1000 to 20,000 rpm'\n";
  plot.draw();
  std::vector<Compared> rows{compareNumber(Kind::restated, "K, figure 3.2 [V/W]", K, slope, 0.0, 0.01,
                                           "the machine has the constant of the thesis")};
  // Eq. 3.12 at 2 and 3 N m.
  for (const auto& [share, estimated] : {std::pair(0.10, 35.0), std::pair(0.01, 350.0)}) {
    const auto speed = [s = share](double torque) {
      return units::rpmFromRadPerSec(STEP / (K * s * torque));
    };
    const bool holds = estimated >= 0.9 * speed(3.0) && estimated <= 1.1 * speed(2.0);
    rows.push_back({Kind::restated,
                    formatted("speed at which a step of the meter is %.0f %% of 2..3 N m, eq. 3.12 [rpm]",
                              100.0 * share),
                    formatted("%.0f", estimated), formatted("%.0f .. %.0f", speed(3.0), speed(2.0)),
                    holds ? Verdict::agrees : Verdict::differs, "closed form"});
  }
  return {{png}, rows};
}

Drawn exitOfTheCut(const std::string& folder, unsigned seed) {
  constexpr double RATE = 1000.0, LEAVES = 0.1, SPEED = 1000.0;
  const Spindle spindle = moriSeiki();
  sim::SpindleDrive drive(spindle, 1.0 / RATE);
  drive.reset(SPEED);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, NOISE);
  for (int i = 0; i < 2000; ++i) drive.step(TORQUE, SPEED);
  Rows rows;
  RunningLine decay;
  for (int i = 0; i < 400; ++i) {
    const double t = i / RATE, torque = t < LEAVES ? TORQUE : 0.0;
    const double v = drive.rounded(drive.step(torque, SPEED) + normal(random));
    const double estimated = v / (K * SPEED) - spindle.viscous * SPEED - spindle.coulomb;
    rows.push_back({t, torque, estimated});
    // The logarithm of a first-order decay is a line.
    if (t < LEAVES + 0.002 || estimated < 0.1 * TORQUE) continue;
    decay.add(t - LEAVES, std::log(estimated / TORQUE));
  }
  const double bandwidth = -decay.slope() / units::TWO_PI;
  const std::string png = folder + "/dunwoody_3_3.png";
  Gnuplot plot(png, 900, 450, 12);
  plot.block("torque", rows);
  plot << "set grid\nset key above horizontal samplen 2\nset xlabel 'time [s]'\nset ylabel 'torque [N "
          "m]'\nplot $torque using 1:2 with lines lw "
          "3 lc "
          "rgb '#b0b0b0' title 'cutting torque: the tool leaves', $torque using 1:3 with lines lw 1.5 lc rgb "
          "'#2060c0' title 'by the load meter'\n";
  plot.draw();
  return {{png},
          {compareNumber(Kind::restated, "bandwidth of the load meter, figure 3.3 [Hz]", BANDWIDTH, bandwidth,
                         0.0, 0.05, "the machine has a lag of 7 Hz; here from its step response")}};
}

Drawn coefficients(const std::string& folder, unsigned seed) {
  // Eq. 3.22, 3.23: the machine cuts with the coefficients from the dynamometer.
  constexpr double KTC = 936e6, KTE = 13.9e3, RADIUS = 10e-3, DEPTH = 3e-3, RPM = 5000.0;
  constexpr int TEETH = 2;
  Meter meter(seed);
  const Idle idle = idleOf(meter);
  RunningLine line;  // [N m] over [m]
  Rows points;
  const double w = units::radPerSecFromRpm(RPM);
  for (double feed = 4e-5; feed < 2.1e-4; feed += 2e-5) {
    const double torque = MechanisticForce({TEETH, 2.0 * RADIUS, 0.0, {}}, {KTC, 0.0, 0.0, KTE, 0.0, 0.0},
                                           {0.0, units::PI, DEPTH, feed})
                              .mean()
                              .torque;
    const double estimated = (meter.mean(torque, w) - idle.fit.at(w)) / (K * w);  // eq. 3.5
    points.push_back({1e3 * feed, torque, estimated});
    line.add(feed, estimated);
  }
  const double scale = RADIUS * TEETH * DEPTH;  // eq. 3.19
  const double ktc = line.slope() * units::PI / scale, kte = line.level() * 2.0 / scale;
  const std::string png = folder + "/dunwoody_3_5.png";
  Gnuplot plot(png, 900, 500, 12);
  plot.block("points", points);
  plot << "set grid\nset key above horizontal samplen 2\nset xlabel 'feed per tooth [mm]'\nset ylabel 'mean "
          "cutting torque [N "
          "m]'\n"
          "plot $points using 1:2 with linespoints lw 3 lc rgb '#b0b0b0' title 'dynamometer', $points using "
          "1:3 "
          "with points pt 7 lc rgb '#2060c0' title 'load meter'\n";
  plot.draw();
  const auto off = [](double x) { return formatted("%.2f %% off", 100.0 * std::abs(x)); };
  const double here = ktc / KTC - 1.0, here_edge = kte / KTE - 1.0;
  const std::string why =
      "same procedure, on a machine with resolution, noise and Stribeck friction only; the next figure has "
      "the imperfections of real machines";
  return {{png},
          {{Kind::another_machine, "Ktc by load meter over dynamometer, eq. 3.20, 3.22",
            "11 % off (1040, 936 N/mm2)", off(here), Verdict::shown, why},
           {Kind::another_machine, "Kte by load meter over dynamometer, eq. 3.21, 3.23",
            "-29 % off (9.81, 13.9 N/mm)", off(here_edge), Verdict::shown, why}}};
}

Drawn manyMachines(const std::string& folder, unsigned seed, unsigned machines) {
  const loadmeter::Faults faults;
  std::vector<double> thesis, ours, thesis_edge, ours_edge;
  for (unsigned i = 0; i < machines; ++i) {
    const loadmeter::CaseErrors e = judge(loadmeter::drawCase(seed + i, faults), faults);
    thesis.push_back(100.0 * std::abs(e.thesis_ktc));
    ours.push_back(100.0 * std::abs(e.ktc));
    thesis_edge.push_back(100.0 * std::abs(e.thesis_kte));
    ours_edge.push_back(100.0 * std::abs(e.kte));
  }
  for (auto* errors : {&thesis, &ours, &thesis_edge, &ours_edge}) std::sort(errors->begin(), errors->end());
  Rows rows;
  for (unsigned i = 0; i < machines; ++i)
    rows.push_back({(i + 0.5) / machines, thesis[i], ours[i], thesis_edge[i], ours_edge[i]});
  const std::string png = folder + "/dunwoody_3_5_machines.png";
  Gnuplot plot(png, 900, 500, 12);
  plot.block("rows", rows);
  plot
      << "set grid\nset key above horizontal samplen 2\nset logscale x\nset xlabel '|error| [%]'\nset ylabel "
         "'share of "
         "machines'\n"
         "plot $rows using 2:1 with lines lw 2 lc rgb '#c08040' title 'Ktc, thesis procedure', $rows "
         "using "
         "3:1 with lines lw 2 lc rgb '#2060c0' title 'Ktc, here', $rows using 4:1 with lines dt 2 lw 2 lc "
         "rgb "
         "'#c08040' title 'Kte, thesis procedure', $rows using 5:1 with lines dt 2 lw 2 lc rgb '#2060c0' "
         "title 'Kte, here'\n";
  plot.draw();
  const auto say = [](const std::vector<double>& e) {
    return formatted("median %.1f %%, 95 %% of machines %.1f %%", percentile(e, 0.5), percentile(e, 0.95));
  };
  const auto row = [&](const char* name, const std::vector<double>& theirs, const std::vector<double>& mine) {
    return Compared{Kind::restated,
                    formatted("%s on %u machines with lag, steps, warm-up, Stribeck, depth 2 %% off, runout",
                              name, machines),
                    "their procedure here: " + say(theirs),
                    say(mine),
                    percentile(mine, 0.5) < percentile(theirs, 0.5) ? Verdict::agrees : Verdict::differs,
                    "friction law by evidence, runout and depth as unknowns; the machines cut by the chip "
                    "thickness of the product, so that its fit has the right form"};
  };
  return {{png}, {row("Ktc", thesis, ours), row("Kte", thesis_edge, ours_edge)}};
}

}  // namespace

std::vector<Figure> loadMeterFigures() {
  return {{"dunwoody_3_1", "Dunwoody figures 3.1 and 3.4: load meter and torque in air", airCutting},
          {"dunwoody_3_2", "Dunwoody figure 3.2: sensitivity of the load meter over speed", sensitivity},
          {"dunwoody_3_3", "Dunwoody figure 3.3: the load meter when the tool leaves the cut", exitOfTheCut},
          {"dunwoody_3_5", "Dunwoody figure 3.5: torque over feed per tooth", coefficients},
          {"dunwoody_3_5_machines", "Supplement to figure 3.5: machines with imperfections",
           [](const std::string& folder, unsigned seed) { return manyMachines(folder, seed, 40); },
           [](const std::string& folder, unsigned seed) { return manyMachines(folder, seed, 16); }}};
}

}  // namespace smartmill::studies
