#include "smartmill_hammer/analysis/frf_pictures.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/units.h"

namespace smartmill::hammer {
namespace {

using Rows = std::vector<std::vector<double>>;

/// Most samples drawn of a hit, and most hits.
constexpr std::size_t MOST_SAMPLES = 1200, MOST_HITS = 24;

double degrees(std::complex<double> value) {
  return units::degFromRad(std::arg(value));
}

/// A vertical line at each mode.
Rows modeLines(const std::vector<EstimatedMode>& modes) {
  Rows rows;
  for (const EstimatedMode& m : modes) {
    rows.push_back({m.frequency, 0.0});
    rows.push_back({m.frequency, 1.0});
    rows.push_back({NAN, NAN});
  }
  if (rows.empty()) rows.push_back({NAN, NAN});
  return rows;
}

}  // namespace

void drawFrf(const FrequencyResponse& frf, const ModalEstimate& estimate, std::size_t index,
             const std::string& title, const std::string& png) {
  const bool coherent = frf.averages > 1 && frf.coherence.size() == frf.size();
  Rows rows;
  for (std::size_t k = 0; k < frf.size(); ++k) {
    const std::complex<double> fit = fittedResponse(estimate, index, frf.frequency[k]);
    rows.push_back({frf.frequency[k], std::abs(frf.value[k]), std::abs(fit), degrees(frf.value[k]),
                    degrees(fit), coherent ? frf.coherence[k] : NAN});
  }
  Gnuplot plot(png, 1200, coherent ? 1000 : 750);
  plot.block("lines", rows);
  plot.block("modes", modeLines(estimate.modes));
  plot << "set multiplot layout " << (coherent ? 3 : 2) << ",1 title " << Gnuplot::quoted(title)
       << "\nset grid\nset lmargin 13\nset xrange [" << frf.frequency.front() << ":" << frf.frequency.back()
       << "]\nset logscale y\nset format y '%.0e'\nset ylabel '|H| [" << (frf.unit == "m/N" ? "m/N" : "N/N")
       << "]'\nplot $lines using 1:2 with lines lw 2 title 'measured', '' using 1:3 with lines lw "
       << "1.5 title 'fit'\nunset logscale y\nset format y '%g'\nset ylabel 'phase [deg]'\nset yrange "
          "[-180:180]\nset ytics 90\n"
       << (coherent ? "" : "set xlabel 'frequency [Hz]'\n")
       << "plot $lines using 1:4 with lines lw 2 title 'measured', '' using 1:5 with lines lw 1.5 title "
          "'fit'\n";
  if (coherent) {
    plot << "set ylabel 'coherence [1]'\nset yrange [0:1.05]\nset ytics auto\nset xlabel 'frequency [Hz]'\n"
         << "plot $lines using 1:6 with lines lw 1.5 title 'coherence', $modes using 1:2 with lines lw 1 dt "
            "2 title 'modes'\n";
  }
  plot << "unset multiplot\n";
  plot.draw();
}

void drawStabilization(const std::vector<NamedFrf>& frfs, const ModalEstimate& estimate,
                       const std::string& png) {
  Rows stable, others, magnitudes;
  int largest = 2;
  for (const Pole& p : estimate.diagram) {
    (p.stable ? stable : others).push_back({p.frequency, static_cast<double>(p.order)});
    largest = std::max(largest, p.order);
  }
  for (Rows* rows : {&stable, &others}) {
    if (rows->empty()) rows->push_back({NAN, NAN});
  }
  const FrequencyResponse& first = frfs.front().frf;
  for (std::size_t k = 0; k < first.size(); ++k) {
    double sum = 0.0;
    for (const NamedFrf& frf : frfs) sum += std::norm(frf.frf.value[k]);
    magnitudes.push_back({first.frequency[k], std::sqrt(sum)});
  }
  Gnuplot plot(png, 1200, 700);
  plot.block("stable", stable);
  plot.block("others", others);
  plot.block("magnitudes", magnitudes);
  plot.block("modes", modeLines(estimate.modes));
  plot.block("doubts", modeLines(estimate.doubts));
  plot << "set grid\nset key outside bottom horizontal\nset xlabel 'frequency [Hz]'\nset ylabel 'order'\nset "
          "yrange [0:"
       << largest + 1
       << "]\nset y2label 'magnitude of all FRFs'\nset logscale y2\nset format y2 '%.0e'\nset y2tics\nset "
          "ytics "
          "nomirror\nset xrange ["
       << first.frequency.front() << ":" << first.frequency.back() << "]\n"
       << "plot $magnitudes using 1:2 axes x1y2 with lines lc rgb '#b0b0b0' title 'magnitude', $others using "
          "1:2 with "
          "points pt 2 ps 0.5 lc rgb "
       << "'#c08040' title 'pole', $stable using 1:2 with points pt 7 ps 0.5 lc rgb '#2060c0' title 'stable "
          "pole', $modes using 1:($2*"
       << largest + 1 << ") with lines lc rgb '#108010' lw 1.5 title 'mode', $doubts using 1:($2*"
       << largest + 1 << ") with lines dt 2 lc rgb '#c02020' title 'doubt'\n";
  plot.draw();
}

void drawHits(const std::vector<TapRecord>& taps, const std::vector<TapVerdict>& verdicts,
              const std::string& png) {
  const std::size_t hits = std::min(taps.size(), MOST_HITS);
  Gnuplot plot(png, 1100, static_cast<int>(230 * hits + 60));
  for (std::size_t h = 0; h < hits; ++h) {
    const Hit& hit = taps[h].hit;
    const std::size_t first = hit.pre_trigger > MOST_SAMPLES / 8 ? hit.pre_trigger - MOST_SAMPLES / 8 : 0;
    Rows rows;
    for (std::size_t i = first; i < std::min(hit.force.size(), first + MOST_SAMPLES); ++i)
      rows.push_back({1e3 * static_cast<double>(i) / hit.sample_rate, hit.force[i], hit.response[i]});
    plot.block("hit" + std::to_string(h), rows);
  }
  plot << "set multiplot layout " << hits
       << ",1\nset grid\nset ytics nomirror\nset y2tics\nset lmargin 10\nset rmargin 12\n"
       << "set ylabel 'force [N]'\nset y2label 'response'\n";
  for (std::size_t h = 0; h < hits; ++h) {
    const TapVerdict& v = verdicts[h];
    const std::size_t slash = v.file.find_last_of('/');
    const std::string name = slash == std::string::npos ? v.file : v.file.substr(slash + 1);
    plot << "set title "
         << Gnuplot::quoted(name + ": " + (v.accepted() ? "accepted" : "rejected, " + v.reason))
         << " textcolor rgb '" << (v.accepted() ? "#108010" : "#c02020") << "'\n"
         << (h + 1 == hits ? "set xlabel 'time [ms]'\n" : "") << "plot $hit" << h
         << " using 1:2 with lines lw 1.5 title 'force', '' using 1:3 axes x1y2 "
         << "with lines title 'response'\n";
  }
  plot << "unset multiplot\n";
  plot.draw();
}

}  // namespace smartmill::hammer
