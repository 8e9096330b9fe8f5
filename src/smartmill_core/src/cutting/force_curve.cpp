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

}  // namespace

std::array<double, 4> cubicSplines(double x, double top, int pieces, int& first,
                                   std::array<double, 4>* slopes) {
  const auto knot = [&](int k) { return top * std::clamp(k - 3, 0, pieces) / pieces; };
  first = std::clamp(static_cast<int>(x / top * pieces), 0, pieces - 1);
  std::array<double, 4> b{1.0, 0.0, 0.0, 0.0};
  if (slopes != nullptr) *slopes = {};
  for (int degree = 1; degree <= 3; ++degree) {  // Cox and de Boor
    double saved = 0.0;
    for (int r = 0; r < degree; ++r) {
      const double right = knot(first + 3 + r + 1) - x, left = x - knot(first + 3 + 1 - degree + r);
      const double share = b[static_cast<std::size_t>(r)] / (right + left);
      b[static_cast<std::size_t>(r)] = saved + right * share;
      saved = left * share;
      if (slopes == nullptr || degree < 3) continue;
      (*slopes)[static_cast<std::size_t>(r)] -= 3.0 * share;
      (*slopes)[static_cast<std::size_t>(r) + 1] += 3.0 * share;
    }
    b[static_cast<std::size_t>(degree)] = saved;
  }
  return b;
}

double ForceCurve::at(double chip) const {
  if (!(chip > 0.0)) return 0.0;
  const double top = knots.back();
  if (chip > top) return at(top) + slope(top) * (chip - top);
  int first = 0;
  const auto b = cubicSplines(chip, top, static_cast<int>(knots.size()) - 1, first);
  double sum = 0.0;
  for (std::size_t k = 0; k < 4; ++k) sum += b[k] * value[static_cast<std::size_t>(first) + k];
  return sum;
}

double ForceCurve::slope(double chip) const {
  int first = 0;
  std::array<double, 4> slopes{};
  cubicSplines(std::clamp(chip, 0.0, knots.back()), knots.back(), static_cast<int>(knots.size()) - 1, first,
               &slopes);
  double sum = 0.0;
  for (std::size_t k = 0; k < 4; ++k) sum += slopes[k] * value[static_cast<std::size_t>(first) + k];
  return sum;
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
