#include "smartmill_loadmeter/calibration/friction_law.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

std::string FrictionTerms::name() const {
  return std::string("Coulomb and viscous") + (stribeck ? ", Stribeck" : "") + (warmup ? ", warm-up" : "");
}

std::vector<FitParameter> frictionParameters(const FrictionTerms& terms, double slowest, double fastest,
                                             const FrictionLaw& start) {
  const double typical = std::max({std::abs(start.coulomb), std::abs(start.viscous) * fastest, 1e-3});
  const double far = 1e3 * typical;
  std::vector<FitParameter> list{{start.viscous, -far / fastest, far / fastest, typical / fastest},
                                 {start.coulomb, -far, far, typical}};
  if (terms.stribeck) {
    list.push_back({start.breakaway, -far, far, typical});
    // Outside the measured speeds the term is constant or zero.
    list.push_back({start.stribeck_speed, 0.3 * slowest, fastest, 0.5 * (slowest + fastest)});
  }
  if (terms.warmup) {
    list.push_back({start.cold_ratio, -0.9, 20.0, 0.3});
    list.push_back({start.warmup_time, 10.0, 20000.0, 600.0});
  }
  return list;
}

FrictionLaw frictionLaw(const FrictionTerms& terms, const double* values, double zero_below) {
  FrictionLaw law;
  law.zero_below = zero_below;
  law.viscous = *values++;
  law.coulomb = *values++;
  if (terms.stribeck) {
    law.breakaway = *values++;
    law.stribeck_speed = *values++;
  }
  if (terms.warmup) {
    law.cold_ratio = *values++;
    law.warmup_time = *values++;
  }
  return law;
}

namespace {

// Air cuts at or above the speed below which friction is zero.
struct FrictionFitter {
  std::vector<TimedAirCut> cuts;
  double gain, zero_below;
  FrictionFitOptions options;
  bool weighted;
  Friction linear;
  std::set<double> speeds, times;

  FrictionFitter(const std::vector<TimedAirCut>& air_cuts, double load_meter_gain, double below,
                 const FrictionFitOptions& fit)
      : gain(load_meter_gain), zero_below(below), options(fit) {
    std::vector<AirCut> plain;
    for (const TimedAirCut& a : air_cuts) {
      plain.push_back(a.cut);
      if (a.cut.speed < zero_below) continue;
      cuts.push_back(a);
      speeds.insert(a.cut.speed);
      times.insert(a.start_time);
    }
    linear = fitFriction(plain, gain, zero_below);
    weighted =
        std::all_of(cuts.begin(), cuts.end(), [](const TimedAirCut& a) { return a.cut.voltage_std > 0.0; });
  }

  bool canFit(const FrictionTerms& terms) const {
    return (cuts.size() > terms.unknowns() || terms.unknowns() == 2) &&
           (!terms.stribeck || speeds.size() >= 4) && (!terms.warmup || times.size() >= 4);
  }

  // Residual of a law at one air cut [N m].
  double residualOf(const TimedAirCut& a, const FrictionLaw& law) const {
    return a.cut.voltage / (gain * a.cut.speed) - law.torque(a.cut.speed, a.start_time);
  }

  // The exponentials cause local minima, hence several starting points.
  FitResult solve(const FrictionTerms& terms) const {
    const double slowest = *speeds.begin(), fastest = *speeds.rbegin();
    const auto residuals = [&](const std::vector<double>& value, double* out) {
      const FrictionLaw law = frictionLaw(terms, value.data(), zero_below);
      for (const TimedAirCut& a : cuts) {
        // Without weights all torques have the same weight, as in the thesis.
        *out++ = residualOf(a, law) / (weighted ? a.cut.voltage_std / (gain * a.cut.speed) : 1.0);
      }
    };
    FitResult best;
    for (const double share : options.starts.stribeck_shares) {
      for (const double constant : options.starts.warmup_times) {
        FrictionLaw start;
        start.viscous = linear.viscous;
        start.coulomb = linear.coulomb;
        start.zero_below = linear.zero_below;
        start.stribeck_speed = std::clamp(share * fastest, 0.3 * slowest, fastest);
        start.warmup_time = constant;
        const FitResult candidate =
            fitLeastSquares(residuals, cuts.size(), frictionParameters(terms, slowest, fastest, start));
        if (best.value.empty() || candidate.squares < best.squares) best = candidate;
        if (!terms.warmup) break;
      }
      if (!terms.stribeck) break;
    }
    return best;
  }

  FittedFriction fitTerms(const FrictionTerms& terms) const {
    const FitResult best = solve(terms);
    const std::size_t unknowns = terms.unknowns();
    FittedFriction f;
    f.terms = terms;
    f.law = frictionLaw(terms, best.value.data(), zero_below);
    const double count = static_cast<double>(cuts.size()), freedom = count - static_cast<double>(unknowns);
    const double scatter = freedom > 0.0 ? best.squares / freedom : 0.0;
    const double variance = weighted ? std::max(1.0, scatter) : scatter;
    for (std::size_t i = 0; i < unknowns; ++i)
      f.std_dev.push_back(std::sqrt(variance * best.covarianceOf(i, i)));
    f.value = best.value;
    for (const double c : best.covariance) f.covariance.push_back(variance * c);
    f.bic = bayesianInformationCriterion(best.squares, cuts.size(), unknowns, weighted);
    double squares = 0.0;
    for (const TimedAirCut& a : cuts) squares += std::pow(residualOf(a, f.law), 2) / count;
    f.rms = std::sqrt(squares);
    return f;
  }
};

}  // namespace

std::vector<FittedFriction> fitFrictionLaws(const std::vector<TimedAirCut>& air_cuts, double load_meter_gain,
                                            double zero_below, const FrictionFitOptions& options) {
  const FrictionFitter data(air_cuts, load_meter_gain, zero_below, options);
  std::vector<FittedFriction> found;
  for (const FrictionTerms terms :
       {FrictionTerms{}, FrictionTerms{true, false}, FrictionTerms{false, true}, FrictionTerms{true, true}}) {
    if (data.canFit(terms)) found.push_back(data.fitTerms(terms));
  }
  const auto key = [&](const FittedFriction& f) {
    return f.bic + options.strong_evidence * ((f.terms.stribeck ? 1 : 0) + (f.terms.warmup ? 1 : 0));
  };
  std::stable_sort(found.begin(), found.end(),
                   [&](const FittedFriction& a, const FittedFriction& b) { return key(a) < key(b); });
  return found;
}

}  // namespace smartmill::loadmeter
