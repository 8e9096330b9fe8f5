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
  double null = 0.0;             ///< value that changes nothing (nominal: 0; prior mean)
  double low = 0.0, high = 0.0;  ///< where a fit looks
  double step = 0.0;             ///< of numeric tangents
  double prior_std = 0.0;        ///< Gaussian prior about null
};

/// Where a fit looks for one coordinate, without its name.
struct FitRange {
  double low = 0.0, high = 0.0;
  double step = 0.0;       ///< of numeric tangents
  double prior_std = 0.0;  ///< Gaussian prior about the coordinate's null
};

/// Coordinates in which an effect is well behaved, and the keys of an entry that they stand for. write() and
/// read() are each other's inverse inside the coordinates' bounds.
struct EffectCoordinates {
  std::vector<Coordinate> coordinates;
  std::function<void(const double* values, EffectEntry& entry)> write;
  std::function<void(const EffectEntry& entry, double* values)> read;
};

/// A key as it stands.
EffectCoordinates amplitude(const std::string& key, const FitRange& range, double null = 0.0);

/// The logarithm of key / of: a factor moves along with those of the nominal values that it resembles.
EffectCoordinates logarithm(const std::string& key, const FitRange& range, double of = 1.0,
                            double null = 0.0);

/// The logarithm of 1 + key.
EffectCoordinates logarithmOfOnePlus(const std::string& key, const FitRange& range);

/// A vector in the plane: size and direction [deg] in the file, Cartesian in the fit, which has no pole at
/// zero.
EffectCoordinates planar(const std::string& size_key, const std::string& angle_key, double limit, double step,
                         double prior_std);

/// A size on x and its ratio to that on y: both sizes in the fit, since without x the ratio says nothing.
EffectCoordinates sizes(const std::string& key, const std::string& y_ratio_key, const FitRange& range);

/// A power law exponent and reference: times (x / reference)^-exponent. The fit moves the exponent and the
/// level at a middle x, which stays well known where the exponent is small.
/// @param low, high of the reference
EffectCoordinates powerLaw(const std::string& exponent_key, const std::string& reference_key, double middle,
                           double low, double high);

/// A size that is reached by 1 - exp(-t / constant): what is there at a time t > 0, and the share of the
/// whole that is to come after it. Both stay told where the constant is not: of a constant far below t
/// nothing is to come.
/// @param time [s] a time at which the effect is seen first; earlier ones need larger powers of the share
EffectCoordinates saturating(const std::string& size_key, const std::string& constant_key, double time,
                             const FitRange& range);

/// A list of pitches [deg], one a tooth: differences from the tool's, the last one follows from the sum.
EffectCoordinates pitches(const std::string& key, const ToolGeometry& tool, const FitRange& range);

/// A list with mean zero, one value a tooth, of which only differences act: orthonormal contrasts (Helmert).
EffectCoordinates contrasts(const std::string& key, int teeth, const FitRange& range);

/// One mode of the tool tip along x or y: logarithms of frequency and damping ratio, compliance [um/kN].
EffectCoordinates tipMode(char axis);

/// One way in which an effect may be present: as a whole, in one channel, along one axis.
struct EffectForm {
  using Values = std::vector<double>;

  /// Points from which the effect is tried: with amplitudes a_k the effect stands at null + sum a_k
  /// (points[k] - null).
  struct Probe {
    Values null;                 ///< the effect does nothing here
    std::vector<Values> points;  ///< each shows one direction
    bool from_points = false;    ///< a fit starts at points[0] as it is
  };

  /// What the records are searched for when no probe is known beforehand.
  enum class Seek { nothing, sensor_mode, tip_mode, spindle_order };

  EffectForm() = default;
  explicit EffectForm(std::vector<EffectCoordinates> parts);

  // What makes a form, to be strung together.
  EffectForm& named(const std::string& variant);                       ///< channel or axis
  EffectForm& onlyAfter(const std::string& variant);                   ///< that must have been found before
  EffectForm& word(const std::string& key, const std::string& value);  ///< that no coordinate moves
  EffectForm& number(const std::string& key, double value);            ///< the same
  EffectForm& list(const std::string& key, const Values& values);      ///< the same
  /// A probe with one point a coordinate at null + reach. Several: what the effect does is not in proportion
  /// to it, and one amplitude is tried from several distances.
  EffectForm& straight(const Values& reaches);
  /// One probe for each scale: the first coordinate at null + reach, the second at the scale's logarithm.
  EffectForm& scaled(double reach, const Values& scales);
  EffectForm& probe(const Values& null, const std::vector<Values>& points);
  EffectForm& startingAt(const Values& point);  ///< a fit starts there
  EffectForm& foundInEachRecord(int count);     ///< values of it that are no coordinates: a phase
  EffectForm& sought(Seek what);
  /// The effect is put together of pieces that may be found one by one, those of this form in the order of
  /// its coordinates.
  EffectForm& of(const std::vector<std::string>& names);

  std::string effect;   ///< name in the catalogue
  std::string variant;  ///< empty without one
  std::string after;    ///< variant that must have been found before this one is tried, empty: none
  std::vector<Coordinate> coordinates;
  std::vector<Probe> probes;
  Seek seek = Seek::nothing;
  std::vector<std::string> pieces;  ///< of the effect; empty: it is one whole
  double handicap = 0.0;            ///< [BIC] of the effect
  int found_in_each_record = 0;     ///< values that the twin takes from each record: a tone's phase

  std::string title() const { return variant.empty() ? effect : effect + " (" + variant + ")"; }
  /// values.size() == coordinates.size()
  EffectEntry entry(const Values& values) const;
  /// Where an entry of this form stands: the inverse of entry().
  Values values(const EffectEntry& entry) const;
  /// The values that belong to one of the pieces, by its place among them.
  Values pieceOf(const Values& values, std::size_t piece) const;

 private:
  Values nulls() const;

  std::vector<EffectCoordinates> parts_;
  EffectEntry fixed_;
};

}  // namespace smartmill
