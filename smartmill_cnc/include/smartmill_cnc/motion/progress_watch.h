#pragma once

#include <optional>

#include "smartmill_cnc/controller/controller.h"

namespace smartmill::cnc {

/// Judges from the readings whether a motion makes progress, and since when it is at rest. Times [s] are
/// those of the caller's clock.
class ProgressWatch {
 public:
  /// A phase of the motion begins.
  void restart(double now);
  void noteProgress(double now) { progressed_ = now; }
  /// @return whether nothing has changed for the time; a feed hold counts as progress.
  bool isStalled(const Reading& reading, double now, double timeout);
  /// @param ended whether the reading is that of an ended motion. @return whether it has been for the time
  bool isSettled(bool ended, double now, double settle_time);
  /// Whether the axes are at rest at the positions of the reading before.
  bool restsAt(const Reading& reading);
  void shift(double jump);

 private:
  double progressed_ = 0.0;  // [s]
  std::optional<double> still_since_;
  CncState last_;
};

}  // namespace smartmill::cnc
