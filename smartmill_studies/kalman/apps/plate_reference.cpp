// rosrun smartmill_studies kalman_plate_reference: Bachrathy and Stepan, sections 2.3 and 3, on a simulated
// plate.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include "kalman/record_inversion.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman_testing/plate_sensor.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace {

using namespace smartmill;
using kalman::invertRecord;

constexpr double RATE = 51200.0;  // [Hz]
using Forces = std::array<std::vector<double>, 3>;

double rmsError(const std::vector<double>& f, const std::vector<double>& truth, std::size_t from,
                std::size_t to) {
  double sum = 0.0, whole = 0.0;
  for (std::size_t i = from; i < to; ++i) {
    sum += (f[i] - truth[i]) * (f[i] - truth[i]);
    whole += truth[i] * truth[i];
  }
  return 100.0 * std::sqrt(sum / whole);
}

double peak(const std::vector<double>& f) {
  return std::abs(
      *std::max_element(f.begin(), f.end(), [](double a, double b) { return std::abs(a) < std::abs(b); }));
}

void bounce(const kalman::PlateSensor& plate, const kalman::TransferMatrix& three,
            const kalman::TransferMatrix& six, std::mt19937& random) {
  const std::vector<double> contact = kalman::bouncingContact(RATE, 0.12, 0.01);
  std::vector<double> begins;
  for (std::size_t i = 1; i < contact.size(); ++i) {
    if (contact[i] > 0.0 && contact[i - 1] == 0.0) begins.push_back(1e3 * static_cast<double>(i) / RATE);
  }
  std::printf("Bouncing hammer (2.3), pressed with %.0f N at an untapped point; contact begins at",
              contact.back());
  for (const double t : begins) std::printf(" %.1f", t);
  std::printf(" ms\n%-4s %9s %26s %26s %26s\n", "", "truth", "measured", "3 channels", "6 channels");
  std::printf("%-4s %9s %13s %12s %13s %12s %13s %12s\n", "axis", "peak N", "peak N", "error %", "peak N",
              "error %", "peak N", "error %");
  const std::array<double, 3> point{{0.026, -0.020, 0.03}}, direction{{0.30, 0.20, -0.9327}};
  Forces applied;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const double f : contact) applied[axis].push_back(f * direction[axis]);
  }
  const auto measured = plate.measure(applied, point, RATE, 6, random);
  const auto by_three = invertRecord(three, {measured[0], measured[1], measured[2]}, RATE, 8000.0);
  const auto by_six = invertRecord(six, measured, RATE, 8000.0);
  const std::size_t from = 256, to = 2304;  // 5 .. 45 ms
  const auto cut = [&](const std::vector<double>& f) {
    return std::vector<double>(f.begin() + from, f.begin() + to);
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::printf("%-4c %9.1f", "xyz"[axis], peak(cut(applied[axis])));
    for (const auto* f : {&measured[axis], &by_three[axis], &by_six[axis]})
      std::printf(" %13.1f %12.1f", peak(cut(*f)), rmsError(*f, applied[axis], from, to));
    std::printf("\n");
  }
  std::printf("error: RMS of the difference over RMS of the truth, 5 .. 45 ms, all frequencies\n\n");
}

void milling(const kalman::PlateSensor& plate, const kalman::TransferMatrix& three,
             const kalman::TransferMatrix& six, double rpm, std::mt19937& random) {
  // Table 1.1: D 12 mm, 2 flutes, 30 deg, half immersion, 2 mm deep, 0.2 mm per tooth, down-milling. The
  // material is not stated: coefficients of the reference cut.
  const MechanisticForce process({2, 12e-3, units::radFromDeg(30.0), {}},
                                 {800e6, 250e6, 80e6, 20e3, 20e3, 5e3},
                                 {0.5 * units::PI, units::PI, 2e-3, 2e-4});
  const double speed = units::radPerSecFromRpm(rpm);
  constexpr int SAMPLES = 25600;
  Forces applied;
  for (int i = 0; i < SAMPLES; ++i) {
    const double t = i / RATE;
    // The record includes entry and exit of the tool.
    const double share = std::clamp(std::min(t - 0.02, 0.46 - t) / 0.005, 0.0, 1.0);
    const CuttingForce f = process.at(speed * t);
    applied[0].push_back(-share * f.fx);  // reaction on the workpiece
    applied[1].push_back(-share * f.fy);
    applied[2].push_back(-share * f.fz);
  }
  const auto measured = plate.measure(applied, {{0.026, -0.020, 0.03}}, RATE, 6, random);
  const auto by_three = invertRecord(three, {measured[0], measured[1], measured[2]}, RATE, 8000.0);
  const auto by_six = invertRecord(six, measured, RATE, 8000.0);
  std::printf("Milling at %.0f rpm, 2 flutes, 30 deg, half immersion (3): error up to a frequency, %%\n",
              rpm);
  std::printf("%6s %24s %24s %24s\n", "kHz", "measured x y z", "3 channels x y z", "6 channels x y z");
  for (int band = 1; band <= 8; ++band) {
    std::printf("%6d", band);
    for (const auto* record : {&measured, &by_three, &by_six}) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        std::printf("%8.1f",
                    100.0 * bandError((*record)[axis], applied[axis], RATE, 2560, 22528, 1e3 * band));
      }
      std::printf(" ");
    }
    std::printf("\n");
  }
  std::printf("peak of x and y: truth %.0f %.0f, measured %.0f %.0f, 6 channels %.0f %.0f N\n\n",
              peak(applied[0]), peak(applied[1]), peak(measured[0]), peak(measured[1]), peak(by_six[0]),
              peak(by_six[1]));
}

}  // namespace

int main() {
  try {
    const kalman::PlateSensor plate;
    std::mt19937 random(2014);
    std::fprintf(stderr, "tapping\n");
    const auto six = kalman::identifyTransferMatrix(kalman::tapPlate(plate, RATE, 6, 3, random), RATE);
    const auto three = kalman::identifyTransferMatrix(kalman::tapPlate(plate, RATE, 3, 3, random), RATE);
    std::printf(
        "Plate of %.0f kg, %.0f / %.0f / %.0f Hz, damping %.2f, noise %.2f N and %.4f N m; 14 points, 3 taps "
        "each\n\n",
        plate.mass, plate.frequency[0], plate.frequency[1], plate.frequency[2], plate.damping,
        plate.force_noise, plate.moment_noise);
    bounce(plate, three, six, random);
    milling(plate, three, six, 5000.0, random);
    milling(plate, three, six, 20000.0, random);
  } catch (const std::exception& e) {
    std::cerr << "plate_reference: " << e.what() << "\n";
    return 1;
  }
  return 0;
}
