// Cheng and Venuvinod: cutting forces from motor currents.

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "gallery/gallery.h"
#include "loadmeter/turning_scene.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_loadmeter/motor/motor_current.h"

namespace smartmill::studies {
namespace {

using loadmeter::TurningResult;
using Rows = std::vector<std::vector<double>>;

const std::string SAME = "the simulated centre has the paper's laws and the variances of its table 2";
const std::string HELD_OUT = "two thirds of 300 prediction tests, not used for selection";

/// Figure 5: the tool enters the workpiece at half of the record.
Drawn current(const std::string& folder, unsigned seed) {
  constexpr double RATE = 1000.0, FREQUENCY = 8.0, AIR = 0.4;  // [Hz], [Hz] of the phase, [A]
  constexpr double SLOPE = 215.9, FORCE = 325.78;              // table 1 [N/A], table 2 [N]
  constexpr std::size_t COUNT = 4096;
  loadmeter::TurningCentre centre(seed, {});
  std::mt19937 random(seed);
  std::normal_distribution<double> process(0.0, std::sqrt(320.0));  // [N] table 2
  std::vector<double> range, force;
  for (std::size_t i = 0; i < COUNT; ++i) {
    const double entered = std::clamp((static_cast<double>(i) - 0.5 * COUNT) / 60.0, 0.0, 1.0);
    range.push_back(AIR + entered * FORCE / SLOPE);
    force.push_back(entered * FORCE + process(random));
  }
  const std::vector<double> raw = centre.phaseCurrent(range, FREQUENCY);
  const std::vector<double> smooth = loadmeter::denoise(raw, loadmeter::levelFor(FREQUENCY, RATE)),
                            quiet = loadmeter::denoise(force, 6);
  Rows rows;
  for (std::size_t i = COUNT / 2 - 1000; i < COUNT / 2 + 1000; ++i)
    rows.push_back({static_cast<double>(i) / RATE, raw[i], smooth[i], force[i], quiet[i]});
  const std::string png = folder + "/cheng_5.png";
  Gnuplot plot(png, 900, 800, 12);
  plot.block("rows", rows);
  plot << "set multiplot layout 2,1\nset grid\nset lmargin 10\nset key above horizontal samplen 2\nset "
          "xlabel 'time "
          "[s]'\nset ylabel 'current of Z, one phase [A]'\nplot $rows using 1:2 with lines lc rgb '#b0b0b0' "
          "title 'as "
          "measured', $rows using 1:3 with lines lw 2 lc rgb '#2060c0' title 'de-noised by wavelets'\nset "
          "ylabel 'Fz "
          "[N]'\nplot $rows using 1:4 with lines lc rgb '#b0b0b0' title 'dynamometer', $rows using 1:5 with "
          "lines lw 2 "
          "lc rgb '#2060c0' title 'de-noised'\nunset multiplot\n";
  plot.draw();
  const auto part = [&](std::size_t from, std::size_t to) {
    return loadmeter::fitPhase({raw.begin() + static_cast<std::ptrdiff_t>(from),
                                raw.begin() + static_cast<std::ptrdiff_t>(to)},
                               RATE, FREQUENCY)
        .range;
  };
  const auto air = part(0, COUNT / 2 - 48), cut = part(COUNT / 2 + 200, COUNT);
  return {{png},
          {{Kind::restated, "range of the Z current in the cut over that in air, section 7, figure 5 [A]",
            "larger", formatted("%.2f, %.2f", cut.value, air.value),
            cut.value > air.value ? Verdict::agrees : Verdict::differs, ""},
           compareNumber(Kind::restated,
                         "force by the rise of the current, eq. 3, against the dynamometer, figure 5 [N]",
                         FORCE, SLOPE * (cut.value - air.value), SLOPE * std::hypot(cut.std_dev, air.std_dev),
                         0.02, "the mean of table 2, the slope of table 1")}};
}

/// Figure 6: predicted over measured, all three forces.
std::string drawAgreement(const std::string& folder, const TurningResult& r, const loadmeter::Line& line) {
  const std::string png = folder + "/cheng_6.png";
  Gnuplot plot(png, 900, 700, 12);
  const char* names[] = {"Fx", "Fy", "Fz"};
  const char* colours[] = {"#c08040", "#2060c0", "#209060"};
  double most = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Rows rows;
    for (std::size_t i = 0; i < r.truth[axis].size(); ++i) {
      rows.push_back({r.truth[axis][i], r.predicted[axis][i]});
      most = std::max(most, r.truth[axis][i]);
    }
    plot.block(names[axis], rows);
  }
  plot << "set grid\nset key above horizontal samplen 2\nset xlabel 'dynamometer [N]'\nset ylabel 'by motor "
          "currents "
          "[N]'\nset xrange [0:"
       << most << "]\nplot x with lines lw 4 lc rgb '#b0b0b0' title 'equal'";
  for (std::size_t axis = 0; axis < 3; ++axis)
    plot << ", $" << names[axis] << " using 1:2 with points pt 7 ps 0.7 lc rgb '" << colours[axis]
         << "' title '" << names[axis] << "'";
  plot << ", " << line.level.value << " + " << line.slope.value
       << " * x with lines lw 1.5 lc rgb '#c02020' title "
       << Gnuplot::quoted(formatted("line here: %.3f x %+.1f N", line.slope.value, line.level.value))
       << ", -6 + x with lines lw 1.5 dt 2 lc rgb '#404040' title 'printed: about 1, -6 N'\n";
  plot.draw();
  return png;
}

loadmeter::Line pooled(const TurningResult& r) {
  std::vector<double> truth, predicted;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    truth.insert(truth.end(), r.truth[axis].begin(), r.truth[axis].end());
    predicted.insert(predicted.end(), r.predicted[axis].begin(), r.predicted[axis].end());
  }
  return loadmeter::fitLine(truth, predicted);
}

/// Table 1 and figure 6.
Drawn calibrationAndPrediction(const std::string& folder, unsigned seed) {
  const TurningResult r = loadmeter::studyTurning(seed, {}, 12);
  const loadmeter::Line line = pooled(r);
  Drawn drawn;
  drawn.pictures = {drawAgreement(folder, r, line)};
  drawn.rows = {compareNumber(Kind::restated, "Fx over Ix, table 1 [N/A]", -198.45, r.x.slope.value,
                              r.x.slope.std_dev, 0.05, SAME),
                compareNumber(Kind::restated, "Fx at no current, table 1 [N]", 258.0, r.x.level.value,
                              r.x.level.std_dev, 0.05, SAME),
                compareNumber(Kind::restated, "Fz over Iz, table 1 [N/A]", 215.9, r.z.slope.value,
                              r.z.slope.std_dev, 0.05, SAME),
                compareNumber(Kind::restated, "Fz at no current, table 1 [N]", 0.003, r.z.level.value,
                              r.z.level.std_dev, 0.05, SAME)};
  const auto share = [&](const char* what, double printed, double ours, const std::string& why) {
    drawn.rows.push_back({Kind::another_machine, what, formatted("%.4g", printed), formatted("%.4f", ours),
                          Verdict::shown, why});
  };
  share("R2 of the calibration of Fx, table 1", 0.94, r.fit_x,
        "15 facing cuts of 60 to 190 N, where the current of X has a sign; theirs reach further");
  share("R2 of the calibration of Fy, table 1", 0.98, r.fit_y, SAME);
  share("R2 of the calibration of Fz, table 1", 0.9427, r.fit_z, SAME);
  const auto row = [&](const char* what, double seed_rmse, double ours) {
    drawn.rows.push_back({Kind::another_machine, what, formatted("%.0f", seed_rmse), formatted("%.1f", ours),
                          Verdict::shown, HELD_OUT});
  };
  row("rms error of Fx by regression, table 1 [N]", 29.0, r.regression.rmse[0]);
  row("rms error of Fy by regression, table 1 [N]", 36.0, r.regression.rmse[1]);
  row("rms error of Fz by regression, table 1 [N]", 27.0, r.regression.rmse[2]);
  row("rms error of Fy by ANFIS, table 1 [N]", 34.0, r.anfis.rmse[1]);
  row("rms error of Fz by ANFIS, table 1 [N]", 21.0, r.anfis.rmse[2]);
  share("R2 of the prediction of Fx by regression, table 1", 0.837, r.regression.r_squared[0],
        "only forces of 60 to 190 N: less variance to explain, although the RMS error is smaller");
  share("R2 of the prediction of Fy by regression, table 1", 0.9587, r.regression.r_squared[1], HELD_OUT);
  share("R2 of the prediction of Fz by regression, table 1", 0.9427, r.regression.r_squared[2], HELD_OUT);
  share("R2 of the prediction of Fy by ANFIS, table 1", 0.96, r.anfis.r_squared[1], HELD_OUT);
  share("R2 of the prediction of Fz by ANFIS, table 1", 0.94, r.anfis.r_squared[2], HELD_OUT);
  drawn.rows.push_back(compareNumber(Kind::restated, "slope of predicted over measured, figure 6", 1.0,
                                     line.slope.value, line.slope.std_dev, 0.03, "\"nearly equal to 1\""));
  drawn.rows.push_back({Kind::another_machine, "level of that line, figure 6 [N]", "-6",
                        formatted("%.1f", line.level.value), Verdict::shown, "nothing is right"});
  share("R2 of that line, figure 6", 0.97, line.r_squared, HELD_OUT);
  drawn.rows.push_back(
      {Kind::another_machine, "95 % interval of one force, section 10, figure 6 [N]", "about 35",
       formatted("%.0f", 1.96 * line.scatter), Verdict::shown,
       "all three forces; scatter of the process, by table 2, alone makes 18 (Fy) and 35 (Fz)"});
  return drawn;
}

/// Table 2.
Drawn variances(const std::string&, unsigned seed) {
  const loadmeter::TurningVariances put_in;
  const TurningResult r = loadmeter::studyTurning(seed, put_in, 400),
                      twelve = loadmeter::studyTurning(seed, put_in, 12);
  Drawn drawn;
  const std::string many =
      "400 replications; the twelve of the paper give a variance only within a factor of two";
  const auto row = [&](const char* what, const char* name, double printed, double ours, double part,
                       const std::string& why) {
    drawn.rows.push_back(
        compareNumber(Kind::restated, formatted("%s %s", what, name), printed, ours, 0.0, part, why));
  };
  const auto mean = [&](const char* what, const char* name, double printed, double ours, const char* why) {
    drawn.rows.push_back({Kind::another_machine, formatted("%s %s", what, name), formatted("%.4g", printed),
                          formatted("%.4g", ours), Verdict::shown, why});
  };
  const auto axis = [&](const char* name, const std::array<double, 5>& printed,
                        const loadmeter::VarianceSplit& split, const loadmeter::VarianceSplit& few,
                        bool differ) {
    mean("mean by the dynamometer, table 2 [N],", name, printed[0], split.process_mean,
         "the simulated cut of aluminium has about the main force of the paper, and a larger feed force");
    mean("mean by the current, table 2 [N],", name, printed[1], split.current_mean,
         "as for the dynamometer: the difference of the two is compared");
    row("variance by the dynamometer, table 2 [N2],", name, printed[2], split.process_variance, 0.25, many);
    row("variance by the current, table 2 [N2],", name, printed[3], split.current_variance, 0.25, many);
    row("variance of the measurement by current, table 2 [N2],", name, printed[4], split.sensor_variance,
        0.25, many);
    const bool here = few.p_means < 0.05;
    drawn.rows.push_back(
        {Kind::another_machine, formatted("means of twelve differ at 5 %%, section 12, %s", name),
         differ ? "yes" : "no", formatted("%s (p %.2f)", here ? "yes" : "no", few.p_means), Verdict::shown,
         "their spindle law is from another material; the simulated one is the same"});
  };
  axis("Fy", {485.78, 465.21, 84.0, 425.0, 383.0}, r.fy, twelve.fy, true);
  axis("Fz", {325.78, 326.87, 320.0, 580.0, 260.0}, r.fz, twelve.fz, false);
  return drawn;
}

}  // namespace

std::vector<Figure> motorFigures() {
  return {{"cheng_5", "Cheng and Venuvinod figure 5: a motor's current as the tool enters, and the force",
           current},
          {"cheng_table_1", "Cheng and Venuvinod table 1 and figure 6: forces from motor currents",
           calibrationAndPrediction},
          {"cheng_table_2", "Cheng and Venuvinod table 2: variance of twelve replications", variances}};
}

}  // namespace smartmill::studies
