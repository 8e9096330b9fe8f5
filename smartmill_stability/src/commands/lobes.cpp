#include "smartmill_stability/commands.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "commands/part_limits.h"
#include "commands/speed_variation.h"
#include "commands/surface_error.h"
#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/bistable.h"
#include "smartmill_stability/chart/cut_request.h"
#include "smartmill_stability/chart/picture.h"
#include "smartmill_stability/chart/pitch_design.h"
#include "smartmill_stability/solvers/boundary.h"
#include "smartmill_stability/solvers/model_system.h"
#include "smartmill_stability/solvers/solver.h"

namespace {

using namespace smartmill;

struct Request : stability::CutRequest {
  std::string method = "collocation", boundary, serration, force_curve, surface_error, along_part, variation;
  double max_depth_mm = 0.0, feed_mm = 0.0, tolerance_um = 0.0, best_pitch_rpm = 0.0,
         best_variation_rpm = 0.0;
  bool errors = false;
};

std::string axes(double max_depth_mm) {
  return "set xlabel 'Spindle speed [rpm]'\nset ylabel 'Axial depth [mm]'\nset yrange [0:" +
         std::to_string(max_depth_mm) + "]\n";
}

/// [s] Computing time after which the progress is displayed.
constexpr double QUIET = 1.0;

std::vector<stability::Limit> limitsOf(const stability::StabilitySolver& solver,
                                       const std::vector<double>& speeds, double max_depth) {
  // Pieces overlap by one speed, because the solver compares neighbouring speeds.
  constexpr std::size_t PIECE = 25;
  const auto begin = std::chrono::steady_clock::now();
  std::vector<stability::Limit> limits;
  bool progress = false;
  for (std::size_t i = 0; i < speeds.size(); i += PIECE) {
    const std::size_t from = i > 0 ? i - 1 : 0, to = std::min(i + PIECE + 1, speeds.size());
    const std::vector<double> part(speeds.begin() + static_cast<std::ptrdiff_t>(from),
                                   speeds.begin() + static_cast<std::ptrdiff_t>(to));
    const std::vector<stability::Limit> found = solver.limits(part, max_depth);
    for (std::size_t k = i; k < std::min(i + PIECE, speeds.size()); ++k) limits.push_back(found[k - from]);
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begin;
    if (passed.count() > QUIET || progress) {
      std::fprintf(stderr, "\r%3zu %% of the speeds", 100 * limits.size() / speeds.size());
      progress = true;
    }
  }
  if (progress) std::fprintf(stderr, "\n");
  return limits;
}

void traceAll(const Request& request, const stability::FloquetSolver& solver,
              const std::vector<double>& speeds) {
  if (speeds.size() < 2) throw Error("--boundary: one speed: expected a range of speeds (--speeds)");
  stability::TraceOptions options;
  options.speed_low = speeds.front();
  options.speed_high = speeds.back();
  options.max_depth = request.max_depth_mm * units::MM;
  options.levels = 3;  // resolves tips of pockets down to 1/480 of the speed range
  const auto curves = stability::traceBoundary(solver, options);
  CsvWriter csv("curve,rpm,depth_mm,chatter_hz,kind", 8);
  for (std::size_t c = 0; c < curves.size(); ++c) {
    // A blank line separates the curves for gnuplot.
    if (c > 0) csv.gap();
    for (const stability::BoundaryPoint& p : curves[c].points)
      csv.row(c, units::rpmFromRadPerSec(p.speed), p.depth / units::MM, p.frequency, nameOf(p.kind));
  }
  csv.save(request.boundary);
  stability::drawPicture(request.boundary,
                         axes(request.max_depth_mm) +
                             "plot %FILE skip 1 using 2:3 with lines lw 2 title 'boundary', "
                             "%FILE skip 1 using 2:(strcol(5) eq 'flip' ? $3 : NaN) with points "
                             "pt 7 ps 0.4 title 'flip'");
  std::size_t islands = 0;
  for (const auto& curve : curves) islands += curve.closed;
  std::printf("%zu boundary curves, %zu of them islands\n", curves.size(), islands);
}

/// Adds the chip geometry, and with it the actual contact of the teeth, when a feed is given.
void addChips(const Request& request, stability::RegenerativeSystem& system) {
  if (request.feed_mm == 0.0 && request.serration.empty() && !system.edge.serrated()) return;
  if (!(request.feed_mm > 0.0))
    throw Error("--feed-mm: expected a value above 0 (required by a serrated edge)");
  stability::ChipGeometry chip;
  chip.feed = request.feed_mm * units::MM;
  if (!request.serration.empty()) {
    double amplitude = 0.0, wavelength = 0.0;
    char rest = 0;
    if (std::sscanf(request.serration.c_str(), "%lf:%lf%c", &amplitude, &wavelength, &rest) != 2 ||
        !(amplitude > 0.0) || !(wavelength > 0.0))
      throw Error("--serration-mm " + request.serration + ": expected AMPLITUDE:WAVELENGTH, both above 0");
    system.edge.serration_amplitude = amplitude * units::MM;
    system.edge.serration_wavelength = wavelength * units::MM;
  }
  system.chip = chip;
}

/// Limits of small and large vibrations for a nonlinear force law.
void bistable(const Request& request, stability::Method method) {
  if (!(request.feed_mm > 0.0)) throw Error("--force-curve: requires --feed-mm: expected a value above 0");
  if (!request.serration.empty() || !request.boundary.empty() || request.errors ||
      !request.surface_error.empty())
    throw Error(
        "--force-curve: cannot be combined with --serration-mm, --boundary, --errors or --surface-error");
  const ForceCurves law = readForceCurves(request.force_curve);
  const stability::RegenerativeSystem system = request.system(request.machine());
  const auto found = stability::bistableLimits(system, law, request.feed_mm * units::MM, method, {},
                                               request.speedRange(), request.max_depth_mm * units::MM);
  CsvWriter csv("rpm,limit_mm,chatter_hz,kind,large_limit_mm,secant_limit_mm", 8);
  double range = 0.0, widest = 0.0;
  const auto cell = [](double depth) {
    return std::isfinite(depth) ? formatted("%.8g", depth / units::MM) : std::string();
  };
  for (const stability::BistableLimit& b : found) {
    const bool limited = std::isfinite(b.small.depth);
    csv.row(units::rpmFromRadPerSec(b.speed), cell(b.small.depth),
            limited ? formatted("%.8g", b.small.frequency) : "", limited ? nameOf(b.small.kind) : "",
            cell(b.large.depth), cell(b.secant.depth));
    const double share = limited ? std::max(0.0, 1.0 - b.large.depth / b.small.depth) : 0.0;
    range += share / static_cast<double>(found.size());
    widest = std::max(widest, share);
  }
  csv.save(request.out);
  stability::drawPicture(
      request.out, axes(request.max_depth_mm) +
                       "plot %FILE skip 1 using 1:5:2 with filledcurves lc 'gold' title 'bistable', "
                       "%FILE skip 1 using 1:2 with lines lw 2 lc 'black' title 'limit of small "
                       "vibrations', %FILE skip 1 using 1:5 with lines lw 2 lc 'red' title 'limit of large "
                       "vibrations'");
  const double chip = stability::meanChip(system, request.feed_mm * units::MM);
  std::printf(
      "mean chip thickness %.4f mm: %.2f +- %.2f N/mm tangential, %.2f +- %.2f N/mm radial; slopes %.1f, "
      "%.1f "
      "N/mm2\n",
      chip / units::MM, law.tangential.at(chip) / units::N_PER_MM,
      law.tangential.stdAt(chip) / units::N_PER_MM, law.radial.at(chip) / units::N_PER_MM,
      law.radial.stdAt(chip) / units::N_PER_MM, law.tangential.slope(chip) / units::N_PER_MM2,
      law.radial.slope(chip) / units::N_PER_MM2);
  std::printf(
      "limit of large vibrations below that of small vibrations by %.1f %% on average, by %.1f %% at most\n",
      100.0 * range, 100.0 * widest);
}

/// The pitch angles with the largest limit at one speed.
void printBestPitch(const Request& request, const stability::RegenerativeSystem& system) {
  if (!(request.best_pitch_rpm > 0.0)) throw Error("--best-pitch: expected a speed above 0");
  const stability::PitchDesignOptions options;
  const double max_depth = request.max_depth_mm * units::MM;
  const stability::PitchDesign design =
      stability::designPitch(system, units::radPerSecFromRpm(request.best_pitch_rpm), max_depth, options);
  const auto depth = [&](double limit) {
    return std::isfinite(limit) ? formatted("%.4f mm", limit / units::MM)
                                : formatted("above %.4f mm", request.max_depth_mm);
  };
  std::string angles;
  for (const double pitch : design.pitch)
    angles += (angles.empty() ? "" : ", ") + formatted("%.2f", units::degFromRad(pitch));
  std::printf(
      "pitch for %.1f rpm: %s deg (variation %.2f deg): limit %s, %s with even pitch, within %.1f %% of the "
      "speed\n",
      request.best_pitch_rpm, angles.c_str(), units::degFromRad(design.variation),
      depth(design.least_limit).c_str(), depth(design.even_limit).c_str(), 100.0 * options.speed_margin);
}

/// Writes and draws the limits, and prints the least one.
void writeChart(const Request& request, const std::vector<double>& speeds,
                const std::vector<stability::Limit>& limits) {
  CsvWriter csv("rpm,limit_mm,chatter_hz,kind", 8);
  double least = request.max_depth_mm * units::MM, error = 0.0;
  for (std::size_t i = 0; i < speeds.size(); ++i) {
    const double rpm = units::rpmFromRadPerSec(speeds[i]);
    const stability::Limit& limit = limits[i];
    if (std::isfinite(limit.depth)) {
      csv.row(rpm, limit.depth / units::MM, limit.frequency, nameOf(limit.kind));
      least = std::min(least, limit.depth);
      if (std::isfinite(limit.error)) error = std::max(error, limit.error / limit.depth);
    } else {
      csv.row(rpm, "", "", "");
    }
  }
  csv.save(request.out);
  std::string plot = "plot %FILE skip 1 using 1:2 with lines lw 2 title 'first loss of stability (" +
                     request.method +
                     ")', %FILE skip 1 using 1:(strcol(4) eq 'flip' ? $2 : NaN) with points pt 7 ps 0.4 "
                     "title 'flip'";
  // gnuplot refuses a curve without points.
  if (std::none_of(limits.begin(), limits.end(), [](const auto& l) { return std::isfinite(l.depth); }))
    plot = "plot %FILE skip 1 using 1:(" + std::to_string(request.max_depth_mm) +
           ") with lines lw 2 title 'stable to the largest depth'";
  stability::drawPicture(request.out, axes(request.max_depth_mm) + plot);
  std::printf("stable below %.4f mm at all of these speeds (%s)\n", least / units::MM,
              request.method.c_str());
  if (request.errors) std::printf("largest estimated error of a limit: %.2g %%\n", 100.0 * error);
}

/// Limits along a vibrating workpiece; the chart is that of the least one.
void alongPart(const Request& request, stability::Method method) {
  if (std::isfinite(request.position_mm) || !request.force_curve.empty() || !request.boundary.empty() ||
      request.errors || !request.surface_error.empty() || request.best_pitch_rpm != 0.0)
    throw Error(
        "--along-part: cannot be combined with --position-mm, --force-curve, --boundary, --errors, "
        "--surface-error or --best-pitch");
  const std::vector<double> speeds = request.speedRange();
  const auto limits_at = [&](const MachineModel& there) {
    stability::RegenerativeSystem system = request.system(there);
    addChips(request, system);
    return limitsOf(*stability::makeSolver(method, system), speeds, request.max_depth_mm * units::MM);
  };
  writeChart(request, speeds,
             stability::writePartLimits(request.along_part, request.max_depth_mm, request.machine(), speeds,
                                        limits_at));
}

/// Limits with and without a variation of the speed.
void varied(const Request& request, stability::Method method) {
  if (!request.force_curve.empty() || !request.boundary.empty() || request.errors || request.feed_mm != 0.0 ||
      !request.serration.empty() || !request.surface_error.empty() || request.best_pitch_rpm != 0.0 ||
      !request.along_part.empty())
    throw Error(
        "--speed-variation: cannot be combined with --force-curve, --boundary, --errors, --feed-mm, "
        "--serration-mm, --surface-error, --best-pitch or --along-part");
  stability::VariationRequest out{request.out, request.max_depth_mm,
                                  stability::speedVariationOf(request.variation), request.best_variation_rpm};
  const std::vector<double> speeds = request.speedRange();
  const MachineModel model = request.machine();
  const stability::RegenerativeSystem steady = request.system(model);
  stability::RegenerativeSystem changing = steady;
  changing.variation = out.variation;
  const double max_depth = request.max_depth_mm * units::MM;
  const auto changing_solver = stability::makeSolver(method, changing);
  const auto steady_solver = stability::makeSolver(method, steady);
  stability::writeVariedChart(out, speeds, limitsOf(*changing_solver, speeds, max_depth),
                              limitsOf(*steady_solver, speeds, max_depth));
  if (out.best_rpm != 0.0) stability::printBestVariation(out, model, steady);
}

void run(const Request& request) {
  const stability::Method method = stability::methodOf(request.method);
  if (!(request.max_depth_mm > 0.0)) throw Error("--max-depth-mm: expected a value above 0");
  if (!(request.best_variation_rpm >= 0.0)) throw Error("--best-variation: expected a speed above 0");
  if (request.best_variation_rpm != 0.0 && request.variation.empty())
    throw Error("--best-variation: requires --speed-variation");
  if (!request.variation.empty()) {
    varied(request, method);
    return;
  }
  if (!request.along_part.empty()) {
    alongPart(request, method);
    return;
  }
  if (!request.force_curve.empty()) {
    bistable(request, method);
    return;
  }
  if (request.tolerance_um != 0.0 && request.surface_error.empty())
    throw Error("--tolerance-um: requires --surface-error");
  if (!request.serration.empty() && !request.surface_error.empty())
    throw Error("--surface-error: cannot be combined with --serration-mm");
  const std::vector<double> speeds = request.speedRange();
  const MachineModel model = request.machine();
  stability::RegenerativeSystem system = request.system(model);
  const stability::RegenerativeSystem plain = system;
  addChips(request, system);
  stability::SolverOptions options;
  options.estimate_error = request.errors;
  const auto solver = stability::makeSolver(method, system, options);
  const double max_depth = request.max_depth_mm * units::MM;
  const std::vector<stability::Limit> limits = limitsOf(*solver, speeds, max_depth);

  writeChart(request, speeds, limits);
  if (!request.boundary.empty())
    traceAll(request, *stability::makeFloquetSolver(method, system, options), speeds);
  if (request.best_pitch_rpm != 0.0) printBestPitch(request, plain);
  if (!request.surface_error.empty())
    stability::writeSurfaceMap(
        {request.surface_error, request.feed_mm, request.max_depth_mm, request.tolerance_um}, model, plain,
        speeds);
}

}  // namespace

namespace smartmill::stability {

Command lobesCommand() {
  Command command("lobes", "computes stability lobes of a machine model");
  command.description =
      "Stability lobes of a machine model: the first loss of stability with growing depth, over spindle "
      "speed.";
  command.examples = {
      {"mill.yaml --entry-deg 0 --exit-deg 180 --speeds 2000:12000:201 --max-depth-mm 5 -o chart.csv",
       "a slot, 201 speeds"},
      {"mill.yaml --entry-deg 90 --exit-deg 180 --speeds 2000:12000:101 --max-depth-mm 8 -o chart.csv "
       "--boundary all.csv",
       "down-milling; in addition the whole boundary with its islands"},
      {"mill.yaml --entry-deg 154 --exit-deg 180 --speeds 8000:16000:161 --max-depth-mm 8 -o chart.csv "
       "--surface-error walls.csv --feed-mm 0.08 --tolerance-um 10",
       "finishing by down-milling: the error of the wall, and the cuts that make size"}};
  command.files = {{"OUT", "CSV rpm,limit_mm,chatter_hz,kind; a picture of the same name with .png"},
                   {"BOUNDARY", "CSV curve,rpm,depth_mm,chatter_hz,kind"},
                   {"OUT with --speed-variation", "CSV rpm,limit_mm,chatter_hz,kind,steady_limit_mm"},
                   {"ALONG-PART", "CSV position_mm,rpm,limit_mm,chatter_hz,kind"},
                   {"SURFACE-ERROR",
                    "CSV rpm,depth_mm,stable,error_um,error_std_um,least_um,most_um,peak_to_valley_um,"
                    "mean_deviation_um; empty in unstable cuts"}};
  command.setBody(run, [](CommandLine& line, Request& request) {
    request.addTo(line, "LO:HI:N");
    line.option("--method", request.method,
                "solver: collocation, semi_discretization, multi_frequency, zero_order")
        .showDefault();
    line.option("--max-depth-mm", request.max_depth_mm, "largest depth [mm]").required();
    request.addOutTo(line);
    line.option("--boundary", request.boundary,
                "CSV of the whole boundary with its islands, in addition to the first loss; a picture of the "
                "same name with .png");
    line.option("--along-part", request.along_part,
                "CSV of the limit over positions along a vibrating workpiece and speeds, a map of the same "
                "name with .png; OUT has the least limit over the positions");
    line.option("--feed-mm", request.feed_mm,
                "feed per tooth [mm]: takes the contact of the teeth in the forced vibration into account "
                "(uneven pitch, serration); without it every tooth cuts along its whole arc");
    line.option("--serration-mm", request.serration,
                "AMPLITUDE:WAVELENGTH [mm] of a serrated edge, evenly shifted from tooth to tooth; requires "
                "--feed-mm");
    line.option(
        "--force-curve", request.force_curve,
        "force curve (written by `force-law --curve`) instead of the coefficients of the model: limits of "
        "small and large vibrations; requires --feed-mm");
    line.option(
        "--surface-error", request.surface_error,
        "CSV of surface location error (+ overcut) and roughness along the feed over speeds and depths, "
        "with runout and edge forces of the model; a picture of the same name with .png; requires "
        "--feed-mm");
    line.option("--tolerance-um", request.tolerance_um,
                "tolerance of the wall on either side [um]: prints stable finishing cuts within it; requires "
                "--surface-error");
    line.option("--best-pitch", request.best_pitch_rpm,
                "speed [rpm]: prints the linear variation of the tooth pitch with the largest limit there");
    line.option(
        "--speed-variation", request.variation,
        "AMPLITUDE:RATIO[:triangle]: the speed varies by this share of the mean, at this ratio to the "
        "spindle frequency, as a sine or triangle: limits with and without the variation");
    line.option(
        "--best-variation", request.best_variation_rpm,
        "mean speed [rpm]: prints the variation with the largest limit there, up to AMPLITUDE and RATIO "
        "and the acceleration of the model's spindle; requires --speed-variation");
    line.flag("--errors", request.errors, "estimate the error of each limit from a refined solution");
  });
  return command;
}

}  // namespace smartmill::stability
