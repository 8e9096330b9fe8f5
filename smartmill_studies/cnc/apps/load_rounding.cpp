// rosrun smartmill_studies cnc_load_rounding: error of the cutting coefficients caused by the rounding of
// polled loads. Air cuts at four speeds give the friction, slots at one speed and several feeds the
// coefficients (Dunwoody chapter 3). Each voltage is the mean of values polled at 50 Hz, with the tooth
// passing ripple behind the first-order lag of the load meter.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "study_case.h"

namespace {

using namespace smartmill;

constexpr double POLL = 0.02;     // [s]
constexpr int POLLS = 75;         // of a cut of 1.5 s
constexpr double JITTER = 0.002;  // [s] of the time at which a reply was made
constexpr double STEPS[] = {0.0, 3.0e-4, 8.0e-4, 8.0e-3, 8.0e-2};  // [V]
constexpr std::size_t KTC = 0, KTE = 3, TORQUE = 3;                // of meanForceMatrix()

struct Cell {
  Spindle spindle;
  ToolGeometry tool;
  double ktc = 0.0, kte = 0.0;
  double step = 0.0;  // [V]
  std::mt19937_64 random;

  double rounded(double volt) const { return step > 0.0 ? step * std::round(volt / step) : volt; }

  /// Mean polled voltage of a cut with a mean torque [N m] at a speed [rad/s].
  double polled(double torque, double speed) {
    const double mean =
        spindle.load_meter_gain * (torque + spindle.viscous * speed + spindle.coulomb) * speed;
    const double passing = tool.teeth * speed / units::TWO_PI;  // [Hz]
    // The torque of a slot ripples by about its mean with two teeth, by less with more; the lag attenuates
    // it.
    const double ripple = spindle.load_meter_gain * torque * speed / tool.teeth /
                          std::hypot(1.0, passing / spindle.load_meter_bandwidth);
    std::uniform_real_distribution<double> phase(0.0, units::TWO_PI), late(0.0, JITTER);
    const double begin = phase(random);
    double sum = 0.0;
    for (int i = 0; i < POLLS; ++i) {
      const double time = i * POLL + late(random);
      sum += rounded(mean + ripple * std::sin(begin + units::TWO_PI * passing * time));
    }
    return sum / POLLS;
  }

  /// Relative error of Ktc.
  double identify() {
    const std::vector<double> speeds{105.0, 420.0, 840.0, 1260.0};
    Eigen::MatrixXd friction(4, 2), torque(4, 1);
    for (int i = 0; i < 4; ++i) {
      const double w = speeds[static_cast<std::size_t>(i)];
      friction(i, 0) = w;
      friction(i, 1) = 1.0;
      torque(i, 0) = polled(0.0, w) / (spindle.load_meter_gain * w);
    }
    const Eigen::MatrixXd air = linear::leastSquares(friction, torque).x;
    const double speed = 470.0;  // about 4500 rpm
    const std::vector<double> feeds{30e-6, 60e-6, 100e-6, 150e-6};
    Eigen::MatrixXd a(4, 2), b(4, 1);
    for (int i = 0; i < 4; ++i) {
      const auto map = meanForceMatrix(tool, {0.0, units::PI, 1.0e-3, feeds[static_cast<std::size_t>(i)]});
      a(i, 0) = map[TORQUE][KTC];
      a(i, 1) = map[TORQUE][KTE];
      const double volt = polled(a(i, 0) * ktc + a(i, 1) * kte, speed);
      b(i, 0) = volt / (spindle.load_meter_gain * speed) - air(0, 0) * speed - air(1, 0);
    }
    // Scaled so that both unknowns are near 1.
    Eigen::MatrixXd scaled = a;
    scaled.col(0) *= ktc;
    scaled.col(1) *= kte;
    return std::abs(linear::leastSquares(scaled, b).x(0, 0) - 1.0);
  }
};

/// A machine with a resolution of its load meter, before a coefficient is drawn.
Cell cellOf(const MachineModel& model, double step, std::uint64_t seed) {
  return {model.needSpindle("draw machines"),
          model.needTool("draw machines"),
          0.0,
          0.0,
          step,
          std::mt19937_64(seed)};
}

/// Draws coefficients and identifies them. @return relative error of Ktc
double errorOf(Cell& cell) {
  std::uniform_real_distribution<double> ktc(600e6, 2200e6), kte(10e3, 40e3);
  cell.ktc = ktc(cell.random);
  cell.kte = kte(cell.random);
  return cell.identify();
}

std::string nameOf(double step) {
  return formatted("step_%.1f_mv", 1e3 * step);
}

void runOne(const StudyCase& one, const MachineModel& model, std::uint64_t seed) {
  nlohmann::json line{{"case", one.number}};
  for (const double step : STEPS) {
    Cell cell = cellOf(model, step, seedOfCase(seed, one.number));
    line[nameOf(step)] = errorOf(cell);
  }
  one.print(line);
}

void print(double step, std::vector<double> errors) {
  std::sort(errors.begin(), errors.end());
  std::printf("step %6.1f mV: error of Ktc %.3f %% (median), %.3f %% (95 %%)\n", 1e3 * step,
              100.0 * errors[errors.size() / 2], 100.0 * errors[errors.size() * 95 / 100]);
}

void score(const std::string& file) {
  const auto lines = readJsonLines(file);
  if (lines.empty()) throw Error(file + ": no case");
  for (const double step : STEPS) {
    std::vector<double> errors;
    for (const nlohmann::json& line : lines) errors.push_back(line.at(nameOf(step)));
    print(step, errors);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::string model_file;
  int machines = 500;
  std::uint64_t seed = 1;
  StudyCase one;
  CommandLine line{
      "Error of Ktc from polled loads over their resolution, with random coefficients on a model's machine."};
  line.option("MODEL", model_file, "machine model with tool and spindle").required();
  one.addTo(line, "--machines,--cases", machines, "random machines for each resolution");
  one.addScore(line);
  line.option("--seed", seed, "of the draws").showDefault();
  return runProgram(line, argc, argv, [&] {
    one.check(machines);
    if (one.scores()) return score(one.lines);
    const MachineModel model = readMachineModel(model_file);
    if (one.one()) return runOne(one, model, seed);
    for (const double step : STEPS) {
      std::vector<double> errors;
      Cell cell = cellOf(model, step, seed);
      for (int i = 0; i < machines; ++i) errors.push_back(errorOf(cell));
      print(step, errors);
    }
  });
}
