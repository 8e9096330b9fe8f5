#include "smartmill_loadmeter/database/oblique.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/fit.h"

namespace smartmill::loadmeter {

namespace {

using units::radFromDeg;

constexpr double MODEL_ERROR = 0.03;  // [1] of a coefficient: thin shear zone, Stabler's rule

void checkEdge(double rake, double inclination) {
  if (std::abs(rake) < radFromDeg(60.0) && inclination >= 0.0 && inclination < radFromDeg(80.0)) return;
  throw Error(
      formatted("oblique edge: rake %.1f deg (-60 < rake < 60), inclination %.1f deg (0 <= inclination < 80)",
                units::degFromRad(rake), units::degFromRad(inclination)));
}

struct PriorValue {
  double value, std_dev;
};
const std::array<PriorValue, 4> PRIORS{PriorValue{radFromDeg(25.0), radFromDeg(15.0)}, PriorValue{0.3, 0.3},
                                       PriorValue{radFromDeg(45.0), radFromDeg(6.0)}, PriorValue{0.75, 0.25}};

struct WeightedMean {
  double weight = 0.0, sum = 0.0;
  void add(double value, double std_dev, double per) {
    if (!std::isfinite(value) || per == 0.0) return;
    const double s = std::hypot(std::isfinite(std_dev) ? std_dev : 0.1 * value, MODEL_ERROR * value) + 1e-9;
    weight += per * per / (s * s);
    sum += per * value / (s * s);
  }
  double value() const { return weight > 0.0 ? sum / weight : NOT_IDENTIFIED.ktc; }
  double stdDev() const { return weight > 0.0 ? 1.0 / std::sqrt(weight) : NOT_IDENTIFIED.ktc; }
};

}  // namespace

CuttingCoefficients obliqueCoefficients(const ShearZone& zone, double rake, double inclination) {
  const double t = std::tan(inclination),
               normal = std::atan(std::tan(zone.friction_angle) * std::cos(inclination));
  const double s = std::sin(normal), d = std::cos(zone.shear_angle + normal - rake);
  const double root = std::sqrt(d * d + t * t * s * s);
  const double stress = zone.shear_stress / std::sin(zone.shear_angle) / root;
  CuttingCoefficients k;
  k.ktc = stress * (std::cos(normal - rake) + t * t * s);
  k.krc = stress / std::cos(inclination) * std::sin(normal - rake);
  k.kac = stress * t * (std::cos(normal - rake) - s);
  return k;
}

ShearZone OrthogonalParameters::at(double rake) const {
  ShearZone zone;
  zone.shear_stress = value[0];
  zone.friction_angle = value[1] + value[2] * rake;
  zone.shear_angle = value[3] + value[4] * (rake - zone.friction_angle);
  return zone;
}

OrthogonalParameters semiInverse(const std::vector<ObliqueSet>& sets) {
  OrthogonalParameters found;
  std::size_t observations = 0;
  double largest = 0.0;
  WeightedMean kte, kre, kae;
  for (const ObliqueSet& set : sets) {
    checkEdge(set.rake, set.inclination);
    for (std::size_t i = 0; i < 3; ++i)
      observations += std::isfinite(set.value.*cuttingKeys()[i].coefficient);
    if (std::isfinite(set.value.ktc)) largest = std::max(largest, set.value.ktc);
    kte.add(set.value.kte, set.std_dev.kte, 1.0);
    kre.add(set.value.kre, set.std_dev.kre, 1.0);
    kae.add(set.value.kae, set.std_dev.kae, std::sin(set.inclination));
  }
  if (!(largest > 0.0)) throw Error("orthogonal parameters: expected a set with Ktc and a known rake");
  found.sets = static_cast<int>(sets.size());
  found.kte = kte.value(), found.kte_std = kte.stdDev();
  found.kre = kre.value(), found.kre_std = kre.stdDev();
  found.kae = kae.value(), found.kae_std = kae.stdDev();

  const auto parametersOf = [](const std::vector<double>& v) {
    OrthogonalParameters p;
    std::copy(v.begin(), v.end(), p.value.begin());
    return p;
  };
  const auto residuals = [&](const std::vector<double>& v, double* out) {
    const OrthogonalParameters p = parametersOf(v);
    for (const ObliqueSet& set : sets) {
      ShearZone zone = p.at(set.rake);
      // Keeps the angle within the model; the priors pull it back.
      zone.shear_angle = std::clamp(zone.shear_angle, radFromDeg(3.0), radFromDeg(80.0));
      const CuttingCoefficients k = obliqueCoefficients(zone, set.rake, set.inclination);
      for (std::size_t i = 0; i < 3; ++i) {
        const auto member = cuttingKeys()[i].coefficient;
        const double measured = set.value.*member, s = set.std_dev.*member;
        if (!std::isfinite(measured)) continue;
        const double sigma =
            std::hypot(std::isfinite(s) ? s : 0.0, MODEL_ERROR * std::abs(measured)) + 1e-4 * largest;
        *out++ = (k.*member - measured) / sigma;
      }
    }
    for (std::size_t i = 0; i < PRIORS.size(); ++i) *out++ = (v[i + 1] - PRIORS[i].value) / PRIORS[i].std_dev;
  };
  FitResult best;
  for (const double friction : {15.0, 25.0, 40.0}) {
    const std::vector<FitParameter> start{{0.3 * largest, 1e-3 * largest, 3.0 * largest, 0.3 * largest},
                                          {radFromDeg(friction), radFromDeg(1.0), radFromDeg(70.0), 0.1},
                                          {0.3, -1.5, 2.0, 0.3},
                                          {radFromDeg(45.0), radFromDeg(15.0), radFromDeg(75.0), 0.1},
                                          {0.75, -0.5, 2.0, 0.25}};
    const FitResult candidate = fitLeastSquares(residuals, observations + PRIORS.size(), start);
    if (best.value.empty() || candidate.squares < best.squares) best = candidate;
  }
  std::copy(best.value.begin(), best.value.end(), found.value.begin());
  std::copy(best.covariance.begin(), best.covariance.end(), found.covariance.begin());
  return found;
}

CoefficientSet predict(const OrthogonalParameters& parameters, double rake, double inclination) {
  checkEdge(rake, inclination);
  CoefficientSet set;
  set.source = "orthogonal";
  set.tests = parameters.sets;
  set.value = obliqueCoefficients(parameters.at(rake), rake, inclination);
  constexpr std::size_t N = OrthogonalParameters::COUNT;
  std::array<CuttingCoefficients, N> slope;
  for (std::size_t p = 0; p < N; ++p) {
    OrthogonalParameters above = parameters, below = parameters;
    const double step = 1e-5 * std::max(std::abs(parameters.value[p]), 0.1);
    above.value[p] += step;
    below.value[p] -= step;
    const CuttingCoefficients a = obliqueCoefficients(above.at(rake), rake, inclination);
    const CuttingCoefficients b = obliqueCoefficients(below.at(rake), rake, inclination);
    for (std::size_t i = 0; i < 3; ++i) {
      const auto member = cuttingKeys()[i].coefficient;
      slope[p].*member = (a.*member - b.*member) / (2.0 * step);
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    const auto member = cuttingKeys()[i].coefficient;
    double variance = std::pow(MODEL_ERROR * set.value.*member, 2);
    for (std::size_t p = 0; p < N; ++p) {
      for (std::size_t q = 0; q < N; ++q) {
        variance += slope[p].*member * parameters.covariance[p * N + q] * slope[q].*member;
      }
    }
    set.std_dev.*member = std::sqrt(variance);
  }
  set.value.kte = parameters.kte, set.std_dev.kte = parameters.kte_std;
  set.value.kre = parameters.kre, set.std_dev.kre = parameters.kre_std;
  set.value.kae = parameters.kae * std::sin(inclination);
  set.std_dev.kae = parameters.kae_std * std::sin(inclination);
  return set;
}

}  // namespace smartmill::loadmeter
