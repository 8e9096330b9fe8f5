// rosrun smartmill_studies kalman_burzoni: chapters 5 and 6 of Burzoni on the sensor in the simulated
// spindle: Q and R from taps, Tables 8 to 15, next to the printed values.

#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "kalman/burzoni_tables.h"
#include "kalman/expanded_disturbance.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/modal_filter.h"
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
    std::printf("%6s %14s %10s %10s | %10s %10s %10s | %14s %10s | %10s %10s | %s\n", "rpm", "Q printed",
                "ours", "noisy", "RMSE pr.", "ours", "noisy", "Q of the cut", "RMSE", "walk, same",
                "harmonics", "wave, %: cut's Q, harmonics");
    for (const kalman::BurzoniRow& r : table.rows)
      std::printf(
          "%6.0f %14.0f %7s2^%-2d %7s2^%-2d | %10.3f %10.3f %10.3f | %11s2^%-2d %10.3f | %10.3f %10.3f | "
          "%8.1f %8.1f\n",
          r.rpm, r.q_printed, "", r.exponent, "", r.noisy_exponent, r.rmse_printed, r.rmse, r.noisy_rmse, "",
          r.cut_exponent, r.cut_rmse, r.walk, r.harmonics, r.cut_wave, r.harmonics_wave);
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

/// A hammer's hits on a sensor, without noise.
ReferenceTaps tapsOn(const ModalModel& sensor, const ReferenceTaps& hits) {
  ReferenceTaps taps{hits.hammer, {}};
  for (const std::vector<double>& hammer : taps.hammer) {
    ModalFilter plant(sensor, RATE, Hold::first_order);
    taps.response.emplace_back();
    for (const double force : hammer) taps.response.back().push_back(plant.step(force));
  }
  return taps;
}

/// @param frequency, gain [1] factors of every mode
ModalModel detuned(ModalModel sensor, double frequency, double gain) {
  for (Mode& mode : sensor.modes) {
    mode.frequency *= frequency;
    mode.gain *= gain;
  }
  sensor.direct *= gain;
  return sensor;
}

/// What bounds Q of the taps: their noise, a wrong model, a gap of the sensor. The filter depends on Q over R
/// alone, so that one R shows all; his Q over R is the same in all of tables 8 to 15.
void boundsOfQ(const BurzoniData& data, double band, std::uint64_t seed) {
  constexpr double R = 0.15;  // [N2]
  const ModalModel& smooth = data.sensor[0];
  ModalModel gap;  // two modes with no response between them near 600 Hz, as his sensor
  gap.modes.push_back({420.0, 0.03, 0.5});
  gap.modes.push_back({930.0, 0.03, 0.5});
  std::vector<double> speeds;
  for (const double rpm : kalman::BURZONI_RPM) speeds.push_back(units::radPerSecFromRpm(rpm));
  std::printf(
      "What bounds Q of the taps, x, R 0.15 N2: n of the best 2^n (Burzoni: 9, at two speeds 10)\n%-52s", "");
  for (const double rpm : kalman::BURZONI_RPM) std::printf(" %6.0f", rpm);
  std::printf("\n");
  const auto line = [&](const std::string& what, const ModalModel& truth, const ModalModel& model,
                        double noise) {
    const ReferenceTaps taps = kalman::withNoise(tapsOn(truth, data.taps[0]), noise * std::sqrt(R), seed);
    const kalman::TuningMap map = kalman::expandedTapMap(taps, model, RATE, R, speeds, data.flutes, band);
    std::printf("%-52s", what.c_str());
    for (const double speed : speeds) std::printf(" %6d", map.best(speed));
    std::printf("\n");
  };
  for (const double noise : {1.0, 5.0, 10.0, kalman::BURZONI_TAP_NOISE, 30.0, 100.0})
    line(formatted("exact model, noise %g times the root of R", noise), smooth, smooth, noise);
  line("noise of R, model 2 % high in frequency", smooth, detuned(smooth, 1.02, 1.0), 1.0);
  line("noise of R, model 2 % low in frequency", smooth, detuned(smooth, 0.98, 1.0), 1.0);
  line("noise of R, model 10 % low in gain", smooth, detuned(smooth, 1.0, 0.9), 1.0);
  line("noise of R, model 10 % high in gain", smooth, detuned(smooth, 1.0, 1.1), 1.0);
  line("sensor with a gap, exact model, noise of R", gap, gap, 1.0);
  line("gap, noise of R, model 2 % high in frequency", gap, detuned(gap, 1.02, 1.0), 1.0);
  line("gap, noise of R, model 2 % low in frequency", gap, detuned(gap, 0.98, 1.0), 1.0);
  line("gap, noise of R, model 5 % high in frequency", gap, detuned(gap, 1.05, 1.0), 1.0);
  line(formatted("gap, exact model, noise %g times the root of R", kalman::BURZONI_TAP_NOISE), gap, gap,
       kalman::BURZONI_TAP_NOISE);
  std::printf("\n");
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
    boundsOfQ(data, band, seed);
    samplingTime(data.sensor[0]);
    gaussian(data);
  });
}
