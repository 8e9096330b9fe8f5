#include "hammer/tip_figures.h"

#include <array>

#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::studies {
namespace {

using Rows = std::vector<std::vector<double>>;

constexpr std::array<const char*, 4> STYLES = {"lw 4 lc rgb '#b0b0b0'", "lw 1.5 dt 2 lc rgb '#c08040'",
                                               "lw 1.5 dt 4 lc rgb '#c02020'", "lw 1.5 lc rgb '#2060c0'"};

/// @param value of an FRF's line
template <class Value>
Rows rowsOf(const std::vector<TipCurve>& curves, const Value& value) {
  Rows rows;
  for (std::size_t i = 0; i < curves.front().frf.size(); ++i) {
    rows.push_back({curves.front().frf.frequency[i]});
    for (const TipCurve& curve : curves) rows.back().push_back(1e6 * value(curve.frf.value[i]));
  }
  return rows;
}

void plotCurves(Gnuplot& plot, const std::vector<TipCurve>& curves, const char* block) {
  for (std::size_t k = 0; k < curves.size(); ++k)
    plot << (k == 0 ? "plot $" : ", $") << block << " using 1:" << k + 2 << " with lines " << STYLES.at(k)
         << " title '" << curves[k].name << "'";
  plot << "\n";
}

constexpr const char* FRAME =
    "set multiplot layout 2,1\nset grid\nset key above horizontal samplen 2\nset lmargin 10\nset xlabel "
    "'frequency [Hz]'\nset xrange "
    "[100:5000]\n";

}  // namespace

void drawParts(const std::vector<TipCurve>& curves, const std::string& png) {
  Gnuplot plot(png, 900, 900, 12);
  plot.block("real", rowsOf(curves, [](std::complex<double> h) { return h.real(); }));
  plot.block("imag", rowsOf(curves, [](std::complex<double> h) { return h.imag(); }));
  plot << FRAME << "set ylabel 'Re H [um/N]'\n";
  plotCurves(plot, curves, "real");
  plot << "set ylabel 'Im H [um/N]'\n";
  plotCurves(plot, curves, "imag");
  plot << "unset multiplot\n";
  plot.draw();
}

std::vector<StabilityLimit> drawSlotLimits(const std::vector<TipCurve>& curves, const std::string& png) {
  constexpr double KT = 796e6, RADIAL = 0.21, SLOWEST = 3000.0, FASTEST = 20000.0;
  const stability::RegenerativeProcess slot{4, 0.0, units::PI, KT, RADIAL};
  std::vector<double> speeds;
  for (double rpm = SLOWEST; rpm <= FASTEST; rpm += 20.0) speeds.push_back(units::radPerSecFromRpm(rpm));
  std::vector<StabilityLimit> limits;
  for (const TipCurve& curve : curves)
    limits.push_back(stability::zeroOrderLimit(slot, stability::responseOf(curve.frf, curve.frf), speeds));
  Rows depths;
  for (std::size_t i = 0; i < speeds.size(); ++i) {
    depths.push_back({units::rpmFromRadPerSec(speeds[i])});
    for (const StabilityLimit& limit : limits) depths.back().push_back(1e3 * limit.depth[i]);
  }
  Gnuplot plot(png, 900, 900, 12);
  plot.block("sizes", rowsOf(curves, [](std::complex<double> h) { return std::abs(h); }));
  plot.block("depths", depths);
  plot << FRAME << "set logscale y\nset ylabel '|H| [um/N]'\n";
  plotCurves(plot, curves, "sizes");
  plot
      << "unset logscale y\nset xlabel 'spindle speed [rpm]'\nset ylabel 'limit of a slot [mm]'\nset xrange ["
      << SLOWEST << ":" << FASTEST << "]\nset yrange [0:*]\n";
  plotCurves(plot, curves, "depths");
  plot << "unset multiplot\n";
  plot.draw();
  return limits;
}

}  // namespace smartmill::studies
