#include "smartmill_sim/world/solenoid.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::sim {

double Hit::force(double time) const {
  const double u = (time - begin) / contact;
  if (u <= 0.0 || u >= 1.0) return 0.0;
  return peak * std::sin(units::PI * (skew == 0.0 ? u : std::pow(u, 1.0 + skew)));
}

Solenoid::Solenoid(const StationTraits& traits, const smartmill::HammerStation& station, double force_scatter)
    : traits_(traits),
      peak_(station.peak_force),
      contact_(station.contact_time),
      force_scatter_(force_scatter) {
}

void Solenoid::fire(double now, double touch, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const auto about = [&](double scatter) { return std::clamp(1.0 + scatter * normal(random), 0.5, 1.5); };
  Hit first;
  first.begin = touch;
  first.peak = peak_ * about(force_scatter_);
  first.contact = contact_ * about(traits_.contact_scatter);
  first.skew = std::clamp(traits_.pulse_skew + traits_.pulse_scatter * normal(random), -0.6, 0.6);
  hits_ = {first};
  fired_ = now;
  if (std::uniform_real_distribution<double>(0.0, 1.0)(random) >= traits_.bounce_chance) return;
  Hit second = first;
  second.begin = first.end() + traits_.bounce_delay * about(0.2);
  second.peak = first.peak * traits_.bounce_share * about(0.2);
  hits_.push_back(second);
}

void Solenoid::skipTime(double time) {
  fired_ += time;
  for (Hit& hit : hits_) hit.begin += time;
}

double Solenoid::force(double time) const {
  double sum = 0.0;
  for (const Hit& hit : hits_) sum += hit.force(time);
  return sum;
}

double Solenoid::current(double time) const {
  if (hits_.empty() || time <= fired_) return 0.0;
  const auto risen = [&](double until) { return -std::expm1(-(until - fired_) / traits_.coil_time); };
  const double touch = hits_.front().begin;
  return time <= touch ? risen(time) : risen(touch) * std::exp(-(time - touch) / traits_.coil_time);
}

}  // namespace smartmill::sim
