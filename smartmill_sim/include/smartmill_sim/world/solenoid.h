#pragma once

#include <random>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/world/station_traits.h"

namespace smartmill::sim {

/// One contact of a hammer: peak sin(pi u^(1 + skew)) over the relative contact time u; skew 0 is the half
/// sine of Dunwoody section 4.3.1.
struct Hit {
  double begin = 0.0;    ///< [s]
  double peak = 0.0;     ///< [N]
  double contact = 0.0;  ///< [s] > 0
  double skew = 0.0;     ///< [1] > -1

  double force(double time) const;  ///< [N]
  double end() const { return begin + contact; }
  bool over(double time) const { return time > end(); }
};

/// Solenoid of the hammer: the current rises from the command until the first contact and then decays; the
/// hammer falls back or bounces.
class Solenoid {
 public:
  /// @param force_scatter [1] standard deviation of the peak, relative to its nominal value
  Solenoid(const StationTraits& traits, const smartmill::HammerStation& station, double force_scatter);

  /// Fires the hammer. @param now [s] time of the command @param touch [s] time of the first contact
  void fire(double now, double touch, std::mt19937_64& random);
  /// Skips a time [s].
  void skipTime(double time);

  double force(double time) const;    ///< [N] of the hammer on its target
  double current(double time) const;  ///< [1] relative to its final value
  bool over(double time) const { return hits_.empty() || hits_.back().over(time); }

 private:
  StationTraits traits_;
  double peak_, contact_, force_scatter_;
  std::vector<Hit> hits_;
  double fired_ = 0.0;
};

}  // namespace smartmill::sim
