#include "commands/speed_variation.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/picture.h"
#include "smartmill_stability/chart/variation_design.h"

namespace smartmill::stability {
namespace {

std::string depthText(double limit, double max_depth_mm) {
  return std::isfinite(limit) ? formatted("%.4f mm", limit / units::MM)
                              : formatted("above %.4f mm", max_depth_mm);
}

std::string textOf(const SpeedVariation& variation) {
  const bool triangle = variation.shape == SpeedVariation::Shape::triangle;
  return formatted("+-%.1f %% at %.4g of the spindle frequency%s", 100.0 * variation.amplitude,
                   variation.ratio, triangle ? " (triangle)" : "");
}

}  // namespace

SpeedVariation speedVariationOf(const std::string& text) {
  SpeedVariation variation;
  char shape[16] = "sine", rest = 0;
  const int read =
      std::sscanf(text.c_str(), "%lf:%lf:%15[a-z]%c", &variation.amplitude, &variation.ratio, shape, &rest);
  const bool triangle = std::string(shape) == "triangle";
  // A number at the end has no colon after it.
  const bool complete = read == 3 ? triangle : read == 2 && std::count(text.begin(), text.end(), ':') == 1;
  if (!complete || !(variation.amplitude >= 0.0 && variation.amplitude < 1.0) || !(variation.ratio > 0.0))
    throw Error(
        "--speed-variation " + text +
        ": expected AMPLITUDE:RATIO or AMPLITUDE:RATIO:triangle with 0 <= AMPLITUDE < 1 and RATIO > 0");
  if (triangle) variation.shape = SpeedVariation::Shape::triangle;
  return variation;
}

void writeVariedChart(const VariationRequest& request, const std::vector<double>& speeds,
                      const std::vector<Limit>& varied, const std::vector<Limit>& steady) {
  const double most = request.max_depth_mm * units::MM;
  CsvWriter csv("rpm,limit_mm,chatter_hz,kind,steady_limit_mm", 8);
  const auto cell = [](double depth) {
    return std::isfinite(depth) ? formatted("%.8g", depth / units::MM) : std::string();
  };
  double least_varied = most, least_steady = most, gain = 0.0, fastest = 0.0;
  for (std::size_t i = 0; i < speeds.size(); ++i) {
    const bool limited = std::isfinite(varied[i].depth);
    csv.row(units::rpmFromRadPerSec(speeds[i]), cell(varied[i].depth),
            limited ? formatted("%.8g", varied[i].frequency) : "", limited ? nameOf(varied[i].kind) : "",
            cell(steady[i].depth));
    least_varied = std::min(least_varied, varied[i].depth);
    least_steady = std::min(least_steady, steady[i].depth);
    gain += std::min(most, varied[i].depth) / std::min(most, steady[i].depth) /
            static_cast<double>(speeds.size());
    fastest = std::max(fastest, speeds[i]);
  }
  csv.save(request.file);
  drawPicture(request.file,
              "set xlabel 'Mean spindle speed [rpm]'\nset ylabel 'Axial depth [mm]'\nset yrange [0:" +
                  std::to_string(request.max_depth_mm) +
                  "]\nplot %FILE skip 1 using 1:(strlen(strcol(5)) ? $5 : NaN) with lines lw 2 lc "
                  "'gray' title 'constant speed', %FILE skip 1 using 1:(strlen(strcol(2)) ? $2 : "
                  "NaN) with lines lw 2 title 'varied speed'");
  std::printf(
      "stable below %.4f mm at all of these speeds with the speed varied by %s, below %.4f mm without\n",
      least_varied / units::MM, textOf(request.variation).c_str(), least_steady / units::MM);
  std::printf("mean ratio of the limits %.3f; acceleration of the spindle %.4g rpm/s at %.1f rpm\n", gain,
              units::rpmFromRadPerSec(request.variation.acceleration(fastest)),
              units::rpmFromRadPerSec(fastest));
}

void printBestVariation(const VariationRequest& request, const MachineModel& model,
                        const RegenerativeSystem& system) {
  VariationDesignOptions options;
  options.most = request.variation;
  if (model.spindle && model.spindle->acceleration) options.acceleration = *model.spindle->acceleration;
  const VariationDesign design = designVariation(system, units::radPerSecFromRpm(request.best_rpm),
                                                 request.max_depth_mm * units::MM, options);
  if (design.variation.amplitude == 0.0) {
    std::printf(
        "variation for %.1f rpm: none within the amplitude, ratio and acceleration raises the limit of %s\n",
        request.best_rpm, depthText(design.steady_limit, request.max_depth_mm).c_str());
    return;
  }
  std::printf("variation for %.1f rpm: %s: limit %s, %s at constant speed\n", request.best_rpm,
              textOf(design.variation).c_str(), depthText(design.limit, request.max_depth_mm).c_str(),
              depthText(design.steady_limit, request.max_depth_mm).c_str());
}

}  // namespace smartmill::stability
