#include "kalman/burzoni_tables.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <random>

#include "kalman/expanded_disturbance.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

constexpr double LENGTH = 0.139, RATE = sim::World::SAMPLE_RATE;
constexpr const auto& RPM = BURZONI_RPM;
using Row = std::array<double, 7>;

/// One of his tables: R of taps and of cuts [N2], Q of the taps, RMSE of the cuts with that Q.
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

/// Hits of a segment with the spindle stopped: 10 ms before to 190 ms after.
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

void cutAll(SpindleRig& rig, const MachineModel& model, BurzoniData& data) {
  for (const double rpm : RPM) {
    std::fprintf(stderr, "cut at %.0f rpm\n", rpm);
    data.cuts.push_back(cutSlot(rig, model, units::radPerSecFromRpm(rpm), 0.8e-3, 0.1e-3, 1.0, 0.6));
    for (auto* force : {&data.cuts.back().truth, &data.cuts.back().measured, &data.cuts.back().compensated}) {
      for (auto& axis : *force) axis.resize(data.cuts.back().compensated[2].size());
    }
  }
}

/// The printed R is that of the taps, of the air cut, or a fifth of the latter.
double noiseOf(const BurzoniData& data, std::size_t axis, double printed) {
  if (printed < 1.0) return data.r_tap[axis];
  return printed > 5.0 ? data.r_air[axis] : 0.2 * data.r_air[axis];
}

std::unique_ptr<SpindleRig> rigOf(const MachineModel& model, std::uint64_t seed, double band) {
  sim::WorldOptions world;
  world.seed = seed;
  world.spindle_sensor.present = true;
  CompensationParameters filter;
  filter.filter.bandwidth = band;
  filter.filter.max_harmonics = 150;
  TapParameters taps;
  taps.fit_high = band;
  auto rig = std::make_unique<SpindleRig>(model, world, filter, taps, false);
  rig->sorted().forces().spindle().setLength(LENGTH);
  rig->publishCondition(CuttingCondition::Kind::none);
  return rig;
}

CalibrationGoal step(CalibrationGoal::Step which) {
  CalibrationGoal goal;
  goal.step = which;
  return goal;
}

/// [N] from the six sensors with static calibration, including zero offset, drift and unbalance.
std::vector<double> shownForce(const SpindleRig::Record& record, const SpindleSensorCalibration& calibration,
                               std::size_t axis) {
  std::vector<double> force;
  for (std::size_t i = 0; i < record.sensors[5].size(); ++i) {
    std::array<double, 6> six{};
    for (std::size_t k = 0; k < six.size(); ++k) six[k] = record.sensors[k][i];
    force.push_back(staticForce(calibration, LENGTH, pairMeans(six))[axis]);
  }
  return force;
}

/// Record of a constant load, which stays applied.
SpindleRig::Record pulled(SpindleRig& rig, std::size_t axis, double load, bool on_table) {
  std::array<double, 3> force{};
  force[axis] = load;
  rig.world().pull(force, on_table);
  rig.run(0.15);
  rig.start();
  rig.run(0.25);
  return rig.take();
}

std::vector<double> weights() {
  std::vector<double> loads;
  for (const int hung : {0, 1, 2, 3, 4, 5, 6, 7, 0}) loads.push_back(44.5 * hung);  // 10 lbs each
  return loads;
}

/// His weights at the length of the tool; zero and drift from the first and last measurement without load.
void hang(SpindleRig& rig, BurzoniStatics& found) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double>& sensor_output = found.sensor_output[axis];
    for (const double load : weights()) {
      found.hung[axis].push_back(load);
      sensor_output.push_back(mean(shownForce(pulled(rig, axis, load, false), found.calibration, axis)));
    }
    const double first = sensor_output.front(), last = sensor_output.back();
    for (std::size_t i = 0; i < sensor_output.size(); ++i)
      sensor_output[i] -=
          first + (last - first) * static_cast<double>(i) / static_cast<double>(sensor_output.size() - 1);
    rig.world().pull({}, false);
  }
}

/// The tool pressed against the workpiece in small steps, measured by the sensor and by the dynamometer.
void press(SpindleRig& rig, BurzoniStatics& found) {
  for (std::size_t axis = 0; axis < 2; ++axis) {
    for (const double load : {0.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0, 0.0}) {
      const SpindleRig::Record held = pulled(rig, axis, load, true);
      const std::vector<double> sensor_output = shownForce(held, found.calibration, axis),
                                &below = held.dynamometer[axis];
      found.pressed[axis].insert(found.pressed[axis].end(), sensor_output.begin(), sensor_output.end());
      found.on_table[axis].insert(found.on_table[axis].end(), below.begin(), below.end());
    }
    rig.world().pull({}, false);
  }
}

/// One second of air cut along x at each speed, minus the unbalance identified at earlier speeds.
void turn(SpindleRig& rig, BurzoniStatics& found) {
  for (const double rpm : found.turning) {
    rig.spin(units::radPerSecFromRpm(rpm));
    for (int k = 0; k < 2; ++k) {
      rig.publishCondition(CuttingCondition::Kind::air);
      rig.run(1.0);
    }
    rig.start();
    rig.run(1.0);
    const SpindleRig::Record turning = rig.take();
    found.unbalanced.push_back(shownForce(turning, found.calibration, 0));
    found.balanced.push_back(turning.measured[0]);
    found.unbalanced.back().resize(found.balanced.back().size());
  }
}

}  // namespace

BurzoniStatics gatherStatics(const MachineModel& model, std::uint64_t seed) {
  constexpr double BAND = 2500.0, VERIFIED = 0.120;  // [Hz], [m]
  const auto made = rigOf(model, seed, BAND);
  SpindleRig& rig = *made;
  BurzoniStatics found;
  std::fprintf(stderr, "weights at three lengths\n");
  rig.readStatic({0.100, LENGTH, 0.180}, weights(), false);
  rig.ask(step(CalibrationGoal::Step::fit));
  rig.readStatic({VERIFIED}, {0.0, 100.0, 200.0, 300.0, 0.0}, true);
  found.verified = rig.ask(step(CalibrationGoal::Step::verify)).error;
  rig.world().setToolLength(LENGTH);
  rig.run(0.5);
  for (const char* direction : {"x", "y"}) rig.tap(direction, 9);
  found.calibration = rig.ask(step(CalibrationGoal::Step::fit)).calibration.value();
  hang(rig, found);
  press(rig, found);
  found.turning = {1000.0, 4500.0, 10000.0, 17600.0};
  turn(rig, found);
  return found;
}

ReferenceTaps withNoise(const ReferenceTaps& taps, double rms, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> draw(0.0, rms);
  ReferenceTaps noisy = taps;
  for (std::vector<double>& response : noisy.response) {
    for (double& sample : response) sample += draw(random);
  }
  return noisy;
}

BurzoniData gatherBurzoni(const MachineModel& model, std::uint64_t seed, double band) {
  const auto made = rigOf(model, seed, band);
  SpindleRig& rig = *made;
  rig.readStatic({0.100, 0.139, 0.180}, {0.0, 100.0, 200.0, 300.0, 0.0}, false);
  rig.ask(step(CalibrationGoal::Step::fit));
  rig.world().setToolLength(LENGTH);
  rig.run(0.5);
  BurzoniData data;
  data.flutes = model.needTool("cut").teeth;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    std::fprintf(stderr, "taps\n");
    rig.start();
    rig.tap(std::string(1, "xy"[axis]), 9);
    rig.run(0.3);
    data.taps[axis] = blowsOf(rig.take(), axis);
    data.r_tap[axis] = noiseBefore(data.taps[axis], RATE, 0.005);
    data.noisy_taps[axis] =
        withNoise(data.taps[axis], BURZONI_TAP_NOISE * std::sqrt(data.r_tap[axis]), seed + axis);
  }
  rig.ask(step(CalibrationGoal::Step::fit));
  for (std::size_t axis = 0; axis < 2; ++axis) data.sensor[axis] = rig.sorted().forces().sensor(axis);
  rig.run(0.5);
  rig.start();
  rig.run(1.0);
  auto quiet = rig.take();
  rig.spin(units::radPerSecFromRpm(9000.0));
  rig.publishCondition(CuttingCondition::Kind::air);
  rig.run(0.3);
  rig.start();
  rig.run(1.0);
  auto raw = rig.take();  // unbalance not identified yet
  rig.run(1.0);
  rig.publishCondition(CuttingCondition::Kind::air);
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

BurzoniTable burzoniTable(const BurzoniData& data, std::size_t number, double band) {
  const Printed& printed = PRINTED.at(number);
  const std::size_t axis = printed.axis;
  BurzoniTable table{printed.name,
                     axis,
                     printed.r_tap,
                     printed.r_cut,
                     noiseOf(data, axis, printed.r_tap),
                     noiseOf(data, axis, printed.r_cut),
                     {}};
  std::vector<double> speeds;
  for (const double rpm : RPM) speeds.push_back(units::radPerSecFromRpm(rpm));
  const auto map_of = [&](const ReferenceTaps& taps) {
    return expandedTapMap(taps, data.sensor[axis], RATE, table.r_tap, speeds, data.flutes, band);
  };
  const TuningMap map = map_of(data.taps[axis]), noisy = map_of(data.noisy_taps[axis]);
  for (std::size_t k = 0; k < RPM.size(); ++k) {
    const SpindleRig::Record& cut = data.cuts[k];
    const std::vector<double>&measured = cut.measured[axis], &truth = cut.truth[axis];
    const CutOptimum best =
        bestOfCut(measured, truth, data.sensor[axis], RATE, speeds[k], data.flutes, table.r_cut, band);
    const auto score = [&](const std::vector<double>& force) {
      return scoreCut(force, truth, RATE, speeds[k], data.flutes, force.size() / 4, band, band).rmse;
    };
    const auto wave = [&](const std::vector<double>& force) {
      const std::size_t end = force.size();
      return 100.0 * bandError(force, truth, RATE, end / 4, end - end / 10, band);
    };
    BurzoniRow row;
    row.rpm = RPM[k];
    row.q_printed = printed.q[k];
    row.rmse_printed = printed.rmse[k];
    row.exponent = map.best(speeds[k]);
    row.rmse = best.all[static_cast<std::size_t>(row.exponent - LEAST_EXPONENT)];
    row.noisy_exponent = noisy.best(speeds[k]);
    row.noisy_rmse = best.all[static_cast<std::size_t>(row.noisy_exponent - LEAST_EXPONENT)];
    row.cut_exponent = best.exponent;
    row.cut_rmse = best.rmse;
    row.cut_wave =
        wave(expandedDisturbanceForce(measured, data.sensor[axis], RATE, data.flutes * RPM[k] / 60.0,
                                      std::pow(2.0, best.exponent), table.r_cut));
    row.curve = best.all;
    row.walk =
        score(randomWalkForce(measured, data.sensor[axis], RATE, std::pow(2.0, row.exponent), table.r_cut));
    row.harmonics = score(cut.compensated[axis]);
    row.harmonics_wave = wave(cut.compensated[axis]);
    table.rows.push_back(row);
  }
  return table;
}

}  // namespace smartmill::kalman
