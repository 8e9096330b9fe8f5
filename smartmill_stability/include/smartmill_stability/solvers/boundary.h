#pragma once

#include <vector>

#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

struct BoundaryPoint {
  double speed = 0.0;      ///< [rad/s]
  double depth = 0.0;      ///< [m]
  double frequency = 0.0;  ///< [Hz] of the strongest chatter component
  Kind kind = Kind::none;
};

/// One connected piece of the stability boundary; a closed one is an island or a hole.
struct BoundaryCurve {
  std::vector<BoundaryPoint> points;
  bool closed = false;
};

struct TraceOptions {
  double speed_low = 0.0, speed_high = 0.0;  ///< [rad/s] 0 < low < high
  double max_depth = 0.0;                    ///< [m] > 0
  int speeds = 60, depths = 30;              ///< cells of the coarse grid, 4..2000; depths start at 0
  int levels = 2;                            ///< bisections of the cells on the boundary, 0..6
};

/// The whole boundary in a window of speed and depth, not only the first loss of stability: the spectral
/// radius is evaluated on a coarse grid, cells on the boundary and their neighbours are bisected in both
/// directions, and the crossings of the finest edges are solved by iteration and joined. @throws Error on an
/// invalid window.
std::vector<BoundaryCurve> traceBoundary(const FloquetSolver& solver, const TraceOptions& options);

}  // namespace smartmill::stability
