#pragma once

#include <string>

namespace smartmill {

/// A pocket of 102 x 62 x 10 mm about X60 Y40 below Z0 in five levels, for a tool of 10 mm: helical entries,
/// rectangles with round corners. @param chord [m] length of the chords of corners and lines; 0: lines and
/// arcs
std::string ringPocket(double chord = 0.0);

}  // namespace smartmill
