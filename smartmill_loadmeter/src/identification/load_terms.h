#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "load_record.h"
#include "smartmill_loadmeter/calibration/friction_law.h"

namespace smartmill::loadmeter {

/// Unknowns of a fit in addition to viscous and Coulomb friction, Ktc and Kte.
struct LoadTerms {
  bool stribeck = false, warmup = false;  ///< of the friction
  bool growth = false, runout = false, lag = false;

  FrictionTerms friction() const { return {stribeck, warmup}; }
  std::size_t count() const;
  std::size_t ktcIndex() const { return friction().unknowns(); }
};

/// Contents of the tests, which decide the observable terms.
struct LoadPlan {
  std::size_t cuts = 0, air_cuts = 0, air_speeds = 0, edge_ages = 0;
  double slowest = 0.0, fastest = 0.0;  ///< [rad/s]
  bool has_angle = false;               ///< of the spindle, in a cut with several teeth
  bool has_teeth = false;               ///< a cut with several teeth
  bool is_timed = false;                ///< every record has its start time
  bool has_transients = false;          ///< the records are samples, not means

  /// @throws Error with fewer than two speeds of air cuts or `least_feeds` feeds. @param where prefix of the
  /// message
  LoadPlan(const std::vector<LoadRecord>& records, double friction_zero_below, bool timed, bool transients,
           std::size_t least_feeds, const std::string& where);
};

/// A term that evidence may add.
struct FurtherTerm {
  const char* name = "";  ///< for messages
  bool LoadTerms::*flag = nullptr;
  bool (*isObservable)(const LoadPlan& plan) = nullptr;
  bool linearised = false;  ///< the records are condensed again about its estimate
};
const std::vector<FurtherTerm>& furtherTerms();

}  // namespace smartmill::loadmeter
