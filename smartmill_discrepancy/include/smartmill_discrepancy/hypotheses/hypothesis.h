#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_discrepancy/hypotheses/coordinate.h"

namespace smartmill::discrepancy {

/// One way in which an effect of the catalogue may be present, e.g. gain_error of fx.
struct Hypothesis {
  /// Points from which the effect is tried: with amplitudes a_k the effect stands at null + sum a_k
  /// (points[k] - null).
  struct Probe {
    std::vector<double> null;                 ///< the effect does nothing here
    std::vector<std::vector<double>> points;  ///< each shows one direction
    bool from_points = false;                 ///< a fit starts at points[0] as it is
  };

  std::string effect;
  std::string variant;  ///< channel or axis, empty without one
  std::string after;    ///< variant that must have been found before this one is tried, empty: none
  std::vector<Coordinate> coordinates;
  std::vector<Probe> probes;
  std::function<EffectEntry(const std::vector<double>&)> entry;

  std::string title() const { return variant.empty() ? effect : effect + " (" + variant + ")"; }
};

/// All hypotheses that a campaign can speak of; the rest is named in notes with its reason.
std::vector<Hypothesis> catalogueHypotheses(const Dataset& data, std::vector<std::string>* notes);

/// Numbers of an entry with the names a report uses: offset_um; pitch_deg[0]; x[0].frequency_hz.
std::vector<std::pair<std::string, double>> numbersOf(const EffectEntry& entry);

}  // namespace smartmill::discrepancy
