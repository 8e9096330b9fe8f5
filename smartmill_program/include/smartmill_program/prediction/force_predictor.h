#pragma once

#include <vector>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_program/engagement/contact.h"

namespace smartmill::program {

/// Force of the side of the tool in the feed frame.
struct ForcePrediction {
  CuttingForce mean;         ///< over a revolution
  double peak_force = 0.0;   ///< [N] largest force across the tool axis over a revolution
  double peak_torque = 0.0;  ///< [N m] largest
};

/// The force over the feed per tooth c > 0 at one spindle angle: edges + c chip, exact in the linear
/// edge-force model.
struct ForceOverFeed {
  CuttingForce edges;  ///< at c = 0
  CuttingForce chip;   ///< [1/m] per feed per tooth
};

/// The largest chip thickness [m] over a revolution: the feed of the tooth with the largest pitch times the
/// largest sin(phi) sin(kappa) in the contact. @param feed_per_tooth [m] horizontal
double largestChip(const ToolGeometry& tool, const Contact& contact, double feed_per_tooth);

/// Whether two contacts are the same within the resolution of a contact.
bool sameContact(const Contact& a, const Contact& b);
constexpr double ALIKE_FEED = 1e-6;  ///< [1] between two feeds per tooth

/// Forces of a contact by the mechanistic model (smartmill_core/cutting/mechanistic.h): the sum over its
/// arcs, each of which is a cut of its own depth. The end face and process damping are not part of the model.
class ForcePredictor {
 public:
  ForcePredictor(const ToolGeometry& tool, const CuttingCoefficients& coefficients)
      : tool_(tool), coefficients_(coefficients) {}

  /// @param feed_per_tooth [m] horizontal
  /// @throws Error as MechanisticForce
  const ForcePrediction& predict(const Contact& contact, double feed_per_tooth);

  /// At evenly spaced spindle angles from 0 on. @param range [rad] of the angles @param count of them
  std::vector<CuttingForce> series(const Contact& contact, double feed_per_tooth, double range,
                                   std::size_t count) const;

  /// At the spindle angles of predict().
  /// @param mean of a revolution
  std::vector<ForceOverFeed> overFeed(const Contact& contact, ForceOverFeed* mean) const;

 private:
  std::vector<MechanisticForce> cutsOf(const Contact& contact, double feed_per_tooth) const;
  std::vector<double> angles(const Contact& contact) const;
  bool isLast(const Contact& contact, double feed_per_tooth) const;

  ToolGeometry tool_;
  CuttingCoefficients coefficients_;
  // The last prediction; along a straight cut it stays the same.
  Contact contact_;
  double feed_per_tooth_ = 0.0;
  ForcePrediction prediction_;
};

}  // namespace smartmill::program
