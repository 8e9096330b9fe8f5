#include "smartmill_discrepancy/report/pictures.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <sstream>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"

namespace smartmill::discrepancy {
namespace {

// Tests from left to right, channels from bottom to top, colour: logarithm of the gap.
std::string gapMap(const Explanation& e, bool after) {
  std::vector<std::string> tests, channels;
  const auto index = [](std::vector<std::string>& names, const std::string& name) {
    const auto at = std::find(names.begin(), names.end(), name);
    if (at != names.end()) return static_cast<std::size_t>(at - names.begin());
    names.push_back(name);
    return names.size() - 1;
  };
  std::ostringstream data;
  for (const TestGap& g : e.gaps) {
    const std::size_t x = index(tests, g.test + (g.heldout ? " (held out)" : "")),
                      y = index(channels, g.channel);
    data << x << " " << y << " " << std::max(after ? g.after : g.before, 0.5) << "\n";
  }
  std::ostringstream out;
  out << "$map << EOD\n" << data.str() << "EOD\nset title '" << (after ? "gap after" : "gap before") << "'\n";
  out << "set logscale cb\nset cbrange [0.9:100]\nset palette defined (0 '#f7fbff', 0.1 '#c6dbef', 0.5 "
         "'#fd8d3c', 1 '#7f0000')\n";
  out << "set xrange [-0.5:" << tests.size() << "-0.5]\nset yrange [-0.5:" << channels.size()
      << "-0.5]\nset xtics rotate by -60 (";
  for (std::size_t k = 0; k < tests.size(); ++k)
    out << (k ? "," : "") << Gnuplot::quoted(tests[k]) << " " << k;
  out << ")\nset ytics (";
  for (std::size_t k = 0; k < channels.size(); ++k)
    out << (k ? "," : "") << Gnuplot::quoted(channels[k]) << " " << k;
  out << ")\nplot $map using 1:2:(0.5):(0.5):3 with boxxyerror fillstyle solid 1.0 border lc 'white' fc "
         "palette notitle, "
         "$map using 1:2:(sprintf('%.2g', $3)) with labels font ',7' notitle\n";
  return out.str();
}

// Curves of the first test, which has the largest residual.
std::size_t picturedRevolutions(const Explanation& e) {
  return static_cast<std::size_t>(
      std::count_if(e.revolutions.begin(), e.revolutions.end(),
                    [&](const RevolutionCurve& c) { return c.test == e.revolutions.front().test; }));
}

std::string revolutions(const Explanation& e, std::size_t n) {
  std::ostringstream out;
  for (std::size_t k = 0; k < n; ++k) {
    const RevolutionCurve& c = e.revolutions[k];
    out << "$c" << k << " << EOD\n";
    for (std::size_t i = 0; i < c.angle_deg.size(); ++i)
      out << c.angle_deg[i] << " " << c.measured[i] << " " << c.nominal[i] << " " << c.improved[i] << "\n";
    out << "EOD\n";
  }
  out << "set multiplot layout " << (n + 1) / 2
      << ",2\nset grid\nset xrange [0:360]\nset xtics 60\nset xlabel 'spindle angle [deg]'\n";
  for (std::size_t k = 0; k < n; ++k) {
    out << "set title " << Gnuplot::quoted(e.revolutions[k].channel + ", " + e.revolutions[k].test)
        << "\nplot $c" << k
        << " u 1:2 w p pt 7 ps 0.4 lc 'black' t 'measured', '' u 1:3 w l lw 1.5 lc '#d95f02' t 'nominal', '' "
           "u 1:4 w l lw 1.5 lc "
           "'#1b9e77' t 'improved'\n";
  }
  out << "unset multiplot\n";
  return out.str();
}

std::string spectra(const Explanation& e) {
  std::ostringstream out;
  const std::size_t n = e.spectra.size();
  for (std::size_t k = 0; k < n; ++k) {
    const SpectrumCurve& s = e.spectra[k];
    out << "$s" << k << " << EOD\n";
    for (std::size_t i = 0; i < s.frequency_hz.size(); ++i)
      out << s.frequency_hz[i] << " " << s.before[i] << " " << s.after[i] << "\n";
    out << "EOD\n";
  }
  out << "set multiplot layout " << (n + 1) / 2
      << ",2\nset grid\nset logscale y\nset xlabel 'frequency [Hz]'\nset format y '%.0e'\n";
  for (std::size_t k = 0; k < n; ++k) {
    const SpectrumCurve& s = e.spectra[k];
    const std::string order = s.order_hz > 0.0 ? formatted(" (one order: %.4g Hz)", s.order_hz) : "";
    out << "unset arrow\n";
    for (const std::vector<Finding>* list : {&e.where, &e.unexplained}) {
      for (const Finding& f : *list) {
        if (f.channel != s.channel) continue;
        double at = 0.0;
        if (f.domain == "frequency") at = f.location.at("frequency_hz");
        if (f.domain == "order") at = f.location.at("order") * s.order_hz;
        if (at > 0.0 && at < HIGHEST_PICTURED) {
          out << "set arrow from " << at << ", graph 0.9 to " << at << ", graph 0.82 lc '"
              << (list == &e.where ? "#d95f02" : "#7570b3") << "'\n";
        }
      }
    }
    out << "set title " << Gnuplot::quoted(s.channel + ", " + s.test + order) << "\nplot $s" << k
        << " u 1:2 w l lc '#d95f02' t 'nominal', '' u 1:3 w l lc '#1b9e77' t 'improved'\n";
  }
  out << "unset multiplot\n";
  return out.str();
}

std::string candidateChart(const Explanation& e) {
  std::ostringstream out;
  out << "$l << EOD\n";
  std::vector<std::string> names;
  for (const CandidateResult& r : e.candidates) {
    const std::string name =
        std::to_string(r.round + 1) + ". " + r.effect + (r.variant.empty() ? "" : " " + r.variant);
    out << names.size() << " " << std::max(r.delta_bic, 1.0) << " " << (r.accepted ? 1 : 0) << "\n";
    names.push_back(name);
  }
  out << "EOD\nset logscale x\nset xrange [1:*]\nset yrange [" << names.size()
      << ":-1]\nset xlabel 'BIC gain'\nset grid x\nset ytics (";
  for (std::size_t k = 0; k < names.size(); ++k)
    out << (k ? "," : "") << Gnuplot::quoted(names[k]) << " " << k;
  out << ")\nset title 'candidates by round, accepted ones dark'\n";
  out << "plot $l using (1):1:(1):2:($1-0.35):($1+0.35):($3>0 ? 0x1b9e77 : 0xbbbbbb) with boxxyerror "
         "fillstyle solid lc rgb variable notitle\n";
  return out.str();
}

std::string gapsAfter(const Explanation& e) {
  std::ostringstream out;
  out << "$r << EOD\n";
  for (std::size_t k = 0; k < e.gaps.size(); ++k)
    out << k << " " << e.gaps[k].after << " " << 1.96 * e.gaps[k].std_dev << " "
        << (e.gaps[k].heldout ? 1 : 0) << "\n";
  out << "EOD\nset grid y\nset ylabel 'gap after'\nset title 'residual: 1 is the noise floor; bars: 95 % "
         "interval'\nset xtics rotate by -75 font ',6' (";
  for (std::size_t k = 0; k < e.gaps.size(); ++k)
    out << (k ? "," : "") << Gnuplot::quoted(e.gaps[k].test + " " + e.gaps[k].channel) << " " << k;
  out << ")\nplot 1 w l lc 'black' notitle, $r u 1:($4==0?$2:NaN):3 w yerrorbars pt 7 ps 0.5 lc '#1b9e77' t "
         "'fit tests', "
         "'' u 1:($4==1?$2:NaN):3 w yerrorbars pt 7 ps 0.5 lc '#7570b3' t 'held-out tests'\n";
  return out.str();
}

}  // namespace

std::vector<std::string> drawPictures(const Explanation& e, const std::string& folder) {
  std::vector<std::string> names;
  const auto add = [&](const std::string& name, int width, int height, const std::string& commands) {
    (Gnuplot(folder + "/" + name, width, height, 10) << commands).draw();
    names.push_back(name);
  };
  add("gaps.png", 1200, 900,
      "set multiplot layout 2,1\n" + gapMap(e, false) + gapMap(e, true) + "unset multiplot\n");
  if (const std::size_t n = picturedRevolutions(e))
    add("revolution.png", 1200, 350 * static_cast<int>((n + 1) / 2), revolutions(e, n));
  if (!e.spectra.empty())
    add("spectra.png", 1200, 350 * static_cast<int>((e.spectra.size() + 1) / 2), spectra(e));
  if (!e.candidates.empty())
    add("candidates.png", 1000, 120 + 22 * static_cast<int>(e.candidates.size()), candidateChart(e));
  add("residual.png", 1300, 500, gapsAfter(e));
  return names;
}

}  // namespace smartmill::discrepancy
