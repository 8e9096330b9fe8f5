#include "smartmill_sim/world/tool_structure.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr double NO_GAIN = 1e-9;  // relative to the largest gain: a negligible mode

using Element = Eigen::Matrix4d;

struct Section {
  double area, inertia;
  explicit Section(double diameter)
      : area(0.25 * units::PI * diameter * diameter), inertia(area * diameter * diameter / 16.0) {}
};

/// Przemieniecki, Theory of Matrix Structural Analysis, section 5.6: phi = 12 E I / (kappa G A l^2).
Element stiffnessOf(const RoundBeam& beam, const Section& s, double l) {
  // Cowper's factor of a round section.
  const double nu = beam.poisson, kappa = 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu);
  const double shear = 0.5 * beam.young / (1.0 + nu);
  const double phi = beam.shear ? 12.0 * beam.young * s.inertia / (kappa * shear * s.area * l * l) : 0.0;
  Element k;
  k << 12.0, 6.0 * l, -12.0, 6.0 * l,                               //
      6.0 * l, (4.0 + phi) * l * l, -6.0 * l, (2.0 - phi) * l * l,  //
      -12.0, -6.0 * l, 12.0, -6.0 * l,                              //
      6.0 * l, (2.0 - phi) * l * l, -6.0 * l, (4.0 + phi) * l * l;
  return beam.young * s.inertia / (l * l * l * (1.0 + phi)) * k;
}

Element massOf(const RoundBeam& beam, const Section& s, double l) {
  Element across, rotary;
  across << 156.0, 22.0 * l, 54.0, -13.0 * l,         //
      22.0 * l, 4.0 * l * l, 13.0 * l, -3.0 * l * l,  //
      54.0, 13.0 * l, 156.0, -22.0 * l,               //
      -13.0 * l, -3.0 * l * l, -22.0 * l, 4.0 * l * l;
  rotary << 36.0, 3.0 * l, -36.0, 3.0 * l,     //
      3.0 * l, 4.0 * l * l, -3.0 * l, -l * l,  //
      -36.0, -3.0 * l, 36.0, -3.0 * l,         //
      3.0 * l, -l * l, -3.0 * l, 4.0 * l * l;
  Element m = beam.density * s.area * l / 420.0 * across;
  if (beam.shear) m += beam.density * s.inertia / (30.0 * l) * rotary;
  return m;
}

/// Cubic shape functions of an element of length l [m] at the relative position u.
Eigen::Vector4d cubic(double u, double l) {
  return {1.0 - 3.0 * u * u + 2.0 * u * u * u, l * u * (1.0 - u) * (1.0 - u), u * u * (3.0 - 2.0 * u),
          l * u * u * (u - 1.0)};
}

}  // namespace

RoundBeam::Matrices RoundBeam::matrices() const {
  const double shank = length - fluted;
  // Element lengths as equal as the section boundary allows.
  int first = fluted <= 0.0 ? elements : static_cast<int>(std::lround(elements * shank / length));
  if (fluted > 0.0) first = shank > 0.0 ? std::clamp(first, 1, elements - 1) : 0;
  Matrices out;
  const Eigen::Index size = 2 * (elements + 1);
  out.stiffness = out.mass = Eigen::MatrixXd::Zero(size, size);
  out.x.push_back(0.0);
  for (int e = 0; e < elements; ++e) {
    const bool above = e < first;
    const double l = above ? shank / first : fluted / (elements - first);
    const Section section(above ? shank_diameter : diameter);
    out.stiffness.block<4, 4>(2 * e, 2 * e) += stiffnessOf(*this, section, l);
    out.mass.block<4, 4>(2 * e, 2 * e) += massOf(*this, section, l);
    out.x.push_back(out.x.back() + l);
  }
  return out;
}

CoupledTool::CoupledTool(const RoundBeam& beam, const std::vector<FaceMode>& spindle, const Joint& joint,
                         double tool_loss)
    : length_(beam.length) {
  const RoundBeam::Matrices tool = beam.matrices();
  x_ = tool.x;
  const Eigen::Index own = tool.mass.rows(), all = own + static_cast<Eigen::Index>(spindle.size());
  Eigen::MatrixXd bending = Eigen::MatrixXd::Zero(all, all), mass = bending, spring = bending;
  bending.topLeftCorner(own, own) = tool.stiffness;
  mass.topLeftCorner(own, own) = tool.mass;
  Eigen::VectorXd across = Eigen::VectorXd::Zero(all), tilting = across, dashpot = across;
  across[0] = tilting[1] = 1.0;
  stiffness_ = bending;
  for (std::size_t j = 0; j < spindle.size(); ++j) {
    const FaceMode& mode = spindle[j];
    const Eigen::Index at = own + static_cast<Eigen::Index>(j);
    const double w = units::TWO_PI * mode.frequency;
    stiffness_(at, at) = mode.stiffness;
    mass(at, at) = mode.stiffness / (w * w);
    dashpot[at] = 2.0 * mode.damping * mode.stiffness / w;  // [N s/m]
    across[at] = -1.0;
    tilting[at] = -mode.slope;
  }
  spring = joint.across * across * across.transpose() + joint.tilting * tilting * tilting.transpose();
  stiffness_ += spring;

  // M^-1/2 K M^-1/2.
  const linear::SymmetricEigensystem of_mass = linear::symmetricEigensystem(mass);
  const Eigen::MatrixXd root =
      of_mass.vectors * of_mass.values.cwiseSqrt().cwiseInverse().asDiagonal() * of_mass.vectors.transpose();
  const linear::SymmetricEigensystem modes = linear::symmetricEigensystem(root * stiffness_ * root);
  shapes_ = root * modes.vectors;
  const Eigen::VectorXd w = modes.values.cwiseMax(1.0).cwiseSqrt();
  frequency_ = w / units::TWO_PI;
  damping_.resize(all);
  for (Eigen::Index r = 0; r < all; ++r) {
    const Eigen::VectorXd shape = shapes_.col(r);
    const double loss = tool_loss * shape.dot(bending * shape) + joint.loss * shape.dot(spring * shape);
    const double viscous = shape.cwiseAbs2().dot(dashpot);
    damping_[r] = std::clamp(0.5 * (loss / (w[r] * w[r]) + viscous / w[r]), 1e-5, 0.9);
  }
}

Eigen::VectorXd CoupledTool::shapeAt(double height) const {
  const double x = std::clamp(length_ - height, 0.0, length_);
  std::size_t e = 0;
  while (e + 2 < x_.size() && x > x_[e + 1]) ++e;
  const double l = x_[e + 1] - x_[e];
  Eigen::VectorXd at = Eigen::VectorXd::Zero(shapes_.rows());
  at.segment<4>(2 * static_cast<Eigen::Index>(e)) = cubic((x - x_[e]) / l, l);
  return at;
}

ModalModel CoupledTool::between(double read, double struck, double highest) const {
  const Eigen::VectorXd at_read = shapeAt(read), at_struck = shapeAt(struck);
  ModalModel model;
  model.direct = at_read.dot(linear::solveSymmetric(stiffness_, at_struck));
  for (Eigen::Index r = 0; r < frequency_.size() && frequency_[r] < highest; ++r) {
    Mode mode;
    mode.frequency = frequency_[r];
    mode.damping_ratio = damping_[r];
    const double w = units::TWO_PI * frequency_[r];
    mode.gain = at_read.dot(shapes_.col(r)) * at_struck.dot(shapes_.col(r)) / (w * w);
    model.direct -= mode.gain;
    model.modes.push_back(mode);
  }
  return model;
}

namespace {

RoundBeam beamOf(const StationTraits& t, const ToolGeometry& tool, double stickout) {
  if (t.flute_length > stickout) {
    throw Error("hammer_flute_length: " + std::to_string(t.flute_length / units::MM) +
                " mm, expected at most the tool's stickout");
  }
  RoundBeam beam;
  beam.length = stickout;
  beam.fluted = t.flute_length;
  beam.shank_diameter = t.shank_diameter > 0.0 ? t.shank_diameter : tool.diameter;
  beam.diameter = t.flute_core * tool.diameter;
  beam.young = t.young;
  beam.density = t.density;
  return beam;
}

CoupledTool planeOf(const StationTraits& t, const ToolGeometry& tool, double stickout, double ratio) {
  std::vector<FaceMode> spindle;
  for (std::size_t j = 0; j < t.spindle_frequency.size(); ++j) {
    spindle.push_back({ratio * t.spindle_frequency[j], t.spindle_damping[j],
                       ratio * ratio * t.spindle_stiffness[j], t.spindle_slope[j]});
  }
  return {beamOf(t, tool, stickout),
          spindle,
          {t.joint_stiffness, t.joint_rotation, t.joint_damping},
          t.tool_damping};
}

}  // namespace

ToolStructure::ToolStructure(const StationTraits& traits, const ToolGeometry& tool, double stickout)
    : plane_{{planeOf(traits, tool, stickout, 1.0), planeOf(traits, tool, stickout, traits.plane_ratio)}},
      turn_(traits.plane_turn),
      highest_(traits.highest) {
}

ModalModel ToolStructure::between(std::size_t read_axis, double read, std::size_t struck_axis,
                                  double struck) const {
  ModalModel sum;
  for (std::size_t p = 0; p < 2; ++p) {
    // Direction cosines of this plane.
    const double angle = turn_ + (p == 0 ? 0.0 : 0.5 * units::PI);
    const std::array<double, 2> along{{std::cos(angle), std::sin(angle)}};
    const double share = along[read_axis] * along[struck_axis];
    if (std::abs(share) < NO_GAIN) continue;
    const ModalModel plane = plane_[p].between(read, struck, highest_);
    sum.direct += share * plane.direct;
    for (Mode mode : plane.modes) {
      mode.gain *= share;
      sum.modes.push_back(mode);
    }
  }
  std::sort(sum.modes.begin(), sum.modes.end(),
            [](const Mode& a, const Mode& b) { return a.frequency < b.frequency; });
  return sum;
}

ToolTip ToolStructure::tip() const {
  ToolTip tip;
  tip.x = between(0, 0.0, 0, 0.0);
  tip.y = between(1, 0.0, 1, 0.0);
  return tip;
}

}  // namespace smartmill::sim
