#pragma once

#include "smartmill_core/signal/streams.h"

namespace smartmill {

/// Whether the tool centre lies on the condition's line from steady_from to steady_to, within tolerance [m].
/// False when the state lacks one of the axes X, Y, Z or the line has zero length.
bool onSteadyPath(const CuttingCondition& condition, const CncState& state, double tolerance);

/// Direction of the feed [rad] in the X-Y plane from +X towards +Y; of a turning cut (no teeth) in the X-Z
/// plane, from +X towards +Z.
double headingOf(const CuttingCondition& condition);

}  // namespace smartmill
