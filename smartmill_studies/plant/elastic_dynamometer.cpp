#include "plant/elastic_dynamometer.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "plant/beam_element.h"
#include "smartmill_core/units.h"

namespace smartmill::plant {
namespace {

constexpr Eigen::Index ELEMENTS = 8;                               // of each beam
constexpr Eigen::Index PLATE = 0, TILT = 1, TABLE = 2, FIRST = 3;  // coordinates; then those of the beams

/// Coordinates of an element of a beam; the lowest one begins at the plate.
ElementCoordinates coordinates(Eigen::Index beam, Eigen::Index element) {
  const auto node = [&](Eigen::Index k) { return k == 0 ? PLATE : FIRST + 2 * (ELEMENTS * beam + k - 1); };
  static_assert(TILT == PLATE + 1);
  return {node(element), node(element) + 1, node(element + 1), node(element + 1) + 1};
}

}  // namespace

std::vector<SensorMode> modesOf(const ElasticDynamometer& d, std::size_t axis, double height) {
  const auto size = FIRST + 2 * ELEMENTS * static_cast<Eigen::Index>(d.beams.size());
  Eigen::MatrixXd mass = Eigen::MatrixXd::Zero(size, size), stiffness = mass;
  mass(PLATE, PLATE) = d.plate_mass;
  mass(TILT, TILT) = d.plate_inertia;
  mass(TABLE, TABLE) = d.table_mass;
  stiffness(PLATE, PLATE) = d.stiffness;
  stiffness(PLATE, TABLE) = stiffness(TABLE, PLATE) = -d.stiffness;
  stiffness(TABLE, TABLE) = d.stiffness + d.table_stiffness;
  stiffness(TILT, TILT) = d.stiffness_tilting;
  for (std::size_t b = 0; b < d.beams.size(); ++b) {
    const UprightBeam& beam = d.beams[b];
    const double section = beam.width * beam.thickness;
    for (Eigen::Index e = 0; e < ELEMENTS; ++e) {
      addBeamElement(beam.height / ELEMENTS, beam.young * section * beam.thickness * beam.thickness / 12.0,
                     beam.density * section, coordinates(static_cast<Eigen::Index>(b), e), mass, stiffness);
    }
  }
  const NormalModes modes = normalModes(mass, stiffness);
  const double length = d.beams.front().height / ELEMENTS;
  const auto element = std::min(ELEMENTS - 1, static_cast<Eigen::Index>(height / length));
  const Eigen::Vector4d cubics = beamCubics(length, height / length - static_cast<double>(element));
  const ElementCoordinates at = coordinates(0, element);
  std::vector<SensorMode> found;
  for (Eigen::Index m = 0; m < size; ++m) {
    const Eigen::VectorXd shape = modes.shapes.col(m);
    SensorMode mode;
    mode.frequency = std::sqrt(modes.squares[m]) / units::TWO_PI;
    mode.damping_ratio = d.damping_ratio;
    for (int k = 0; k < 4; ++k) mode.input[axis] += cubics[k] * shape[at[k]] / modes.squares[m];
    mode.output[axis] = d.stiffness * (shape[PLATE] - shape[TABLE]);
    found.push_back(mode);
  }
  return found;
}

}  // namespace smartmill::plant
