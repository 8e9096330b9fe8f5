#include "commands/part_limits.h"

#include <cmath>
#include <cstdio>

#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/picture.h"

namespace smartmill::stability {
namespace {

constexpr int POSITIONS = 21;  // evenly spaced: twentieths of the part

void draw(const std::string& file, double max_depth_mm) {
  const std::string most = std::to_string(max_depth_mm);
  // Cells without a limit are stable to the largest depth.
  drawPicture(file,
              "set xlabel 'Spindle speed [rpm]'\nset ylabel 'Position along the part [mm]'\nset cblabel "
              "'Limit of the axial depth [mm]'\nset cbrange [0:" +
                  most + "]\nset view map\nset autoscale fix\nset key off\nplot %FILE skip 1 using " +
                  "2:1:(strlen(strcol(3)) ? $3 : " + most + ") with image pixels\n");
}

}  // namespace

std::vector<Limit> writePartLimits(const std::string& file, double max_depth_mm, const MachineModel& model,
                                   const std::vector<double>& speeds, const LimitsAt& limits) {
  if (model.workpiece_modes.size() < 2)
    throw Error(model.file + ": workpiece.modes: expected two places or more (needed by --along-part)");
  const double low = model.workpiece_modes.front().position, high = model.workpiece_modes.back().position;
  CsvWriter csv("position_mm,rpm,limit_mm,chatter_hz,kind", 8);
  std::vector<Limit> least(speeds.size());
  double lowest = max_depth_mm * units::MM, place = NAN, speed = NAN;
  for (int i = 0; i < POSITIONS; ++i) {
    const double position = i + 1 < POSITIONS ? low + (high - low) * i / (POSITIONS - 1) : high;
    const std::vector<Limit> found = limits(atPosition(model, position));
    for (std::size_t s = 0; s < speeds.size(); ++s) {
      const double rpm = units::rpmFromRadPerSec(speeds[s]);
      if (std::isfinite(found[s].depth)) {
        csv.row(position / units::MM, rpm, found[s].depth / units::MM, found[s].frequency,
                nameOf(found[s].kind));
      } else {
        csv.row(position / units::MM, rpm, "", "", "");
      }
      if (found[s].depth < least[s].depth) least[s] = found[s];
      if (found[s].depth >= lowest) continue;
      lowest = found[s].depth;
      place = position;
      speed = speeds[s];
    }
  }
  csv.save(file);
  // gnuplot draws no map of a single column.
  if (speeds.size() > 1) draw(file, max_depth_mm);
  if (std::isfinite(place)) {
    std::printf("least limit along the part: %.4f mm, at %.2f mm and %.1f rpm\n", lowest / units::MM,
                place / units::MM, units::rpmFromRadPerSec(speed));
  }
  return least;
}

}  // namespace smartmill::stability
