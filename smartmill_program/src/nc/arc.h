#pragma once

#include <array>
#include <optional>
#include <string>

#include "smartmill_core/nc/path_segment.h"

namespace smartmill::program {

/// Distances [m] from the start to the centre along the first and second axis of the plane; absent: 0.
struct CentreOffset {
  std::optional<double> first, second;
};

/// Arc with a given centre. Its radius may differ between start and end by what rounded programs need (as in
/// LinuxCNC: 5 um or 0.1 % of the radius, whichever is more, and at most 0.5 mm); the centre is then moved to
/// the perpendicular bisector of the chord. @throws Error "arc does not close: ..."
nc::PathSegment arcByCentre(const nc::PathSegment::Point& start, const nc::PathSegment::Point& target,
                            const CentreOffset& offset, bool clockwise, nc::Plane plane);

/// Arc with a given radius [m]: at most half a circle if it is positive, more if it is negative. @throws
/// Error
nc::PathSegment arcByRadius(const nc::PathSegment::Point& start, const nc::PathSegment::Point& target,
                            double radius, bool clockwise, nc::Plane plane);

}  // namespace smartmill::program
