#include "smartmill_loadmeter/calibration/friction_law.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

namespace {

constexpr double STRONG_EVIDENCE = 6.0;  // of the information criterion

}  // namespace

std::string FrictionShape::name() const {
  return std::string("Coulomb and viscous") + (stribeck ? ", Stribeck" : "") + (warmup ? ", warm-up" : "");
}

double FrictionLaw::torque(double speed, double start_time) const {
  if (speed < zero_below) return 0.0;
  const double ratio = speed / stribeck_speed;
  return (viscous * speed + coulomb + breakaway * std::exp(-ratio * ratio)) *
         (1.0 + cold_ratio * std::exp(-start_time / warmup_time));
}

std::vector<FitParameter> FrictionLaw::parameters(const FrictionShape& shape, double slowest, double fastest,
                                                  const FrictionLaw& start) {
  const double typical = std::max({std::abs(start.coulomb), std::abs(start.viscous) * fastest, 1e-3});
  const double far = 1e3 * typical;
  std::vector<FitParameter> list{{start.viscous, -far / fastest, far / fastest, typical / fastest},
                                 {start.coulomb, -far, far, typical}};
  if (shape.stribeck) {
    list.push_back({start.breakaway, -far, far, typical});
    // Outside of the tried speeds the term is a constant or absent.
    list.push_back({start.stribeck_speed, 0.3 * slowest, fastest, 0.5 * (slowest + fastest)});
  }
  if (shape.warmup) {
    list.push_back({start.cold_ratio, -0.9, 20.0, 0.3});
    list.push_back({start.warmup_time, 10.0, 20000.0, 600.0});
  }
  return list;
}

FrictionLaw FrictionLaw::fromValues(const FrictionShape& shape, const double* values, double zero_below) {
  FrictionLaw law;
  law.zero_below = zero_below;
  law.viscous = *values++;
  law.coulomb = *values++;
  if (shape.stribeck) {
    law.breakaway = *values++;
    law.stribeck_speed = *values++;
  }
  if (shape.warmup) {
    law.cold_ratio = *values++;
    law.warmup_time = *values++;
  }
  return law;
}

namespace {

// Air cuts at or above the speed below which friction counts as zero.
struct FrictionData {
  std::vector<TimedAirCut> cuts;
  double gain, zero_below;
  bool weighted;
  Friction linear;
  std::set<double> speeds, times;

  FrictionData(const std::vector<TimedAirCut>& air_cuts, double load_meter_gain, double below)
      : gain(load_meter_gain), zero_below(below) {
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

  bool carries(const FrictionShape& shape) const {
    return (cuts.size() > shape.unknowns() || shape.unknowns() == 2) &&
           (!shape.stribeck || speeds.size() >= 4) && (!shape.warmup || times.size() >= 4);
  }

  // [N m] of a law against one air cut.
  double rest(const TimedAirCut& a, const FrictionLaw& law) const {
    return a.cut.voltage / (gain * a.cut.speed) - law.torque(a.cut.speed, a.start_time);
  }

  // The exponentials have several hollows: started in each.
  FitResult solve(const FrictionShape& shape) const {
    const double slowest = *speeds.begin(), fastest = *speeds.rbegin();
    const auto residuals = [&](const std::vector<double>& value, double* out) {
      const FrictionLaw law = FrictionLaw::fromValues(shape, value.data(), zero_below);
      for (const TimedAirCut& a : cuts) {
        // Unweighted: torques count alike, as in the thesis.
        *out++ = rest(a, law) / (weighted ? a.cut.voltage_std / (gain * a.cut.speed) : 1.0);
      }
    };
    FitResult best;
    for (const double share : {0.15, 0.4}) {
      for (const double constant : {150.0, 600.0, 2400.0}) {
        FrictionLaw start;
        start.viscous = linear.viscous;
        start.coulomb = linear.coulomb;
        start.stribeck_speed = std::clamp(share * fastest, 0.3 * slowest, fastest);
        start.warmup_time = constant;
        const FitResult tried =
            fit(residuals, cuts.size(), FrictionLaw::parameters(shape, slowest, fastest, start));
        if (best.value.empty() || tried.squares < best.squares) best = tried;
        if (!shape.warmup) break;
      }
      if (!shape.stribeck) break;
    }
    return best;
  }

  FittedFriction fitted(const FrictionShape& shape) const {
    const FitResult best = solve(shape);
    const std::size_t unknowns = shape.unknowns();
    FittedFriction f;
    f.shape = shape;
    f.law = FrictionLaw::fromValues(shape, best.value.data(), zero_below);
    const double count = static_cast<double>(cuts.size()), freedom = count - static_cast<double>(unknowns);
    const double scatter = freedom > 0.0 ? best.squares / freedom : 0.0;
    const double variance = weighted ? std::max(1.0, scatter) : scatter;
    for (std::size_t i = 0; i < unknowns; ++i)
      f.std_dev.push_back(std::sqrt(variance * best.covarianceOf(i, i)));
    f.value = best.value;
    for (const double c : best.covariance) f.covariance.push_back(variance * c);
    f.bic = informationCriterion(best.squares, cuts.size(), unknowns, weighted);
    double rest2 = 0.0;
    for (const TimedAirCut& a : cuts) rest2 += std::pow(rest(a, f.law), 2) / count;
    f.rms = std::sqrt(rest2);
    return f;
  }
};

}  // namespace

std::vector<FittedFriction> fitFrictionLaws(const std::vector<TimedAirCut>& air_cuts, double load_meter_gain,
                                            double zero_below) {
  const FrictionData data(air_cuts, load_meter_gain, zero_below);
  std::vector<FittedFriction> found;
  for (const FrictionShape shape :
       {FrictionShape{}, FrictionShape{true, false}, FrictionShape{false, true}, FrictionShape{true, true}}) {
    if (data.carries(shape)) found.push_back(data.fitted(shape));
  }
  // A term whose place is searched for pays off by chance more often than the criterion allows for.
  const auto key = [](const FittedFriction& f) {
    return f.bic + STRONG_EVIDENCE * ((f.shape.stribeck ? 1 : 0) + (f.shape.warmup ? 1 : 0));
  };
  std::stable_sort(found.begin(), found.end(),
                   [&](const FittedFriction& a, const FittedFriction& b) { return key(a) < key(b); });
  return found;
}

}  // namespace smartmill::loadmeter
