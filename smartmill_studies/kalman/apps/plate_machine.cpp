// rosrun smartmill_studies kalman_plate_machine: Bachrathy and Stepan on the simulated machine: taps,
// streaming inversion of the matrix at 5,000 and 20,000 rpm, force over chip thickness.

#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "kalman/bistable.h"
#include "kalman/spindle_rig.h"
#include "smartmill_core/program.h"
#include "smartmill_core/testing/reference_case.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/filter/matrix_inverse.h"
#include "smartmill_loadmeter/identification/force_curve.h"

namespace {

using namespace smartmill;
using kalman::SpindleRig;

constexpr double RATE = sim::World::SAMPLE_RATE;
constexpr double BANDWIDTH = 8000.0, DEPTH = 2e-3, WIDTH = 6e-3;  // [Hz], [m]
constexpr std::array<double, 6> FEEDS{{0.1e-3, 0.15e-3, 0.2e-3, 0.25e-3, 0.3e-3, 0.325e-3}};

/// Fourteen points on the workpiece (his fig. 1), three taps each.
std::vector<kalman::MatrixTap> tapAll(SpindleRig& rig, std::size_t channels) {
  std::vector<std::pair<std::array<double, 3>, std::size_t>> points;  // position, axis
  for (const double x : {-0.03, 0.0, 0.03}) {
    for (const double y : {-0.025, 0.025}) points.push_back({{x, y, 0.03}, 2});
  }
  for (const double y : {-0.02, 0.02}) {
    for (const double z : {0.012, 0.028}) points.push_back({{0.045, y, z}, 0});
  }
  for (const double x : {-0.02, 0.02}) {
    for (const double z : {0.012, 0.028}) points.push_back({{x, -0.04, z}, 1});
  }
  const auto before = static_cast<std::size_t>(0.005 * RATE), length = static_cast<std::size_t>(0.05 * RATE);
  std::vector<kalman::MatrixTap> taps;
  for (const auto& [point, axis] : points) {
    for (int hit = 0; hit < 3; ++hit) {
      std::string message;
      rig.world().setTapPoint(point);
      rig.start();
      rig.world().strike("force_sensor", std::string(1, "xyz"[axis]), message);
      rig.run(0.12);
      const SpindleRig::Record record = rig.take();
      std::size_t at = 0;
      while (at < record.hammer.size() && record.hammer[at] < 20.0) ++at;
      kalman::MatrixTap tap;
      tap.point = point;
      tap.direction[axis] = 1.0;
      const auto cut = [&](const std::vector<double>& v) {
        const auto begin = v.begin() + static_cast<std::ptrdiff_t>(at - before);
        return std::vector<double>(begin, begin + static_cast<std::ptrdiff_t>(length));
      };
      tap.hammer = cut(record.hammer);
      for (std::size_t c = 0; c < channels; ++c) tap.channels.push_back(cut(record.sensors[c]));
      taps.push_back(std::move(tap));
    }
  }
  return taps;
}

/// A complete record through the streaming inverse, without its latency.
std::array<std::vector<double>, 3> inverted(const kalman::TransferMatrix& matrix,
                                            const SpindleRig::Record& record) {
  kalman::MatrixInverse inverse(matrix, BANDWIDTH);
  std::vector<std::vector<double>> samples(
      record.sensors.begin(), record.sensors.begin() + static_cast<std::ptrdiff_t>(matrix.channels));
  for (auto& channel : samples) channel.resize(channel.size() + inverse.latency(), 0.0);
  const auto late = inverse.process(samples);
  std::array<std::vector<double>, 3> force;
  for (std::size_t axis = 0; axis < 3; ++axis)
    force[axis].assign(late[axis].begin() + static_cast<std::ptrdiff_t>(inverse.latency()), late[axis].end());
  return force;
}

/// Down-milling; each pass cuts fresh material.
SpindleRig::Record pass(SpindleRig& rig, const MachineModel& model, double rpm, double feed, double seconds) {
  const Workpiece& stock = model.workpiece.value();
  const double y = stock.high[1] + model.needTool("cut").radius() - WIDTH * (rig.slots() + 1);
  return kalman::cutAlong(rig, model, y, {0.5 * units::PI, units::PI, DEPTH, feed},
                          units::radPerSecFromRpm(rpm), 0.1, seconds, true);
}

void errors(const SpindleRig::Record& r, const kalman::TransferMatrix& three, double rpm) {
  const auto by_three = inverted(three, r);
  std::printf("%.0f rpm, 0.2 mm per tooth: error up to a frequency, %%\n%6s %24s %24s %24s\n", rpm, "kHz",
              "measured x y z", "3 channels", "6 channels, node's");
  for (const double khz : {1.0, 2.0, 3.0, 4.0, 6.0, 8.0}) {
    std::printf("%6.0f", khz);
    const auto row = [&](const auto& force) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t n = r.truth[axis].size();
        std::printf("%8.1f",
                    100.0 * bandError(force[axis], r.truth[axis], RATE, n / 10, n - n / 10, 1e3 * khz));
      }
      std::printf(" ");
    };
    row(r.measured);
    row(by_three);
    row(r.compensated);
    std::printf("\n");
  }
}

/// Bistable range of depths of a tool with this force law.
void bistable(const ForceCurve& law, int teeth, const std::string& picture) {
  Mode mode;
  mode.frequency = 800.0;
  mode.damping_ratio = 0.02;
  mode.gain = 1.0 / 10e6;
  std::vector<double> speeds;
  for (double rpm = 8000.0; rpm <= 24000.0; rpm += 500.0) speeds.push_back(units::radPerSecFromRpm(rpm));
  const auto points = kalman::bistableRange(law, mode, teeth, 0.1e-3, speeds, 3.0, 20e-3);
  double widest = 0.0, sum = 0.0;
  for (const auto& p : points) {
    widest = std::max(widest, 1.0 - p.large / p.small);
    sum += (1.0 - p.large / p.small) / static_cast<double>(points.size());
  }
  std::printf(
      "radial law of 5000 rpm on a tool of 800 Hz, 2 %%, 10 N/um, 0.1 mm per tooth, one tooth always in cut: "
      "large vibrations persist below the limit of small ones over %.0f %% of the depth, at most %.0f %%\n",
      100.0 * sum, 100.0 * widest);
  if (!picture.empty()) kalman::drawBistable(points, picture);
}

ForceCurves chips(const std::vector<SpindleRig::Record>& passes, const MachineModel& model, double rpm) {
  std::printf(
      "\nforce against chip thickness at %.0f rpm, six feeds, N/mm: truth, from compensated +- band, from "
      "measured\n",
      rpm);
  std::array<std::vector<loadmeter::AngleRecord>, 2> records;
  for (std::size_t k = 0; k < passes.size(); ++k) {
    for (std::size_t which = 0; which < 2; ++which) {
      const auto& force = which == 0 ? passes[k].compensated : passes[k].measured;
      loadmeter::AngleRecord record;
      record.angle = passes[k].angle;
      record.angle.resize(force[0].size());
      record.fx = force[0];
      record.fy = force[1];
      record.engagement = {0.5 * units::PI, units::PI, DEPTH, FEEDS[k]};
      records[which].push_back(record);
    }
  }
  const ToolGeometry& tool = model.needTool("cut");
  const auto good = loadmeter::fitForceCurves(records[0], tool),
             raw = loadmeter::fitForceCurves(records[1], tool);
  const CuttingCoefficients& c = *model.cutting;
  std::printf("%8s %36s %36s\n", "h [mm]", "tangential", "radial");
  double worst = 0.0, worst_raw = 0.0;
  for (const double h : {0.025e-3, 0.05e-3, 0.1e-3, 0.15e-3, 0.2e-3, 0.25e-3, 0.3e-3, 0.32e-3}) {
    const double thicker = std::pow(h / 1e-4, -0.25);
    const std::array<double, 2> truth{c.ktc * thicker * h + c.kte, c.krc * thicker * h + c.kre};
    std::printf("%8.3f", 1e3 * h);
    for (std::size_t part = 0; part < 2; ++part) {
      const auto& curve = part == 0 ? good.tangential : good.radial;
      const auto& other = part == 0 ? raw.tangential : raw.radial;
      std::printf("   %8.2f %8.2f +- %5.2f %8.2f", 1e-3 * truth[part], 1e-3 * curve.at(h),
                  1e-3 * curve.stdAt(h), 1e-3 * other.at(h));
      if (h < 0.05e-3) continue;
      worst = std::max(worst, std::abs(curve.at(h) / truth[part] - 1.0));
      worst_raw = std::max(worst_raw, std::abs(other.at(h) / truth[part] - 1.0));
    }
    std::printf("\n");
  }
  std::printf(
      "residual %.2f N compensated, %.2f N measured; largest error from 0.05 mm on: %.1f %%, %.1f %%\n\n",
      good.rms, raw.rms, 100.0 * worst, 100.0 * worst_raw);
  return good;
}

}  // namespace

int main(int argc, char** argv) {
  std::string file, picture;
  std::uint64_t seed = 17;
  CommandLine line{"Six-channel plate on the simulated machine (Bachrathy and Stepan)."};
  line.option("MODEL", file, "smartmill-model/1 of the simulated machine").required();
  line.option("--picture", picture, "of the bistable range, PNG; empty: none");
  line.option("--seed", seed, "of noise and scatter").showDefault();
  return runProgram(line, argc, argv, [&] {
    const MachineModel model = readMachineModel(file);
    sim::WorldOptions world;
    world.seed = seed;
    world.plate.present = true;
    world.tap_contact = 1.1e-4;
    SpindleRig rig(model, world, {}, {}, true);
    std::fprintf(stderr, "tapping\n");
    const auto six = kalman::identifyTransferMatrix(tapAll(rig, 6), RATE);
    const auto three = kalman::identifyTransferMatrix(tapAll(rig, 3), RATE);
    for (const double rpm : {5000.0, 20000.0}) {
      SpindleRig machine(model, world, {}, {}, true);
      machine.sorted().forces().useTransferMatrix(six, BANDWIDTH);
      std::vector<SpindleRig::Record> passes;
      for (const double feed : FEEDS) {
        std::fprintf(stderr, "%.0f rpm, %.3f mm per tooth\n", rpm, 1e3 * feed);
        passes.push_back(pass(machine, model, rpm, feed, 0.3));
      }
      errors(passes[2], three, rpm);
      const auto curves = chips(passes, model, rpm);
      if (rpm == 5000.0) bistable(curves.radial, model.needTool("cut").teeth, picture);
    }
  });
}
