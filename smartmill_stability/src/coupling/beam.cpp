#include "smartmill_stability/coupling/beam.h"

#include <array>
#include <cmath>
#include <complex>
#include <map>

#include <Eigen/LU>

#include "smartmill_core/error.h"
#include "smartmill_core/range.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;
using units::PI;
using units::TWO_PI;

double area(double diameter) {
  return 0.25 * PI * diameter * diameter;
}
double secondMoment(double diameter) {
  return PI * std::pow(diameter, 4) / 64.0;
}

/// Section of a segment, with its core.
struct Section {
  Complex bending, shear;  // [N m2] E I, [N] k G A
  double mass, inertia;    // [kg/m] rho A, [kg m] rho I

  explicit Section(const BeamSegment& s) {
    const BeamMaterial& m = s.material;
    const double a = area(s.diameter) - area(s.bore), i = secondMoment(s.diameter) - secondMoment(s.bore);
    const double hollow = s.core.density > 0.0 ? 0.0 : std::pow(s.bore / s.diameter, 2);
    const double nu = m.poisson, square = std::pow(1.0 + hollow, 2);
    const double k = 6.0 * (1.0 + nu) * square / ((7.0 + 6.0 * nu) * square + (20.0 + 12.0 * nu) * hollow);
    const Complex young = m.young * Complex(1.0, m.loss);
    bending = young * i;
    shear = k * a * young / (2.0 * (1.0 + nu));
    mass = m.density * a;
    inertia = m.density * i;
    if (s.core.density > 0.0) {
      const Complex core = s.core.young * Complex(1.0, s.core.loss);
      bending += core * secondMoment(s.bore);
      shear += k * area(s.bore) * core / (2.0 * (1.0 + s.core.poisson));
      mass += s.core.density * area(s.bore);
      inertia += s.core.density * secondMoment(s.bore);
    }
  }
};

}  // namespace

BeamMaterial beamMaterial(const std::string& name) {
  static const std::map<std::string, BeamMaterial> MATERIALS = {{"steel", {210e9, 7850.0, 0.29, 0.003}},
                                                                {"hss", {215e9, 8100.0, 0.29, 0.003}},
                                                                {"carbide", {580e9, 14400.0, 0.22, 0.003}}};
  const auto found = MATERIALS.find(name);
  if (found == MATERIALS.end()) throw Error("material " + name + ": expected steel, hss or carbide");
  return found->second;
}

void BeamSegment::validate() const {
  require("segment length [m]", length, Range::positive());
  require("segment diameter [m]", diameter, Range::positive());
  require("segment bore [m]", bore, Range::openHigh(0.0, diameter));
  for (const BeamMaterial* m : {&material, &core}) {
    if (m == &core && core.density == 0.0) continue;
    require("Young's modulus [N/m2]", m->young, Range::positive());
    require("density [kg/m3]", m->density, Range::positive());
    require("Poisson's ratio", m->poisson, Range::openHigh(0.0, 0.5));
    require("loss factor", m->loss, Range::notNegative());
  }
}

/// Shear force k G A (w' - psi), moment E I psi'; balance of forces k G A (w'' - psi') = -rho A w^2 w, of
/// moments E I psi'' + k G A (w' - psi) = -rho I w^2 psi. Waves exp(s x) with psi = slope exp(s x).
EndReceptances beamReceptances(const BeamSegment& segment, double f) {
  const Section section(segment);
  const double w2 = std::pow(TWO_PI * f, 2), length = segment.length;
  const Complex a = section.bending, b = w2 * (section.inertia + a * section.mass / section.shear),
                c = w2 * section.mass * (w2 * section.inertia / section.shear - 1.0);
  const Complex root = std::sqrt(b * b - 4.0 * a * c);
  const std::array<Complex, 2> squares{{(-b + root) / (2.0 * a), (-b - root) / (2.0 * a)}};
  Eigen::Matrix4cd motion, load;  // rows: w, psi at end 1, at end 2; force, moment at end 1, at end 2
  int column = 0;
  for (const Complex& square : squares) {
    Complex rate = std::sqrt(square);
    if (rate.real() < 0.0) rate = -rate;
    for (const double sign : {1.0, -1.0}) {
      const Complex s = sign * rate, slope = (square + w2 * section.mass / section.shear) / s;
      // Each wave is 1 at the end where it is largest.
      const Complex at1 = sign > 0.0 ? std::exp(-rate * length) : 1.0,
                    at2 = sign > 0.0 ? 1.0 : std::exp(-rate * length);
      const Complex force = section.shear * (s - slope), moment = section.bending * s * slope;
      motion.col(column) << at1, slope * at1, at2, slope * at2;
      load.col(column) << -force * at1, -moment * at1, force * at2, moment * at2;
      ++column;
    }
  }
  const Eigen::Matrix4cd all = motion * load.inverse();
  return {all.topLeftCorner<2, 2>(), all.topRightCorner<2, 2>(), all.bottomLeftCorner<2, 2>(),
          all.bottomRightCorner<2, 2>()};
}

EndReceptances beamReceptances(const std::vector<BeamSegment>& segments, double f) {
  if (segments.empty()) throw Error("beam: expected at least one segment");
  EndReceptances all = beamReceptances(segments.front(), f);
  for (std::size_t i = 1; i < segments.size(); ++i)
    all = joined(all, beamReceptances(segments[i], f), Receptance::Zero());
  return all;
}

EndReceptances joined(const EndReceptances& tip, const EndReceptances& back, const Receptance& compliance) {
  const Receptance joint = (tip.r22 + back.r11 + compliance).inverse();
  return {tip.r11 - tip.r12 * joint * tip.r21, tip.r12 * joint * back.r12, back.r21 * joint * tip.r21,
          back.r22 - back.r21 * joint * back.r12};
}

Receptance joined(const EndReceptances& tip, const Receptance& back, const Receptance& compliance) {
  return tip.r11 - tip.r12 * (tip.r22 + back + compliance).inverse() * tip.r21;
}

}  // namespace smartmill::stability
