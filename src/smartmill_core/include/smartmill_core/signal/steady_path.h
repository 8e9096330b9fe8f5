#pragma once

#include "smartmill_core/signal/streams.h"

namespace smartmill {

/// Whether the tool centre lies on the condition's line from steady_from to steady_to, within tolerance [m].
/// False when the state lacks one of the axes X, Y, Z or the line has zero length.
bool onSteadyPath(const CuttingCondition& condition, const CncState& state, double tolerance);

/// Whether the direction of the feed turns during a cut (along an arc): it is steady while it is valid, and
/// has no line.
bool feedTurns(const CuttingCondition& condition);

/// Whether a state belongs to a steady cut in any direction, for results that do not depend on it: on the
/// line, or in feed where the direction turns.
bool inSteadyCut(const CuttingCondition& condition, const CncState& state, double tolerance);

/// Direction of the feed [rad] in the X-Y plane from +X towards +Y; of a turning cut (no teeth) in the X-Z
/// plane, from +X towards +Z; NaN where it turns.
double headingOf(const CuttingCondition& condition);

}  // namespace smartmill
