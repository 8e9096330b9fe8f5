#include "smartmill_core/cutting/force_curve.h"

#include <algorithm>
#include <cstddef>
#include <fstream>

#include "smartmill_core/error.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

constexpr const char* FORMAT = "smartmill-force-curve/1";

std::string inNewtonPerMillimetre(const std::vector<double>& values) {
  std::string list;
  for (const double v : values) list += (list.empty() ? "[" : ", ") + yamlNumber(v / units::N_PER_MM, 12);
  return list + "]";
}

ForceCurve curveOf(const StrictYaml& yaml, double top) {
  ForceCurve curve;
  curve.value = yaml.numbers("coefficients_n_per_mm", 0);
  if (curve.value.size() < 5) yaml.fail("coefficients_n_per_mm", "expected five numbers or more");
  if (!std::is_sorted(curve.value.begin(), curve.value.end()))
    yaml.fail("coefficients_n_per_mm", "expected numbers that do not decrease");
  const std::size_t breaks = curve.value.size() - 2;
  curve.std_dev = yaml.numbers("std_n_per_mm", breaks, Range::notNegative());
  yaml.finish();
  for (double& v : curve.value) v *= units::N_PER_MM;
  for (double& v : curve.std_dev) v *= units::N_PER_MM;
  for (std::size_t k = 0; k < breaks; ++k)
    curve.knots.push_back(top * static_cast<double>(k) / static_cast<double>(breaks - 1));
  return curve;
}

double sumOf(const std::array<double, 4>& splines, int first, const std::vector<double>& coefficients) {
  double sum = 0.0;
  for (std::size_t k = 0; k < 4; ++k) sum += splines[k] * coefficients[static_cast<std::size_t>(first) + k];
  return sum;
}

CubicSplines splinesAt(double chip, const std::vector<double>& knots) {
  return {chip, knots.back(), static_cast<int>(knots.size()) - 1};
}

}  // namespace

CubicSplines::CubicSplines(double x, double top, int pieces)
    : first(std::clamp(static_cast<int>(x / top * pieces), 0, pieces - 1)) {
  const auto knot = [&](int k) { return top * std::clamp(k - 3, 0, pieces) / pieces; };
  const double inside = std::clamp(x, 0.0, top);
  value[0] = 1.0;
  for (std::size_t degree = 1; degree <= 3; ++degree) {  // Cox and de Boor
    double saved = 0.0;
    for (std::size_t r = 0; r < degree; ++r) {
      const int at = first + 3 + static_cast<int>(r);
      const double right = knot(at + 1) - inside, left = inside - knot(at + 1 - static_cast<int>(degree));
      const double share = value[r] / (right + left);
      value[r] = saved + right * share;
      saved = left * share;
      if (degree < 3) continue;
      slope[r] -= 3.0 * share;
      slope[r + 1] += 3.0 * share;
    }
    value[degree] = saved;
  }
  for (std::size_t k = 0; k < 4; ++k) value[k] += slope[k] * (x - inside);
}

double CubicSplines::valueOf(const std::vector<double>& coefficients) const {
  return sumOf(value, first, coefficients);
}

double CubicSplines::slopeOf(const std::vector<double>& coefficients) const {
  return sumOf(slope, first, coefficients);
}

double ForceCurve::at(double chip) const {
  return chip > 0.0 ? splinesAt(chip, knots).valueOf(value) : 0.0;
}

double ForceCurve::slope(double chip) const {
  return splinesAt(chip, knots).slopeOf(value);
}

double ForceCurve::stdAt(double chip) const {
  const double place = std::clamp(chip / knots.back(), 0.0, 1.0) * static_cast<double>(knots.size() - 1);
  const auto k = std::min(static_cast<std::size_t>(place), knots.size() - 2);
  const double share = place - static_cast<double>(k);
  return (1.0 - share) * std_dev[k] + share * std_dev[k + 1];
}

void writeForceCurves(const ForceCurves& curves, const std::string& file) {
  std::ofstream out(file);
  out << "format: " << FORMAT
      << "\nthickest_chip_mm: " << yamlNumber(curves.tangential.knots.back() / units::MM, 12)
      << "\nrms_n: " << yamlNumber(curves.rms) << "\n";
  for (const auto& [name, curve] :
       {std::pair<const char*, const ForceCurve&>{"tangential", curves.tangential},
        std::pair<const char*, const ForceCurve&>{"radial", curves.radial}}) {
    out << name << ":\n  coefficients_n_per_mm: " << inNewtonPerMillimetre(curve.value)
        << "\n  std_n_per_mm: " << inNewtonPerMillimetre(curve.std_dev) << "\n";
  }
  out.close();
  if (!out) throw Error(file + ": cannot be written");
}

ForceCurves readForceCurves(const std::string& file) {
  const StrictYaml yaml = StrictYaml::fromFile(file);
  yaml.oneOf("format", {FORMAT});
  const double top = yaml.number("thickest_chip_mm", Range::positive()) * units::MM;
  ForceCurves curves;
  curves.rms = yaml.number("rms_n", Range::notNegative());
  curves.tangential = curveOf(yaml.map("tangential"), top);
  curves.radial = curveOf(yaml.map("radial"), top);
  yaml.finish();
  return curves;
}

}  // namespace smartmill
