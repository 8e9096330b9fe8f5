#pragma once

#include <map>
#include <string>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill {

enum class Control { fanuc, linuxcnc };

/// A part with its program and tools.
struct RealPart {
  std::string name, text;
  std::map<int, ToolGeometry> tools;  ///< by T
};

/// Programs with several tools in the dialect of a common CAM post: a program number or none, comments with
/// the tools, N words, modal words and trailing zeros left out, arcs with I and J, coolant, G28, G43. The
/// coordinates are those of the machine (G54 without offset); the parts are in the corner of the stock of
/// least X and Y. @throws Error when a part does not fit the stock
/// @{
/// A round pocket, cleared from a helical entry in rings of constant step joined by half arcs, with a
/// trochoidal slot into the solid; its wall is finished by a second tool, which also mills a groove.
RealPart adaptivePocket(const Workpiece& stock, Control control);
/// Two pockets, open to one side, with a rib of 3 mm between them: roughed by zigzag with smoothed corners,
/// the rib finished on both sides level by level.
RealPart thinRib(const Workpiece& stock, Control control);
/// A cylindrical surface: terraces, then a raster of a ball end mill with a constant scallop.
RealPart scallopSurface(const Workpiece& stock, Control control);
/// @}

std::vector<RealPart> realParts(const Workpiece& stock, Control control);

}  // namespace smartmill
