#include "smartmill_core/cutting/mechanistic.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/cutting/corner.h"
#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill {

namespace {

using units::PI;
using units::TWO_PI;

[[noreturn]] void refuse(const char* what, double value, const char* unit, const char* range) {
  throw Error(formatted("%s: %g %s is out of range (%s)", what, value, unit, range));
}

double sinc(double x) {
  return std::abs(x) < 1e-6 ? 1.0 - x * x / 6.0 : std::sin(x) / x;
}

/// Integrals over the immersion angle, or means over a segment of edge.
struct Shares {
  double one = 0.0, s = 0.0, c = 0.0, ss = 0.0, sc = 0.0;
};

// Mean over an interval of width d around middle. Differences are written as products, which avoids
// cancellation in short intervals (zero helix is the limit).
Shares meanOver(double middle, double d) {
  const double half = sinc(0.5 * d), full = sinc(d);
  return {1.0, half * std::sin(middle), half * std::cos(middle), 0.5 - 0.5 * full * std::cos(2.0 * middle),
          0.5 * full * std::sin(2.0 * middle)};
}

// There is no force without a positive chip c sin(phi) + level: only 0..pi of the engagement counts, without
// the sides of a rising edge. @param level [m]
double sideAngle(const Engagement& e, double level) {
  if (level >= 0.0) return 0.0;
  return e.feed_per_tooth > 0.0 ? std::asin(std::min(1.0, -level / e.feed_per_tooth)) : 0.5 * PI;
}
double firstCut(const Engagement& e, double level) {
  return std::max(e.entry, sideAngle(e, level));
}
double lastCut(const Engagement& e, double level) {
  return std::min(e.exit, PI - sideAngle(e, level));
}

void requireBottom(double bottom, const Engagement& engagement) {
  if (!(bottom >= 0.0 && bottom < engagement.axial_depth))
    refuse("lower end of the cut", bottom, "m", "0 <= value < axial depth");
}

}  // namespace

CuttingForce toolForce(double ft, double fr, double fa, double immersion_angle, double radius) {
  EdgeForce sum;
  sum.add(1.0, ft, fr, fa, std::sin(immersion_angle), std::cos(immersion_angle));
  return {sum.fx, sum.fy, sum.fz, sum.ft * radius};
}

void validate(const ToolGeometry& tool) {
  if (tool.teeth < 1 || tool.teeth > 20) refuse("tool teeth", tool.teeth, "", "1..20");
  if (!(tool.diameter > 0.0) || !std::isfinite(tool.diameter)) {
    refuse("tool diameter", tool.diameter, "m", "> 0");
  }
  if (!(tool.helix >= 0.0 && tool.helix < units::radFromDeg(80.0))) {
    refuse("tool helix", tool.helix, "rad", "0 <= helix < 80 deg");
  }
  validate(tool.edge, tool);
  if (tool.pitch.empty()) return;
  if (tool.pitch.size() != static_cast<std::size_t>(tool.teeth)) {
    refuse("tool pitch", static_cast<double>(tool.pitch.size()), "values", "one per tooth");
  }
  double sum = 0.0;
  for (const double p : tool.pitch) {
    if (!(p > 0.0)) refuse("tool pitch", p, "rad", "> 0");
    sum += p;
  }
  // Pitches are written with a few digits in degrees.
  if (std::abs(sum - TWO_PI) > 1e-4) refuse("tool pitch", sum, "rad in total", "sum 2 pi");
}

void validate(const EdgeShape& edge, const ToolGeometry& tool) {
  if (!(edge.corner_radius >= 0.0) || !std::isfinite(edge.corner_radius))
    refuse("tool corner radius", edge.corner_radius / units::MM, "mm", ">= 0");
  if (!(edge.edge_angle > 0.0 && edge.edge_angle <= 0.5 * PI))
    refuse("tool edge angle", units::degFromRad(edge.edge_angle), "deg", "0 < value <= 90");
  // The centre of the corner does not lie beyond the axis.
  constexpr double ROUNDING = 1e-9;
  if (edge.corner_radius * std::tan(0.5 * edge.edge_angle) > tool.radius() * (1.0 + ROUNDING)) {
    throw Error(formatted("a corner radius of %g mm does not fit a tool of radius %g mm",
                          edge.corner_radius / units::MM, tool.radius() / units::MM));
  }
  if (!edge.helix.empty() && edge.helix.size() != static_cast<std::size_t>(tool.teeth))
    refuse("tool helix", static_cast<double>(edge.helix.size()), "values", "one per tooth");
  for (const double helix : edge.helix) {
    if (!(helix >= 0.0 && helix < units::radFromDeg(80.0)))
      refuse("tool helix", helix, "rad", "0 <= helix < 80 deg");
  }
  if (!(edge.serration_amplitude >= 0.0) || !std::isfinite(edge.serration_amplitude))
    refuse("tool serration amplitude", edge.serration_amplitude / units::MM, "mm", ">= 0");
  if (edge.serrated() && (!(edge.serration_wavelength > 0.0) || !std::isfinite(edge.serration_wavelength)))
    refuse("tool serration wavelength", edge.serration_wavelength / units::MM, "mm", "> 0");
}

void validate(const Engagement& engagement) {
  if (!(engagement.entry >= 0.0 && engagement.entry <= TWO_PI)) {
    refuse("entry angle", engagement.entry, "rad", "0..2 pi");
  }
  if (!(engagement.exit > engagement.entry && engagement.exit <= TWO_PI + 1e-12)) {
    refuse("exit angle", engagement.exit, "rad", "entry < exit <= 2 pi");
  }
  if (!(engagement.axial_depth > 0.0) || !std::isfinite(engagement.axial_depth)) {
    refuse("axial depth", engagement.axial_depth, "m", "> 0");
  }
  if (!(engagement.feed_per_tooth >= 0.0) || !std::isfinite(engagement.feed_per_tooth)) {
    refuse("feed per tooth", engagement.feed_per_tooth, "m", ">= 0");
  }
  for (const EngagementBand& band : engagement.bands) {
    if (!(band.entry >= 0.0 && band.exit > band.entry && band.exit <= TWO_PI + 1e-12))
      refuse("exit angle of a band", band.exit, "rad", "entry < exit <= 2 pi");
    if (!(band.bottom >= 0.0 && band.top > band.bottom && band.top <= engagement.axial_depth))
      refuse("upper end of a band", band.top, "m", "lower end < value <= axial depth");
  }
}

namespace {

/// Of one band.
Engagement engagementOf(const EngagementBand& band, const Engagement& all) {
  return {band.entry, band.exit, band.top, all.feed_per_tooth, {}, all.axial_feed_per_tooth};
}

/// Calls visit(slice, mill, engagement) for the slices of a tool between a height and the axial depth.
template <class Visit>
void forEachSlice(const ToolGeometry& tool, const Engagement& engagement, double bottom, Visit&& visit) {
  if (tool.edge.serrated())
    throw Error(
        formatted("tool: serration: amplitude_mm: %g, expected a smooth edge (needed to compute the "
                  "force of a chip in proportion to the feed)",
                  tool.edge.serration_amplitude / units::MM));
  for (const EdgeSlice& whole : edgeSlices(tool, engagement.axial_depth)) {
    const double low = std::max(whole.low, bottom), high = std::min(whole.high, engagement.axial_depth);
    if (high <= whole.low) break;
    if (high <= low) continue;
    const EdgeSlice slice = between(low, high, whole, tool);
    Engagement part = engagement;
    part.axial_depth = high - low;
    visit(slice, toolOf(slice, tool), part);
  }
}

}  // namespace

MechanisticForce::MechanisticForce(const ToolGeometry& tool, const CuttingCoefficients& coefficients,
                                   const Engagement& engagement, double bottom)
    : tool_(tool), coefficients_(coefficients), engagement_(engagement) {
  validate(tool);
  validate(engagement);
  const std::pair<const char*, double> values[] = {
      {"cutting coefficient Ktc", coefficients.ktc}, {"cutting coefficient Krc", coefficients.krc},
      {"cutting coefficient Kac", coefficients.kac}, {"edge coefficient Kte", coefficients.kte},
      {"edge coefficient Kre", coefficients.kre},    {"edge coefficient Kae", coefficients.kae}};
  for (const auto& [name, value] : values) {
    if (!std::isfinite(value)) refuse(name, value, "", "finite");
  }
  requireBottom(bottom, engagement);
  bottom_ = bottom;
  for (const EngagementBand& band : engagement.bands) {
    slices_.emplace_back(tool, coefficients, engagementOf(band, engagement), band.bottom);
    turn_.push_back(0.0);
  }
  if (!slices_.empty() || (tool.edge.straight() && bottom == 0.0)) return;
  CuttingLaw law;
  law.coefficients = coefficients;
  forEachSlice(tool, engagement, bottom,
               [&](const EdgeSlice& slice, const ToolGeometry& mill, const Engagement& part) {
                 slices_.emplace_back(mill, lawOf(slice, law).coefficients, part);
                 slices_.back().level_ = slice.lean() * engagement.axial_feed_per_tooth;
                 turn_.push_back(slice.turn);
               });
}

CuttingForce MechanisticForce::at(double spindle_angle) const {
  CuttingForce sum;
  for (std::size_t s = 0; s < slices_.size(); ++s) sum.add(slices_[s].at(spindle_angle - turn_[s]));
  if (!slices_.empty()) return sum;
  const double lag = tool_.lag(), depth = engagement_.axial_depth;
  const double entry = firstCut(engagement_, level_), exit = lastCut(engagement_, level_);
  if (exit <= entry || engagement_.feed_per_tooth <= 0.0) return sum;
  const CuttingCoefficients& k = coefficients_;
  for (int tooth = 0; tooth < tool_.teeth; ++tooth) {
    const double share = tool_.teeth * tool_.pitchOf(tooth) / TWO_PI;
    const double chip = engagement_.feed_per_tooth * share, level = level_ * share;
    // The level cuts at every angle, as the edge does.
    const double kt = k.kte + k.ktc * level, kr = k.kre + k.krc * level, ka = k.kae + k.kac * level;
    double tip = std::fmod(spindle_angle + tool_.toothAngle(tooth), TWO_PI);
    if (tip < 0.0) tip += TWO_PI;
    // The edge spans the immersion angles tip - lag depth .. tip, possibly several revolutions.
    for (; tip - lag * depth < exit; tip += TWO_PI) {
      if (tip < entry) continue;
      double low = 0.0, high = depth;
      if (lag > 0.0) {
        low = std::max(0.0, (tip - exit) / lag);
        high = std::min(depth, (tip - entry) / lag);
      } else if (tip >= exit) {
        break;
      }
      if (high <= low) continue;
      const double length = high - low;
      const Shares m = meanOver(tip - 0.5 * lag * (low + high), lag * length);
      const double c = chip * length;
      sum.fx += -(k.ktc * c * m.sc + kt * length * m.c) - (k.krc * c * m.ss + kr * length * m.s);
      sum.fy += (k.ktc * c * m.ss + kt * length * m.s) - (k.krc * c * m.sc + kr * length * m.c);
      sum.fz += k.kac * c * m.s + ka * length;
      sum.torque += tool_.radius() * (k.ktc * c * m.s + kt * length);
    }
  }
  return sum;
}

CuttingForce MechanisticForce::mean() const {
  const auto matrix = meanForceMatrix(tool_, engagement_, bottom_);
  const CuttingCoefficients& k = coefficients_;
  const std::array<double, 6> values{k.ktc, k.krc, k.kac, k.kte, k.kre, k.kae};
  std::array<double, 4> mean{};
  for (std::size_t r = 0; r < 4; ++r) {
    for (std::size_t c = 0; c < 6; ++c) mean[r] += matrix[r][c] * values[c];
  }
  return {mean[0], mean[1], mean[2], mean[3]};
}

namespace {

using ForceMatrix = std::array<std::array<double, 6>, 4>;

/// Of a straight mill. @param level [m], see MechanisticForce
ForceMatrix straightForceMatrix(const ToolGeometry& tool, const Engagement& engagement, double level) {
  const double entry = firstCut(engagement, level), exit = lastCut(engagement, level);
  if (exit <= entry || engagement.feed_per_tooth <= 0.0) return {};
  const double arc = exit - entry;
  const Shares m = meanOver(0.5 * (entry + exit), arc);
  // Every element of the edge is in the cut for arc / (2 pi) of the time; the chips of all teeth sum to the
  // feed per revolution.
  const double edge = tool.teeth * engagement.axial_depth * arc / TWO_PI;
  const double chip = edge * engagement.feed_per_tooth;
  const double r = tool.radius();
  ForceMatrix matrix{{{-chip * m.sc, -chip * m.ss, 0.0, -edge * m.c, -edge * m.s, 0.0},
                      {chip * m.ss, -chip * m.sc, 0.0, edge * m.s, -edge * m.c, 0.0},
                      {0.0, 0.0, chip * m.s, 0.0, 0.0, edge},
                      {r * chip * m.s, 0.0, 0.0, r * edge, 0.0, 0.0}}};
  for (std::array<double, 6>& row : matrix)
    for (std::size_t k = 0; k < 3; ++k) row[k] += level * row[k + 3];
  return matrix;
}

/// Sum over the slices: the coefficients of each are linear in those of the tool.
ForceMatrix slicedForceMatrix(const ToolGeometry& tool, const Engagement& engagement, double bottom) {
  constexpr std::array<double CuttingCoefficients::*, 6> ALL{
      &CuttingCoefficients::ktc, &CuttingCoefficients::krc, &CuttingCoefficients::kac,
      &CuttingCoefficients::kte, &CuttingCoefficients::kre, &CuttingCoefficients::kae};
  ForceMatrix sum{};
  forEachSlice(tool, engagement, bottom,
               [&](const EdgeSlice& slice, const ToolGeometry& mill, const Engagement& part) {
                 const ForceMatrix local =
                     straightForceMatrix(mill, part, slice.lean() * engagement.axial_feed_per_tooth);
                 for (std::size_t c = 0; c < 6; ++c) {
                   CuttingLaw unit;
                   unit.coefficients.*ALL[c] = 1.0;
                   const CuttingCoefficients rotated = lawOf(slice, unit).coefficients;
                   for (std::size_t r = 0; r < 4; ++r)
                     for (std::size_t k = 0; k < 6; ++k) sum[r][c] += local[r][k] * rotated.*ALL[k];
                 }
               });
  return sum;
}

// The edge at an immersion of pi/2: x along the feed, y along the cutting speed, z along the edge.
std::array<std::array<double, 6>, 4> turningForceMatrix(const ToolGeometry& tool,
                                                        const Engagement& engagement) {
  const double edge = engagement.axial_depth, feed = engagement.feed_per_tooth, r = tool.radius();
  if (!(tool.diameter > 0.0) || !std::isfinite(tool.diameter))
    refuse("tool diameter", tool.diameter, "m", "> 0");
  if (!(edge > 0.0) || !std::isfinite(edge)) refuse("axial depth", edge, "m", "> 0");
  if (!(feed > 0.0) || !std::isfinite(feed)) refuse("feed per tooth", feed, "m", "> 0 in turning");
  const double chip = edge * feed;
  return {{{0.0, -chip, 0.0, 0.0, -edge, 0.0},
           {chip, 0.0, 0.0, edge, 0.0, 0.0},
           {0.0, 0.0, chip, 0.0, 0.0, edge},
           {r * chip, 0.0, 0.0, r * edge, 0.0, 0.0}}};
}

}  // namespace

std::array<std::array<double, 6>, 4> meanForceMatrix(const ToolGeometry& tool, const Engagement& engagement,
                                                     double bottom) {
  if (tool.teeth == 0) return turningForceMatrix(tool, engagement);
  validate(tool);
  validate(engagement);
  requireBottom(bottom, engagement);
  if (!engagement.bands.empty()) {
    std::array<std::array<double, 6>, 4> sum{};
    for (const EngagementBand& band : engagement.bands) {
      const auto local = meanForceMatrix(tool, engagementOf(band, engagement), band.bottom);
      for (std::size_t r = 0; r < 4; ++r)
        for (std::size_t c = 0; c < 6; ++c) sum[r][c] += local[r][c];
    }
    return sum;
  }
  if (!tool.edge.straight() || bottom > 0.0) return slicedForceMatrix(tool, engagement, bottom);
  return straightForceMatrix(tool, engagement, 0.0);
}

}  // namespace smartmill
