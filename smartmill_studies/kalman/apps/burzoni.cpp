// rosrun smartmill_studies kalman_burzoni: chapters 5 and 6 of Burzoni on the sensor in the simulated
// spindle: Q and R from taps, Tables 8 to 15, next to the printed values.

#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "kalman/burzoni_tables.h"
#include "kalman/expanded_disturbance.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/sensor/state_space_checks.h"

namespace {

using namespace smartmill;
using kalman::BurzoniData;
using kalman::SpindleRig;

constexpr double RATE = sim::World::SAMPLE_RATE;

void hypotheses(const BurzoniData& data, double band) {
  std::printf(
      "R [N2]: before taps x %.3f y %.3f (Burzoni 0.15), cutting air at 9000 rpm x %.2f y %.2f (10)\n\n",
      data.r_tap[0], data.r_tap[1], data.r_air[0], data.r_air[1]);
  for (std::size_t number = 0; number < kalman::BURZONI_TABLES; ++number) {
    std::fprintf(stderr, "table %zu of %zu\n", number + 1, kalman::BURZONI_TABLES);
    const kalman::BurzoniTable table = kalman::burzoniTable(data, number, band);
    std::printf("%s, %c: R of taps %.2f, of cuts %.2f (printed %.2f, %.2f)\n", table.name.c_str(),
                "xy"[table.axis], table.r_tap, table.r_cut, table.r_tap_printed, table.r_cut_printed);
    std::printf("%6s %14s %10s | %10s %10s | %14s %10s | %10s %10s | %s\n", "rpm", "Q printed", "ours",
                "RMSE pr.", "ours", "Q of the cut", "RMSE", "walk, same", "harmonics",
                "wave, %: cut's Q, harmonics");
    for (const kalman::BurzoniRow& r : table.rows)
      std::printf(
          "%6.0f %14.0f %7s2^%-2d | %10.3f %10.3f | %11s2^%-2d %10.3f | %10.3f %10.3f | %8.1f %8.1f\n", r.rpm,
          r.q_printed, "", r.exponent, r.rmse_printed, r.rmse, "", r.cut_exponent, r.cut_rmse, r.walk,
          r.harmonics, r.cut_wave, r.harmonics_wave);
    std::printf("\n");
  }
}

void samplingTime(const ModalModel& sensor) {
  std::printf("Sampling time (5.2; Burzoni takes 1e-4 s): x, modes and constant, modal coordinates\n");
  std::printf("%10s %14s %16s %26s\n", "dt [s]", "condition of F", "1 / condition of O",
              "error of |H| to 2.5 kHz, %");
  const StateSpace space = kalman::withForce(stateSpace(sensor));
  for (const double dt : {1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5}) {
    StateSpace discrete = space;
    discrete.a = discretiseNoise(space.a, Eigen::MatrixXd::Zero(space.a.rows(), space.a.rows()), dt).first;
    const kalman::StateSpaceCheck check = kalman::checkStateSpace(discrete, "discrete");
    // Zero-order hold of the force: the continuous response times that of the hold.
    double worst = 0.0;
    for (double f = 10.0; f <= 2500.0; f += 10.0) {
      const double x = units::PI * f * dt;
      worst = std::max(worst, std::abs(1.0 - std::abs(std::sin(x) / x)));
    }
    std::printf("%10.0e %14.3g %16.3g %22.2f\n", dt, check.condition, 1.0 / check.observability_condition,
                100.0 * worst);
  }
  std::printf("\n");
}

void gaussian(const BurzoniData& data) {
  std::printf("Kurtosis (5-17; 3 of a Gaussian)\n%-44s %8s %8s\n", "", "x", "y");
  const auto line = [](const char* what, const std::array<std::vector<double>, 2>& v) {
    std::printf("%-44s %8.3f %8.3f\n", what, kalman::kurtosis(v[0]), kalman::kurtosis(v[1]));
  };
  line("at rest, before taps", data.still);
  line("cutting air at 9000 rpm, with unbalance", data.air_raw);
  line("cutting air at 9000 rpm, unbalance off", data.air);
  for (std::size_t k : {1u, 4u, 6u}) {
    // The noise of the cut is its asynchronous part.
    std::array<std::vector<double>, 2> left;
    const SpindleRig::Record& cut = data.cuts[k];
    const double turn = 60.0 / kalman::BURZONI_RPM[k] * RATE;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      for (std::size_t i = 0; i + static_cast<std::size_t>(std::ceil(turn)) + 1 < cut.measured[axis].size();
           ++i) {
        const double at = static_cast<double>(i) + turn;
        const auto j = static_cast<std::size_t>(at);
        const double share = at - static_cast<double>(j);
        left[axis].push_back(cut.measured[axis][i] - (1.0 - share) * cut.measured[axis][j] -
                             share * cut.measured[axis][j + 1]);
      }
    }
    char text[64];
    std::snprintf(text, sizeof text, "in the cut at %.0f rpm, minus the last revolution",
                  kalman::BURZONI_RPM[k]);
    line(text, left);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::string file;
  std::uint64_t seed = 17;
  double band = 2500.0;
  CommandLine line{"Burzoni's tuning of Q and R on the sensor in the simulated spindle (Tables 8 to 15)."};
  line.option("MODEL", file, "smartmill-model/1 of the simulated machine").required();
  line.option("--seed", seed, "of noise and scatter").showDefault();
  line.option("--bandwidth-hz", band, "highest harmonic [Hz]").showDefault();
  return runProgram(line, argc, argv, [&] {
    const MachineModel model = readMachineModel(file);
    const BurzoniData data = kalman::gatherBurzoni(model, seed, band);
    hypotheses(data, band);
    samplingTime(data.sensor[0]);
    gaussian(data);
  });
}
