#include "stability/tool_shop.h"

#include <array>
#include <cmath>

#include <Eigen/LU>

#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;
using units::PI;
using units::TWO_PI;

constexpr double LOW = 150.0, HIGH = 6000.0, STEP = 5.0;  // [Hz] lines of all FRFs
constexpr double STEEL = 210e9, STEEL_DENSITY = 7850.0, CARBIDE = 580e9, CARBIDE_DENSITY = 14400.0;
constexpr double NOISE = 0.007, CALIBRATION = 0.01;

std::vector<double> lines() {
  std::vector<double> f;
  for (double at = LOW; at <= HIGH; at += STEP) f.push_back(at);
  return f;
}

}  // namespace

void ShaftChain::addShaft(double length, double diameter, double young, double density, double loss,
                          int elements) {
  const double l = length / elements, area = 0.25 * PI * diameter * diameter,
               moment = PI * std::pow(diameter, 4) / 64.0, poisson = young > 400e9 ? 0.22 : 0.29;
  const double shear_factor = 6.0 * (1.0 + poisson) / (7.0 + 6.0 * poisson),
               shear = shear_factor * area * young / (2.0 * (1.0 + poisson));
  const double phi = 12.0 * young * moment / (shear * l * l),
               k = young * moment / (std::pow(l, 3) * (1.0 + phi));
  Eigen::Matrix4d stiffness, translation, rotation;
  stiffness << 12.0, 6.0 * l, -12.0, 6.0 * l, 6.0 * l, (4.0 + phi) * l * l, -6.0 * l, (2.0 - phi) * l * l,
      -12.0, -6.0 * l, 12.0, -6.0 * l, 6.0 * l, (2.0 - phi) * l * l, -6.0 * l, (4.0 + phi) * l * l;
  const double p2 = phi * phi;
  const double a = 13.0 / 35.0 + 0.7 * phi + p2 / 3.0, b = 9.0 / 70.0 + 0.3 * phi + p2 / 6.0,
               c = (11.0 / 210.0 + 11.0 / 120.0 * phi + p2 / 24.0) * l,
               d = (13.0 / 420.0 + 3.0 / 40.0 * phi + p2 / 24.0) * l,
               e = (1.0 / 105.0 + phi / 60.0 + p2 / 120.0) * l * l,
               g = (1.0 / 140.0 + phi / 60.0 + p2 / 120.0) * l * l;
  translation << a, c, b, -d, c, e, d, -g, b, d, a, -c, -d, -g, -c, e;
  const double ra = 1.2, rb = (0.1 - 0.5 * phi) * l, rc = (2.0 / 15.0 + phi / 6.0 + p2 / 3.0) * l * l,
               rd = (1.0 / 30.0 + phi / 6.0 - p2 / 6.0) * l * l;
  rotation << ra, rb, -ra, rb, rb, rc, -rb, -rd, -ra, -rb, ra, -rb, rb, -rd, -rb, rc;
  Link link;
  link.stiffness = Complex(1.0, loss) * k * stiffness.cast<Complex>();
  const double square = std::pow(1.0 + phi, 2);
  link.mass = density * area * l / square * translation + density * moment / (l * square) * rotation;
  for (int i = 0; i < elements; ++i) {
    links_.push_back(link);
    nodes_.emplace_back();
  }
}

void ShaftChain::addJoint(double stiffness, double tilting, double damping, double tilting_damping) {
  const auto pair = [](double across, double tilt) {
    Eigen::Matrix4d m = Eigen::Matrix4d::Zero();
    for (const int i : {0, 1}) {
      const double value = i == 0 ? across : tilt;
      m(i, i) = m(i + 2, i + 2) = value;
      m(i, i + 2) = m(i + 2, i) = -value;
    }
    return m;
  };
  Link link;
  link.stiffness = pair(stiffness, tilting).cast<Complex>();
  link.damping = pair(damping, tilting_damping);
  links_.push_back(link);
  nodes_.emplace_back();
}

void ShaftChain::addBearing(double stiffness, double loss, double housing_mass, double housing_stiffness) {
  nodes_.back() = {stiffness, loss, housing_mass, housing_stiffness};
}

/// Block elimination of the chain from both ends up to the force; then the motion is followed to the
/// response.
Complex ShaftChain::receptance(int response, int force, double f) const {
  const double w = TWO_PI * f;
  const auto count = nodes_.size();
  std::vector<Block> diagonal(count, Block::Zero()), next(count, Block::Zero());  // next: node i to i + 1
  for (std::size_t i = 0; i < count; ++i) {
    const Node& n = nodes_[i];
    if (n.bearing == 0.0) continue;
    const Complex bearing = n.bearing * Complex(1.0, n.loss),
                  housing = n.housing_stiffness * Complex(1.0, 0.06) - w * w * n.housing_mass;
    diagonal[i](0, 0) += bearing * housing / (bearing + housing);
  }
  for (std::size_t i = 0; i + 1 < count; ++i) {
    const Eigen::Matrix4cd dynamic = links_[i].stiffness - w * w * links_[i].mass.cast<Complex>() +
                                     Complex(0.0, w) * links_[i].damping.cast<Complex>();
    diagonal[i] += dynamic.topLeftCorner<2, 2>();
    diagonal[i + 1] += dynamic.bottomRightCorner<2, 2>();
    next[i] = dynamic.topRightCorner<2, 2>();
  }
  const auto at = static_cast<std::size_t>(force), to = static_cast<std::size_t>(response);
  std::vector<Block> reduced = diagonal;
  for (std::size_t i = count - 1; i > at; --i)
    reduced[i - 1] -= next[i - 1] * reduced[i].inverse() * next[i - 1].transpose();
  for (std::size_t i = 0; i < at; ++i) reduced[i + 1] -= next[i].transpose() * reduced[i].inverse() * next[i];
  Eigen::Vector2cd motion = reduced[at].inverse().col(0);
  for (std::size_t i = at; i < to; ++i)
    motion = (-reduced[i + 1].inverse() * next[i].transpose() * motion).eval();
  for (std::size_t i = at; i > to; --i) motion = (-reduced[i - 1].inverse() * next[i - 1] * motion).eval();
  return motion[0];
}

double ToolShop::around(double share) {
  return std::exp(share * std::normal_distribution<double>()(random_));
}

double ToolShop::between(double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random_);
}

FrequencyResponse ToolShop::measured(const FrequencyResponse& exact) {
  FrequencyResponse noisy = exact;
  std::normal_distribution<double> noise(0.0, NOISE / std::sqrt(2.0));
  const double calibration = around(0.3 * CALIBRATION);
  for (Complex& v : noisy.value) v *= calibration * Complex(1.0 + noise(random_), noise(random_));
  return noisy;
}

void ToolShop::appendSpindle(ShaftChain& chain) const {
  const Truth& t = truth_;
  chain.addShaft(0.02, 1.2 * t.shaft_diameter, STEEL, STEEL_DENSITY, t.loss, 2);  // flange
  chain.addShaft(t.overhang, t.shaft_diameter, STEEL, STEEL_DENSITY, t.loss, 6);
  chain.addBearing(t.front, 0.05, t.housing_mass, t.housing_stiffness);
  chain.addShaft(t.span, 0.9 * t.shaft_diameter, STEEL, STEEL_DENSITY, t.loss, 16);
  chain.addBearing(t.rear, 0.05, t.housing_mass, t.housing_stiffness);
  chain.addShaft(0.08, 0.7 * t.shaft_diameter, STEEL, STEEL_DENSITY, t.loss, 4);
}

ToolShop::ToolShop(std::uint64_t seed) : random_(seed) {
  Truth& t = truth_;
  t.shaft_diameter = between(0.055, 0.085);
  t.overhang = between(0.05, 0.09);
  t.span = between(0.22, 0.38);
  t.front = between(1.5e8, 5e8);
  t.rear = between(1e8, 3e8);
  t.housing_mass = between(20.0, 60.0);
  t.housing_stiffness = between(2e8, 8e8);
  t.loss = between(0.02, 0.06);
  t.holder_young = STEEL * around(0.02);
  const std::array<double, 5> shanks{{0.008, 0.010, 0.012, 0.016, 0.020}};
  t.shank = shanks[static_cast<std::size_t>(between(0.0, 4.999))];
  t.nose = t.shank + between(0.016, 0.024);
  t.nose_length = between(0.030, 0.050);
  t.base = between(0.042, 0.052);
  t.base_length = between(0.025, 0.045);
  const double size = t.shank / 0.012;
  // The order of magnitude that Erturk, Ozguven and Budak (Int. J. Mach. Tools Manuf. 46, 2006) use for
  // shanks of 16 .. 20 mm: 1e7 .. 1e8 N/m, 1e6 N m/rad.
  t.contact = 4e7 * size * around(0.5);
  t.tilting = 2e5 * size * size * size * around(0.5);
  t.contact_damping = 200.0 * size * around(0.5);
  t.tilting_damping = 1.0 * size * size * size * around(0.5);

  const BeamMaterial steel = beamMaterial("steel");
  shop_.gauge.segments = {{0.09, 0.04, 0.0, steel, {}}};
  shop_.gauge.second_point = 0.07;
  shop_.holder = {{t.nose_length, t.nose, t.shank, steel, beamMaterial("carbide")},
                  {t.base_length, t.base, 0.0, steel, {}}};
  ShaftChain gauge;
  gauge.addShaft(0.07, 0.04, STEEL, STEEL_DENSITY, 0.003, 7);
  const int second = gauge.last();
  gauge.addShaft(0.02, 0.04, STEEL, STEEL_DENSITY, 0.003, 2);
  appendSpindle(gauge);
  FrequencyResponse direct, cross, at_second;
  for (FrequencyResponse* frf : {&direct, &cross, &at_second}) {
    frf->unit = "m/N";
    frf->frequency = lines();
  }
  for (const double f : direct.frequency) {
    direct.value.push_back(gauge.receptance(0, 0, f));
    cross.value.push_back(gauge.receptance(0, second, f));
    at_second.value.push_back(gauge.receptance(second, second, f));
  }
  shop_.taps = {measured(direct), measured(cross), measured(at_second)};
  for (const double stickout : {4.5, 3.5, 6.0}) {
    const DrawnTool reference = build(stickout * t.shank, 2.0 * t.shank, 4);
    shop_.references.push_back({reference.tool, reference.tap});
  }
}

DrawnTool ToolShop::build(double stickout, double fluted, int teeth) {
  const Truth& t = truth_;
  DrawnTool drawn;
  drawn.tool = {"tool", stickout, t.shank, fluted, teeth, 0.5, 0.8, beamMaterial("carbide")};
  const double young = CARBIDE * around(0.02),
               ratio = 0.8 + 0.025 * std::normal_distribution<double>()(random_);
  ShaftChain chain;
  chain.addShaft(fluted, ratio * t.shank, young, CARBIDE_DENSITY, 0.003, 8);
  chain.addShaft(stickout - fluted, t.shank, young, CARBIDE_DENSITY, 0.003, 8);
  chain.addJoint(t.contact * around(0.15), t.tilting * around(0.15), t.contact_damping * around(0.15),
                 t.tilting_damping * around(0.15));
  // The shank in the nose of the holder: one bar with the bending stiffness and mass of both.
  const double inner = std::pow(t.shank / t.nose, 4),
               nose_young = t.holder_young * (1.0 - inner) + CARBIDE * inner;
  const double filled = std::pow(t.shank / t.nose, 2),
               nose_density = STEEL_DENSITY * (1.0 - filled) + CARBIDE_DENSITY * filled;
  chain.addShaft(t.nose_length, t.nose, nose_young, nose_density, 0.003, 6);
  chain.addShaft(t.base_length, t.base, t.holder_young, STEEL_DENSITY, 0.003, 5);
  appendSpindle(chain);
  drawn.tip.unit = "m/N";
  drawn.tip.frequency = lines();
  for (const double f : drawn.tip.frequency) drawn.tip.value.push_back(chain.receptance(0, 0, f));
  drawn.tap = measured(drawn.tip);
  return drawn;
}

DrawnTool ToolShop::drawTool() {
  const double d = truth_.shank, stickout = between(3.0, 7.0) * d;
  const double fluted = std::min(0.8 * stickout, between(1.5, 3.0) * d);
  return build(stickout, fluted, 2 + static_cast<int>(between(0.0, 2.999)));
}

}  // namespace smartmill::stability
