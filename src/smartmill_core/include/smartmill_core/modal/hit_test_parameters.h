#pragma once

#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill {

/// Parameters that all hammer measurements share: how a hit is recorded, and where its FRF is fitted. Each
/// measurement has its own defaults.
struct HitTestParameters {
  double trigger_force = 10.0;
  double weak_force = 20.0;
  double second_hit_share = 0.1;
  double pre_trigger = 0.01;
  double record_length = 0.1;
  double rest_time = 0.1;
  double strike_timeout = 3.0;
  int max_bad_hits = 5;

  double frf_high = 5000.0;
  double fit_low = 100.0;
  double fit_high = 5000.0;
  int max_modes = 4;

  void declareHits(ParameterTable& table);
  void declareFit(ParameterTable& table);
  /// Conditions between the values. @throws Error naming key and value.
  void validateHitTest() const;
};

}  // namespace smartmill
