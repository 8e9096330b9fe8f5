#pragma once

#include <string>
#include <vector>

#include "gallery/gallery.h"

namespace smartmill::studies {

struct DrawnFigure {
  Figure figure;
  Drawn drawn;
};

/// One HTML file: the counts and the numbers of each kind apart, then all figures.
/// @throws Error
void writePage(const std::vector<DrawnFigure>& drawn_figures, unsigned seed, const std::string& file);

}  // namespace smartmill::studies
