#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill {

/// A number of a model that a fit may move.
struct Coordinate {
  std::string name;
  double null = 0.0;             ///< value without any effect (prior mean; nominal values: 0)
  double low = 0.0, high = 0.0;  ///< bounds of a fit
  double step = 0.0;             ///< of numeric tangents
  double prior_std = 0.0;        ///< Gaussian prior around null
};

/// Bounds and prior of one coordinate.
struct FitRange {
  double low = 0.0, high = 0.0;
  double step = 0.0;       ///< of numeric tangents
  double prior_std = 0.0;  ///< Gaussian prior around the coordinate's null
};

/// Coordinates in which an effect is well behaved, and the keys of an entry that they determine. write() and
/// read() are inverse to each other inside the coordinates' bounds.
struct EffectCoordinates {
  std::vector<Coordinate> coordinates;
  std::function<void(const double* values, EffectEntry& entry)> write;
  std::function<void(const EffectEntry& entry, double* values)> read;
};

/// A key itself.
EffectCoordinates amplitude(const std::string& key, const FitRange& range, double null = 0.0);

/// ln(key / of): a factor in the same coordinate as the nominal values that it resembles.
EffectCoordinates logarithm(const std::string& key, const FitRange& range, double of = 1.0,
                            double null = 0.0);

/// ln(1 + key).
EffectCoordinates logarithmOfOnePlus(const std::string& key, const FitRange& range);

/// A vector in the plane: size and direction [deg] in the file, Cartesian in the fit, which avoids the pole
/// at zero.
EffectCoordinates planar(const std::string& size_key, const std::string& angle_key, double limit, double step,
                         double prior_std);

/// A size on x and its ratio to that on y. The fit moves both sizes, because the ratio is undefined without
/// x.
EffectCoordinates sizes(const std::string& key, const std::string& y_ratio_key, const FitRange& range);

/// The power law (x / reference)^-exponent. The fit moves the exponent and the level at a middle x, which
/// stays well determined where the exponent is small.
/// @param low, high of the reference
EffectCoordinates powerLaw(const std::string& exponent_key, const std::string& reference_key, double middle,
                           double low, double high);

/// A size that is approached by 1 - exp(-t / constant). The fit moves the size reached at a time t > 0 and
/// the share of the final size that follows later. Both stay determined where the constant is not: for a
/// constant far below t the share is 0.
/// @param time [s] at which the effect is observed first; earlier times need larger powers of the share
EffectCoordinates saturating(const std::string& size_key, const std::string& constant_key, double time,
                             const FitRange& range);

/// A list of pitches [deg], one per tooth: differences from the tool's; the last one follows from the sum.
EffectCoordinates pitches(const std::string& key, const ToolGeometry& tool, const FitRange& range);

/// A list with mean zero, one value per tooth, of which only differences act: orthonormal contrasts
/// (Helmert).
EffectCoordinates contrasts(const std::string& key, int teeth, const FitRange& range);

/// One mode of the tool tip along x or y: logarithms of frequency and damping ratio, compliance [um/kN].
EffectCoordinates tipMode(char axis);

/// One form in which an effect may be present: as a whole, in one channel, along one axis.
struct EffectForm {
  using Values = std::vector<double>;

  /// A starting point of the search: with amplitudes a_k the coordinates are null + sum a_k (points[k] -
  /// null).
  struct Probe {
    Values null;                 ///< without any effect
    std::vector<Values> points;  ///< one per direction
    bool from_points = false;    ///< a fit starts at points[0] without a line search
  };

  /// How the search finds probes that are not known beforehand: from the residual, as a mode of the sensor, a
  /// mode of the tool tip, a line at a spindle order, a line at an order without a fixed phase.
  enum class SearchStrategy { none, sensor_mode, tip_mode, spindle_order, free_order };

  EffectForm() = default;
  explicit EffectForm(std::vector<EffectCoordinates> terms);

  // Builders, to be chained.
  EffectForm& named(const std::string& variant);                       ///< channel or axis
  EffectForm& onlyAfter(const std::string& variant);                   ///< which must have been found before
  EffectForm& word(const std::string& key, const std::string& value);  ///< fixed, not a coordinate
  EffectForm& number(const std::string& key, double value);            ///< fixed, not a coordinate
  EffectForm& list(const std::string& key, const Values& values);      ///< fixed, not a coordinate
  /// For each reach one probe with one point per coordinate at null + reach. Several reaches are for effects
  /// that are not proportional to their coordinate.
  EffectForm& straight(const Values& reaches);
  /// For each scale one probe: the first coordinate at null + reach, the second at the scale's logarithm.
  EffectForm& scaled(double reach, const Values& scales);
  EffectForm& probe(const Values& null, const std::vector<Values>& points);
  EffectForm& startingAt(const Values& point);  ///< a fit starts there
  EffectForm& foundInEachRecord(int count);     ///< values that are not coordinates: a phase
  EffectForm& searchedBy(SearchStrategy how);
  /// The effect consists of pieces that may be found separately; @param names of the pieces of this form, in
  /// the order of its coordinates.
  EffectForm& of(const std::vector<std::string>& names);

  std::string effect;   ///< name in the catalogue
  std::string variant;  ///< empty without one
  std::string after;    ///< variant that must be found before this one is tried; empty: none
  std::vector<Coordinate> coordinates;
  std::vector<Probe> probes;
  SearchStrategy strategy = SearchStrategy::none;
  std::vector<std::string> pieces;  ///< of the effect; empty: it is a whole
  double bic_penalty = 0.0;         ///< [BIC] of the effect
  int found_in_each_record = 0;     ///< values that the twin estimates from each record: the phase of a tone

  std::string title() const { return variant.empty() ? effect : effect + " (" + variant + ")"; }
  /// values.size() == coordinates.size()
  EffectEntry entry(const Values& values) const;
  /// Coordinates of an entry of this form: the inverse of entry().
  Values values(const EffectEntry& entry) const;
  /// The values that belong to one of the pieces, by its index.
  Values pieceOf(const Values& values, std::size_t piece) const;

 private:
  Values nulls() const;

  std::vector<EffectCoordinates> terms_;
  EffectEntry fixed_;
};

}  // namespace smartmill
