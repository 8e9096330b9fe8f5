#include "smartmill_kalman/sensor/transfer_matrix.h"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/LU>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/sensor/tap_file.h"
#include "smartmill_kalman_testing/plate_sensor.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 51200.0;  // [Hz]

TEST(PlateSensor, IsTrueAtRestAndRingsAtItsFrequencies) {
  const PlateSensor plate;
  EXPECT_LT((plate.response(0.0) - Eigen::MatrixXcd::Identity(6, 6)).norm(), 1e-9);
  // With its centre of mass in the feet's plane nothing turns: one mass on a spring, 1 / (2 zeta) at
  // resonance.
  PlateSensor flat;
  flat.centre = {0.0, 0.0, 0.0};
  const auto h = flat.response(3000.0);
  EXPECT_NEAR(std::abs(h(0, 0)), std::sqrt(1.0 + 4.0 * 4e-4) / 0.04, 1e-6);
  EXPECT_NEAR(std::abs(h(0, 4)), 0.0, 1e-9);
  EXPECT_GT(std::abs(plate.response(2800.0)(0, 4)), 1.0);  // forces turn the real one [1/m]
}

TEST(TransferMatrix, FindsThePlatesSixBySix) {
  const PlateSensor plate;
  std::mt19937 random(4);
  const TransferMatrix found =
      identifyTransferMatrix(tapPlate(plate, RATE, 6, 3, random), RATE).band(100.0, 8000.0);
  EXPECT_EQ(found.channels, 6u);
  EXPECT_EQ(found.hits, 42);
  for (std::size_t l = 0; l < found.frequency.size(); l += 25) {
    const Eigen::MatrixXcd truth = plate.response(found.frequency[l]);
    // Both forms, to 6 of their standard deviations (36 numbers at 32 lines) and the hammer's own noise.
    const Eigen::MatrixXd forward = (found.forward[l] - truth).cwiseAbs();
    const Eigen::MatrixXd inverse = (found.inverse[l] - truth.inverse()).cwiseAbs();
    EXPECT_LT(
        (forward.array() / (found.forward_std[l].array() + 0.004 * truth.cwiseAbs().array())).maxCoeff(), 6.0)
        << found.frequency[l];
    EXPECT_LT((inverse.array() / (found.inverse_std[l].array() + 0.004 * truth.inverse().cwiseAbs().array()))
                  .maxCoeff(),
              6.0)
        << found.frequency[l];
  }
  // "In the low frequency range (< 1 kHz) there is no need for compensation": diagonal near 1.
  EXPECT_NEAR(std::abs(found.forward[20](0, 0)), 1.0, 0.05);
  EXPECT_LT(found.condition[20], 1.5);
}

/// How many of the real and imaginary parts of an inverse are independent of each other, of errors dH that
/// are so: the error -W dH W has rows that hang together as those of W do, and columns as its columns. Of a
/// sum of squares with correlations c, (number)^2 / sum of c^2 counts (Satterthwaite 1946).
double independentParts(const Eigen::MatrixXcd& w) {
  const auto squares = [](const Eigen::MatrixXcd& covariance) {
    const Eigen::VectorXd deviation = covariance.diagonal().real().cwiseSqrt();
    return covariance.cwiseAbs().cwiseQuotient(deviation * deviation.transpose()).squaredNorm();
  };
  const auto parts = 2.0 * static_cast<double>(w.size());
  return parts * parts / (2.0 * squares(w * w.adjoint()) * squares(w.transpose() * w.conjugate()));
}

// Real and imaginary parts, each a part of the stated deviation; at 0 Hz there are real parts only. Of the
// parts of an inverse at least five are independent at these places.
TEST(TransferMatrix, StandardDeviationsAreHonest) {
  constexpr double SLOW = 25600.0;
  PlateSensor plate;
  plate.force_noise = plate.moment_noise = 0.0;
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, 0.5);
  std::vector<MatrixTap> quiet;
  for (int k = 0; k < 9; ++k) {  // one point, three hits along each axis
    MatrixTap tap;
    tap.direction[k % 3] = 1.0;
    std::array<std::vector<double>, 3> force;
    for (auto& f : force) f.assign(1280, 0.0);
    for (int i = 0; i < 5; ++i) force[k % 3][128 + i] = 300.0 * std::pow(std::sin(units::PI * i / 5.0), 2);
    tap.hammer = force[k % 3];
    tap.channels = plate.measure(force, tap.point, SLOW, 3, random);
    quiet.push_back(std::move(tap));
  }
  const std::vector<double> places{0.0, 400.0, 1600.0, 3200.0, 4000.0};  // [Hz]
  std::vector<Coverage> both(places.size()), both_of_inverse(places.size());
  constexpr int RUNS = Coverage::RUNS / 5;
  for (int run = 0; run < RUNS; ++run) {
    std::vector<MatrixTap> taps = quiet;
    for (MatrixTap& tap : taps) {
      for (auto& channel : tap.channels) {
        for (double& v : channel) v += noise(random);
      }
    }
    const TransferMatrix found = identifyTransferMatrix(taps, SLOW);
    for (std::size_t p = 0; p < places.size(); ++p) {
      const auto l = static_cast<std::size_t>(std::lround(places[p] / found.frequency[1]));
      const Eigen::MatrixXcd truth = plate.response(found.frequency[l]).topLeftCorner(3, 3);
      const Eigen::MatrixXcd forward = found.forward[l] - truth, inverse = found.inverse[l] - truth.inverse();
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          const double share = l == 0 ? 1.0 : std::sqrt(0.5);
          both[p].add(forward(i, j).real(), found.forward_std[l](i, j) * share);
          both_of_inverse[p].add(inverse(i, j).real(), found.inverse_std[l](i, j) * share);
          if (l == 0) continue;
          both[p].add(forward(i, j).imag(), found.forward_std[l](i, j) * share);
          both_of_inverse[p].add(inverse(i, j).imag(), found.inverse_std[l](i, j) * share);
        }
      }
    }
  }
  for (std::size_t p = 0; p < places.size(); ++p) {
    EXPECT_TRUE(both[p].isCalibrated()) << places[p];
    const Eigen::MatrixXcd truth = plate.response(places[p]).topLeftCorner(3, 3);
    const double parts = independentParts(truth.inverse()) * (places[p] > 0.0 ? 1.0 : 0.5);
    EXPECT_TRUE(both_of_inverse[p].isCalibrated(RUNS * parts)) << places[p];
  }
}

TEST(TransferMatrix, TapsOfAFileAreTheSame) {
  const PlateSensor plate;
  std::mt19937 random(1);
  const TapRecords taps{tapPlate(plate, 25600.0, 6, 1, random), 25600.0};
  const TemporaryFolder folder;
  writeTapFile(taps, folder.file("plate.yaml"));
  const TapRecords again = readTapFile(folder.file("plate.yaml"));
  EXPECT_EQ(again.rate, taps.rate);
  ASSERT_EQ(again.taps.size(), taps.taps.size());
  for (std::size_t t = 0; t < taps.taps.size(); ++t) {
    ASSERT_EQ(again.taps[t].channels.size(), 6u);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(again.taps[t].point[axis], taps.taps[t].point[axis], 1e-9);
      EXPECT_NEAR(again.taps[t].direction[axis], taps.taps[t].direction[axis], 1e-9);
    }
    EXPECT_NEAR(again.taps[t].channels[5].at(200), taps.taps[t].channels[5].at(200), 1e-6);
  }
  EXPECT_THROW(writeTapFile(taps, folder.file("none/plate.yaml")), Error);
}

TEST(TransferMatrix, RefusesTapsThatDoNotTellEverything) {
  const PlateSensor plate;
  std::mt19937 random(1);
  std::vector<MatrixTap> taps = tapPlate(plate, 25600.0, 6, 1, random);
  std::vector<MatrixTap> top(taps.begin(), taps.begin() + 6);  // all from above
  EXPECT_THROW(identifyTransferMatrix(top, 25600.0), Error);
  taps[3].channels[2][7] = std::nan("");
  EXPECT_THROW(identifyTransferMatrix(taps, 25600.0), Error);
  EXPECT_THROW(identifyTransferMatrix({}, 25600.0), Error);
}

}  // namespace
}  // namespace smartmill::kalman
