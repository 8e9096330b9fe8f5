#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_hammer/search/flute_search.h"
#include "smartmill_hammer/search/sensor_calibration.h"

namespace smartmill {
namespace hammer {

struct SensorApproachOptions {
  double face = 8e-3;  ///< [m] diameter of the sensor's face
  /// [1] by which the sensor's voltage may stand off its nominal curve's: gain and bend of the curve. Far
  /// off, where the nominal curve is flat, a depth between flutes would else be told too deep.
  double curve_error = 0.15;
  double min_gap = 125e-6;  ///< [m] left before the face
  /// [m] diameter of what sees: a reading is the mean over so much of a flank, and that of an edge across the
  /// disc is off by what lies the mean distance of its places further from the flute.
  double electrode = 2e-3;
};

/// What of a fluted tool stands foremost before the sensor's round face, by what the sensor itself has read
/// of it, and how far the tool may go towards it. The sensor sees the middle of its face; the rest meets the
/// tool's other places: beside the middle those that stand turned, above and below it those that the helix
/// has turned. All of the tool lies at or behind what is told here, as long as the readings' curve is within
/// its error.
class SensorApproach {
 public:
  SensorApproach(const smartmill::HammerStation& station, const ToolGeometry& tool,
                 const SensorApproachOptions& options);

  /// Begins anew with a search's readings of one flute. @param angle [rad] of the flute @param volt [V] there
  void fluteSeen(const std::vector<FluteSearch::Reading>& readings, double angle, double volt);
  /// What the sensor sees `turned` [rad] on from a flute belongs to the flanks of the flutes on either side.
  /// The last reading of a place counts. @param moved [m] nearer to the sensor than where the flute was seen
  /// @param own false: another sensor
  /// than the one that saw the flute, and whose curve the approach tells
  void seen(double turned, double volt, double moved, bool own = true);
  /// The sensor's curve as the approach tells it, in place of the nominal one: what has been read before is
  /// read anew. One that the nominal curve's error does not allow is not taken.
  void curveSeen(const SensorCurve& curve);
  /// Nothing is known of the flanks: the tool counts as round.
  void forget();

  /// [m] at least, of the surface behind a flute with the spindle so far [rad] from one. The root of the
  /// depth runs straight between two readings, which lies below a flank that is round or straight; beyond the
  /// last reading the surface falls towards the gullet. Of uneven teeth any may be the flute that was found.
  double leastRetreat(double off) const;

  /// Where the tool stands before the sensor.
  struct Place {
    double turned = 0.0;                   ///< [rad] of the spindle on from a flute at the sensor's middle
    double above_tip = 0.0;                ///< [m] of the sensor's middle: below the tip there is nothing
    double lag_low = 0.0, lag_high = 0.0;  ///< [rad/m] the helix turns the edges with height: between these
  };
  /// [m] towards the sensor, from where the flute was seen, until the tool is as near to its face as allowed.
  /// There a flute that points at the sensor leaves twice the gap at zero volt, or what its reading says.
  double travel(const Place& place) const;

  /// [m] by the sensor's nominal curve.
  double nominalGap(double volt) const;

 private:
  struct Reading {
    double off, volt, moved;  // [rad] of the spindle from a flute at the sensor, [V], [m]
    bool own;
  };
  double turnedFromTooth(double off, int tooth, int found) const;
  double leastBetween(double first, double last) const;
  static double gap(double volt, const SensorCurve& curve, double error);
  SensorCurve nominal() const;
  double fluteGap() const;
  void readAnew();
  double retreatOf(const Reading& reading) const;

  struct Retreat {
    double off, depth;  // [rad], [m] behind the flute
  };

  smartmill::HammerStation station_;
  ToolGeometry tool_;
  SensorApproachOptions options_;
  SensorCurve curve_;
  double curve_error_;
  std::vector<double> turns_;  // [rad] of any tooth, were any the flute that was found; each once
  std::vector<Reading> readings_;
  std::vector<Retreat> profile_;  // of these readings by that curve
  double flute_volt_ = 0.0;       // [V] of the flute that was found
};

}  // namespace hammer
}  // namespace smartmill
