#include "commands/surface_error.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_stability/chart/picture.h"
#include "smartmill_stability/chart/surface_error.h"

namespace smartmill::stability {
namespace {

constexpr int DEPTHS = 40;            // of the map
constexpr double DEPTH_MARGIN = 0.2;  // [1] of a recommended cut below the limit, as in a chart
constexpr int CUTS = 5;               // recommended ones

void draw(const std::string& file, double largest_um) {
  // Unstable cuts have no wall: their cells are empty and stay white.
  const std::string range = std::to_string(largest_um);
  drawPicture(file,
              "set xlabel 'Spindle speed [rpm]'\nset ylabel 'Axial depth [mm]'\nset cblabel 'Surface "
              "location error [um], + overcut'\nset cbrange [-" +
                  range + ":" + range +
                  "]\nset palette defined (-1 'blue', 0 'white', 1 'red')\nset view map\nset autoscale "
                  "fix\nset key off\nplot %FILE skip 1 using 1:2:(strlen(strcol(4)) ? real(strcol(4)) : "
                  "NaN) with image pixels\n");
}

}  // namespace

void writeSurfaceMap(const SurfaceRequest& request, const MachineModel& model,
                     const RegenerativeSystem& system, const std::vector<double>& speeds) {
  if (!(request.feed_mm > 0.0)) throw Error("--surface-error: requires --feed-mm: expected a value above 0");
  if (!(request.tolerance_um >= 0.0)) throw Error("--tolerance-um: expected a value above 0");
  RegenerativeSystem cut = system;
  cut.chip = finishingChip(model, request.feed_mm * units::MM);
  std::vector<double> depths;
  for (int i = 1; i <= DEPTHS; ++i) depths.push_back(request.max_depth_mm * units::MM * i / DEPTHS);
  const bool terminal = isatty(STDERR_FILENO);
  const SurfaceMapOptions options;
  const SurfaceMap map =
      surfaceMap(UncertainSystem::of(model, cut), speeds, depths, options, [&](double share) {
        if (terminal)
          std::fprintf(stderr, "\r%3.0f %% of the walls%s", 100.0 * share, share >= 1.0 ? "\n" : "");
      });
  CsvWriter csv(
      "rpm,depth_mm,stable,error_um,error_std_um,least_um,most_um,peak_to_valley_um,mean_deviation_um", 6);
  std::vector<double> errors;  // [um]
  for (std::size_t s = 0; s < speeds.size(); ++s) {
    for (std::size_t d = 0; d < depths.size(); ++d) {
      const double rpm = units::rpmFromRadPerSec(speeds[s]), depth = depths[d] / units::MM;
      const MachinedWall& wall = map.wall[s][d];
      if (!map.stable(s, d)) {
        csv.row(rpm, depth, 0, "", "", "", "", "", "");
        continue;
      }
      csv.row(rpm, depth, 1, wall.error / units::UM, map.error_std[s][d] / units::UM, wall.least / units::UM,
              wall.most / units::UM, wall.peak_to_valley / units::UM, wall.mean_deviation / units::UM);
      errors.push_back(std::abs(wall.error) / units::UM);
    }
  }
  csv.save(request.file);
  if (errors.empty()) {
    std::printf("no stable cut, no surface location error\n");
    return;
  }
  // The colours resolve all but the largest errors, next to a resonance.
  const auto most =
      errors.begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(errors.size() - 1));
  std::nth_element(errors.begin(), most, errors.end());
  draw(request.file, std::max(*most, 1e-3));
  std::printf("surface location error up to %.2f um in 95 %% of the stable cuts (+ overcut)\n", *most);
  if (request.tolerance_um == 0.0) return;
  const std::vector<FinishingCut> cuts =
      finishingCuts(map, request.tolerance_um * units::UM, options.speed_margin, DEPTH_MARGIN, CUTS);
  std::printf(
      "finishing cuts within %.4g um (%.0f %% below the limit, probability of chatter at most %.0f %%, "
      "error with two standard deviations, within %.1f %% of the speed):\n",
      request.tolerance_um, 100.0 * DEPTH_MARGIN, 100.0 * options.risk, 100.0 * options.speed_margin);
  if (cuts.empty()) std::printf("  none\n");
  for (const FinishingCut& c : cuts)
    std::printf("  %8.1f rpm %8.4f mm  error %+.2f +- %.2f um, feed marks %.2f um\n",
                units::rpmFromRadPerSec(c.speed), c.depth / units::MM, c.wall.error / units::UM,
                c.error_std / units::UM, c.wall.peak_to_valley / units::UM);
}

}  // namespace smartmill::stability
