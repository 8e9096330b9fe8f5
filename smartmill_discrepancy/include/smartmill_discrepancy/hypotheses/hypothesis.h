#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// A number of the model that a fit may move.
struct Coordinate {
  std::string name;
  double null = 0.0;  ///< value that changes nothing (nominal: 0; prior mean)
  double low = 0.0, high = 0.0;
  double step = 0.0;       ///< of numeric tangents
  double prior_std = 0.0;  ///< Gaussian prior about null
};

/// Values of the nominal model, free within their stated uncertainty: each coordinate is the natural
/// logarithm of value over nominal value.
class NominalFreedom {
 public:
  explicit NominalFreedom(const MachineModel& nominal);
  const std::vector<Coordinate>& coordinates() const { return coordinates_; }
  /// The model with these values. values.size() == coordinates().size()
  MachineModel apply(const MachineModel& nominal, const std::vector<double>& values) const;
  /// Writes the standard deviations that the file format has a place for (cutting coefficients).
  void writeStdDevs(MachineModel& model, const std::vector<double>& std_devs) const;

 private:
  std::vector<Coordinate> coordinates_;
  std::vector<std::function<void(MachineModel&, double)>> set_;
};

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
