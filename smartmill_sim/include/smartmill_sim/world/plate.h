#pragma once

#include <array>
#include <cstdint>
#include <random>

#include <Eigen/Core>

#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::sim {

/// A six-channel dynamometer plate under the workpiece. Defaults: natural frequencies of the sensor of
/// Bachrathy and Stepan (section 2); the centre of mass is above the feet, so that forces couple into
/// rotation. Units and meaning: declare().
struct PlateTraits {
  bool present = false;
  std::array<double, 3> origin{{0.0, 0.0, -0.2}};
  std::array<double, 3> frequency{{3000.0, 3000.0, 4000.0}};
  double damping = 0.02;
  double mass = 2.0;
  std::array<double, 3> centre{{2e-3, -3e-3, 12e-3}};
  std::array<double, 3> size{{0.105, 0.09, 0.035}};
  double foot = 0.036;
  double force_noise = 0.05;
  double moment_noise = 0.0015;

  void declare(ParameterTable& table);
};

/// Plate and workpiece as a rigid body on four sensing feet: M q'' + C q' + K q = w with the wrench w of the
/// applied forces about the origin in the plane of the feet; the output is C q' + K q. Exact for forces that
/// are linear between steps.
class Plate {
 public:
  Plate(const PlateTraits& traits, double step, std::uint64_t seed);

  /// One integration step. @param cut [N] cutting force @param cut_point [m] machine coordinates @param hit
  /// [N] force of a hit @param hit_point [m] from the plate's origin
  void step(const std::array<double, 3>& cut, const std::array<double, 3>& cut_point,
            const std::array<double, 3>& hit, const std::array<double, 3>& hit_point);
  /// The sample of these steps: means over them, with noise. @return forces [N], moments [N m]
  std::array<double, 6> read();

 private:
  PlateTraits traits_;
  Eigen::Matrix<double, 12, 12> transition_;
  Eigen::Matrix<double, 12, 6> from_before_, from_change_;
  Eigen::Matrix<double, 6, 12> output_;
  Eigen::Matrix<double, 12, 1> state_ = Eigen::Matrix<double, 12, 1>::Zero();
  Eigen::Matrix<double, 6, 1> last_ = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 1> sum_ = Eigen::Matrix<double, 6, 1>::Zero();
  int steps_ = 0;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

}  // namespace smartmill::sim
