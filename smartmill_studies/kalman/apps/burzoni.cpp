// rosrun smartmill_studies kalman_burzoni: chapters 5 and 6 of Burzoni on the sensor in the simulated
// spindle: how Q and R are chosen from taps, Tables 8 to 15, beside his printed values.

#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "kalman/expanded_disturbance.h"
#include "kalman/spindle_rig.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/testing/reference_case.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/sensor/state_space_checks.h"

namespace {

using namespace smartmill;
using kalman::SpindleRig;

constexpr double LENGTH = 0.139, RATE = sim::World::SAMPLE_RATE;
constexpr std::array<double, 7> RPM{{1000, 4500, 6000, 8400, 9000, 11600, 17600}};
using Row = std::array<double, 7>;

/// A table of his: R of taps and of cuts [N2], Q of the taps, RMSE of the cuts with that Q.
struct Printed {
  const char* name;
  std::size_t axis;
  double r_tap, r_cut;
  Row q, rmse;
};
const std::array<Printed, 8> PRINTED{{{"Table 8",
                                       0,
                                       0.15,
                                       10,
                                       {512, 512, 512, 1024, 512, 1024, 512},
                                       {0.829, 1.637, 2.499, 4.033, 2.679, 4.010, 3.252}},
                                      {"Table 9",
                                       0,
                                       0.15,
                                       0.15,
                                       {512, 512, 512, 1024, 512, 1024, 512},
                                       {0.751, 1.756, 4.905, 2.711, 7.321, 4.965, 3.155}},
                                      {"Table 10",
                                       0,
                                       10,
                                       10,
                                       {32770, 32770, 32770, 65540, 32770, 65540, 32770},
                                       {0.706, 1.901, 4.803, 3.029, 7.232, 4.648, 3.036}},
                                      {"Table 11",
                                       0,
                                       2,
                                       10,
                                       {8192, 4096, 8192, 16380, 8192, 8192, 8192},
                                       {0.714, 1.879, 4.587, 3.029, 1.273, 4.058, 1.301}},
                                      {"Table 12",
                                       1,
                                       0.15,
                                       10,
                                       {1024, 1024, 1024, 1024, 1024, 1024, 1024},
                                       {0.763, 1.183, 1.818, 2.194, 2.025, 4.486, 1.296}},
                                      {"Table 13",
                                       1,
                                       0.15,
                                       0.15,
                                       {1024, 1024, 1024, 1024, 512, 1024, 1024},
                                       {0.717, 1.428, 1.687, 4.122, 2.701, 3.174, 5.021}},
                                      {"Table 14",
                                       1,
                                       10,
                                       10,
                                       {65550, 65550, 65550, 65550, 32770, 65550, 65550},
                                       {0.708, 1.541, 1.712, 4.047, 3.365, 3.739, 4.475}},
                                      {"Table 15",
                                       1,
                                       2,
                                       10,
                                       {16380, 16380, 16380, 16380, 4096, 16380, 16380},
                                       {0.705, 1.493, 1.703, 1.557, 1.363, 3.628, 1.599}}}};

struct Data {
  std::array<ModalModel, 2> sensor;
  std::array<ReferenceTaps, 2> taps;
  std::array<double, 2> r_tap{}, r_air{};  // [N2]
  std::array<std::vector<double>, 2> air;  // measured at 9000 rpm, unbalance off
  std::array<std::vector<double>, 2> air_raw, still;
  std::vector<SpindleRig::Record> cuts;
  int flutes = 0;
};

/// Blows of a stretch in which the spindle stood: 10 ms before to 190 ms after.
ReferenceTaps blowsOf(const SpindleRig::Record& record, std::size_t axis) {
  ReferenceTaps taps;
  const auto before = static_cast<std::size_t>(0.01 * RATE), length = static_cast<std::size_t>(0.2 * RATE);
  const std::vector<double>& shown = record.measured[axis];
  for (std::size_t i = before; i + length < std::min(shown.size(), record.hammer.size()); ++i) {
    if (record.hammer[i] < 20.0) continue;
    const auto cut = [&](const std::vector<double>& from) {
      const auto begin = from.begin() + static_cast<std::ptrdiff_t>(i - before);
      std::vector<double> piece(begin, begin + static_cast<std::ptrdiff_t>(length));
      const double zero = mean({piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(before / 2)});
      for (double& v : piece) v -= zero;
      return piece;
    };
    taps.hammer.push_back(cut(record.hammer));
    taps.response.push_back(cut(shown));
    i += length;
  }
  return taps;
}

double meanSquare(const std::vector<double>& v) {
  return std::pow(standardDeviation(v), 2);
}

void cutAll(SpindleRig& rig, const MachineModel& model, Data& data) {
  for (const double rpm : RPM) {
    std::fprintf(stderr, "cut at %.0f rpm\n", rpm);
    data.cuts.push_back(kalman::cutSlot(rig, model, units::radPerSecFromRpm(rpm), 0.8e-3, 0.1e-3, 1.0, 0.6));
    for (auto* force : {&data.cuts.back().truth, &data.cuts.back().measured, &data.cuts.back().compensated}) {
      for (auto& axis : *force) axis.resize(data.cuts.back().compensated[2].size());
    }
  }
}

Data gather(const MachineModel& model, std::uint64_t seed, double band) {
  sim::WorldOptions world;
  world.seed = seed;
  world.spindle_sensor.present = true;
  kalman::CompensationParameters filter;
  filter.filter.bandwidth = band;
  filter.filter.max_harmonics = 150;
  kalman::TapParameters taps;
  taps.fit_high = band;
  SpindleRig rig(model, world, filter, taps, false);
  rig.sorted().setSpindleSensorLength(LENGTH);
  rig.tell(CuttingCondition::Kind::none);
  rig.readStatic({0.100, 0.139, 0.180}, {0.0, 100.0, 200.0, 300.0, 0.0}, false);
  kalman::CalibrationGoal fit;
  fit.step = kalman::CalibrationGoal::Step::fit;
  rig.ask(fit);
  rig.world().setToolLength(LENGTH);
  rig.run(0.5);
  Data data;
  data.flutes = model.needTool("cut").teeth;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    std::fprintf(stderr, "taps\n");
    rig.start();
    rig.tap(std::string(1, "xy"[axis]), 9);
    rig.run(0.3);
    data.taps[axis] = blowsOf(rig.take(), axis);
    data.r_tap[axis] = kalman::noiseBefore(data.taps[axis], RATE, 0.005);
  }
  rig.ask(fit);
  for (std::size_t axis = 0; axis < 2; ++axis) data.sensor[axis] = rig.sorted().sensor(axis);
  rig.run(0.5);
  rig.start();
  rig.run(1.0);
  auto quiet = rig.take();
  rig.spin(units::radPerSecFromRpm(9000.0));
  rig.tell(CuttingCondition::Kind::air);
  rig.run(0.3);
  rig.start();
  rig.run(1.0);
  auto raw = rig.take();  // nothing has told the unbalance yet
  rig.run(1.0);
  rig.tell(CuttingCondition::Kind::air);
  rig.run(0.3);
  rig.start();
  rig.run(1.0);
  auto turning = rig.take();
  for (std::size_t axis = 0; axis < 2; ++axis) {
    data.still[axis] = quiet.measured[axis];
    data.air_raw[axis] = raw.measured[axis];
    data.air[axis] = turning.measured[axis];
    data.r_air[axis] = meanSquare(turning.measured[axis]);
  }
  cutAll(rig, model, data);
  return data;
}

void hypotheses(const Data& data, double band) {
  std::printf(
      "R [N2]: before taps x %.3f y %.3f (Burzoni 0.15), cutting air at 9000 rpm x %.2f y %.2f (10)\n\n",
      data.r_tap[0], data.r_tap[1], data.r_air[0], data.r_air[1]);
  std::vector<double> speeds;
  for (const double rpm : RPM) speeds.push_back(units::radPerSecFromRpm(rpm));
  for (const Printed& table : PRINTED) {
    const std::size_t axis = table.axis;
    const auto r = [&](double printed) {
      return printed < 1.0 ? data.r_tap[axis] : printed > 5.0 ? data.r_air[axis] : 0.2 * data.r_air[axis];
    };
    const double r_tap = r(table.r_tap), r_cut = r(table.r_cut);
    std::fprintf(stderr, "%s\n", table.name);
    const kalman::TuningMap map =
        kalman::expandedTapMap(data.taps[axis], data.sensor[axis], RATE, r_tap, speeds, data.flutes, band);
    std::printf("%s, %c: R of taps %.2f, of cuts %.2f (printed %.2f, %.2f)\n", table.name, "xy"[axis], r_tap,
                r_cut, table.r_tap, table.r_cut);
    std::printf("%6s %14s %10s | %10s %10s | %14s %10s | %10s %10s | %s\n", "rpm", "Q printed", "ours",
                "RMSE pr.", "ours", "Q of the cut", "RMSE", "walk, same", "harmonics",
                "wave, %: cut's Q, harmonics");
    for (std::size_t k = 0; k < RPM.size(); ++k) {
      const SpindleRig::Record& cut = data.cuts[k];
      const auto best = kalman::bestOfCut(cut.measured[axis], cut.truth[axis], data.sensor[axis], RATE,
                                          speeds[k], data.flutes, r_cut, band);
      const int n = map.best(speeds[k]);
      const auto score = [&](const std::vector<double>& force) {
        return kalman::scoreCut(force, cut.truth[axis], RATE, speeds[k], data.flutes, force.size() / 4, band,
                                band)
            .rmse;
      };
      const double walk = score(
          kalman::randomWalkForce(cut.measured[axis], data.sensor[axis], RATE, std::pow(2.0, n), r_cut));
      const auto wave = [&](const std::vector<double>& force) {
        const std::size_t end = force.size();
        return 100.0 * bandError(force, cut.truth[axis], RATE, end / 4, end - end / 10, band);
      };
      const double best_wave = wave(kalman::expandedDisturbanceForce(cut.measured[axis], data.sensor[axis],
                                                                     RATE, data.flutes * RPM[k] / 60.0,
                                                                     std::pow(2.0, best.exponent), r_cut));
      std::printf(
          "%6.0f %14.0f %7s2^%-2d | %10.3f %10.3f | %11s2^%-2d %10.3f | %10.3f %10.3f | %8.1f %8.1f\n",
          RPM[k], table.q[k], "", n, table.rmse[k],
          best.all[static_cast<std::size_t>(n - kalman::LEAST_EXPONENT)], "", best.exponent, best.rmse, walk,
          score(cut.compensated[axis]), best_wave, wave(cut.compensated[axis]));
    }
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
    // A force held over each step: the continuous response times the hold's.
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

void gaussian(const Data& data) {
  std::printf("Kurtosis (5-17; 3 of a Gaussian)\n%-44s %8s %8s\n", "", "x", "y");
  const auto line = [](const char* what, const std::array<std::vector<double>, 2>& v) {
    std::printf("%-44s %8.3f %8.3f\n", what, kalman::kurtosis(v[0]), kalman::kurtosis(v[1]));
  };
  line("at rest, before taps", data.still);
  line("cutting air at 9000 rpm, with unbalance", data.air_raw);
  line("cutting air at 9000 rpm, unbalance off", data.air);
  for (std::size_t k : {1u, 4u, 6u}) {
    // What does not repeat from revolution to revolution is the cut's noise.
    std::array<std::vector<double>, 2> left;
    const SpindleRig::Record& cut = data.cuts[k];
    const double turn = 60.0 / RPM[k] * RATE;
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
    std::snprintf(text, sizeof text, "in the cut at %.0f rpm, less the turn before", RPM[k]);
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
  line.option("--bandwidth-hz", band, "up to which harmonics count").showDefault();
  return runProgram(line, argc, argv, [&] {
    const MachineModel model = readMachineModel(file);
    const Data data = gather(model, seed, band);
    hypotheses(data, band);
    samplingTime(data.sensor[0]);
    gaussian(data);
  });
}
