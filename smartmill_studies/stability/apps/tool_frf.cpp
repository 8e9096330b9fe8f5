// rosrun smartmill_studies stability_tool_frf

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "smartmill_core/io/csv.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/coupling/tool_assembly.h"
#include "stability/tool_shop.h"
#include "study_case.h"

namespace {

using namespace smartmill;
using namespace smartmill::stability;

struct Request {
  std::string out;
  int spindles = 20, tools = 25, references = 3;
  unsigned seed = 1;
  double low = 200.0, high = 5900.0;
  bool two_frfs = false;
};

/// Errors of one kind of prediction over all tools.
struct Score {
  std::vector<double> frequency, flexibility;                // [1] relative error
  std::vector<double> frequency_shares, flexibility_shares;  // [1] error over its standard deviation

  int other_mode = 0;  ///< predictions whose largest peak is another mode than that of the truth

  /// The peak of the prediction that belongs to the largest one of the truth, where two modes are nearly
  /// equal.
  void add(const TipPrediction& prediction, const TipPeak& truth) {
    TipPrediction p = prediction;
    p.peak = tipPeak(p.tip, truth.frequency, 0.5);
    other_mode += p.peak.frequency != prediction.peak.frequency;
    frequency.push_back(p.peak.frequency / truth.frequency - 1.0);
    flexibility.push_back(p.peak.flexibility / truth.flexibility - 1.0);
    frequency_shares.push_back((p.peak.frequency - truth.frequency) / p.frequency_std);
    flexibility_shares.push_back((p.peak.flexibility - truth.flexibility) / p.flexibility_std);
  }
  static int within(const std::vector<double>& values, double bound) {
    int count = 0;
    for (const double v : values) count += std::abs(v) <= bound;
    return count;
  }
  void print(const char* name) const {
    const double n = static_cast<double>(frequency.size());
    int both = 0;
    for (std::size_t i = 0; i < frequency.size(); ++i)
      both += std::abs(frequency[i]) <= 0.03 && std::abs(flexibility[i]) <= 0.15;
    std::printf(
        "%s: frequency within 3 %% %.1f %%, flexibility within 15 %% %.1f %%, both %.1f %% of %zu tools; "
        "within "
        "one, two standard deviations: frequency %.1f, %.1f %%, flexibility %.1f, %.1f %%; largest peak of "
        "another "
        "mode: %d\n",
        name, 100.0 * within(frequency, 0.03) / n, 100.0 * within(flexibility, 0.15) / n, 100.0 * both / n,
        frequency.size(), 100.0 * within(frequency_shares, 1.0) / n,
        100.0 * within(frequency_shares, 2.0) / n, 100.0 * within(flexibility_shares, 1.0) / n,
        100.0 * within(flexibility_shares, 2.0) / n, other_mode);
  }
};

void run(const Request& request) {
  Score untapped, tapped;
  CsvWriter csv(
      "spindle,stickout_mm,diameter_mm,true_hz,true_um_per_n,hz,hz_std,um_per_n,um_per_n_std,tapped_hz,"
      "tapped_um_per_n",
      7);
  for (int s = 0; s < request.spindles; ++s) {
    ToolShop shop(seedOfCase(request.seed, s));
    GaugeTaps taps = shop.shop().taps;
    if (request.two_frfs) taps.second.reset();
    AssemblyOptions options;
    const ToolAssembly machine(spindleReceptances(shop.shop().gauge, taps, request.low, request.high),
                               shop.shop().holder, options);
    std::vector<TappedTool> references = shop.shop().references;
    references.resize(static_cast<std::size_t>(request.references));
    const ContactEstimate shared =
        machine.fit(references, ContactEstimate::prior()).forAnotherTool(options.contact_scatter);
    for (int k = 0; k < request.tools; ++k) {
      const DrawnTool drawn = shop.drawTool();
      const TipPeak truth = tipPeak(drawn.tip.band(request.low, request.high));
      const TipPrediction before = machine.predict(drawn.tool, shared);
      const TipPrediction after = machine.predict(drawn.tool, machine.fit({{drawn.tool, drawn.tap}}, shared));
      untapped.add(before, truth);
      tapped.add(after, truth);
      const TipPeak mode = tipPeak(before.tip, truth.frequency, 0.5),
                    own = tipPeak(after.tip, truth.frequency, 0.5);
      csv.row(s, drawn.tool.stickout / units::MM, drawn.tool.diameter / units::MM, truth.frequency,
              truth.flexibility / units::UM, mode.frequency, before.frequency_std,
              mode.flexibility / units::UM, before.flexibility_std / units::UM, own.frequency,
              own.flexibility / units::UM);
    }
    std::fprintf(stderr, "\r%d of %d spindles%s", s + 1, request.spindles,
                 s + 1 == request.spindles ? "\n" : "");
  }
  if (!request.out.empty()) csv.save(request.out);
  untapped.print("not tapped");
  tapped.print("one tap");
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Predicts the tip FRFs of drawn tools in drawn spindles by receptance coupling and compares their "
      "largest "
      "peak with finite elements."};
  line.option("--spindles", request.spindles, "number of spindles (20)").within(1, 1000);
  line.option("--tools", request.tools, "tools in each (25)").within(1, 1000);
  line.option("--references", request.references, "tapped tools that determine the contact (3)").within(1, 3);
  line.option("--seed", request.seed, "of the draws (1)");
  line.flag("--two-frfs", request.two_frfs, "two FRFs of the gauge instead of three");
  line.option("-o,--out", request.out, "CSV of all tools");
  return runProgram(line, argc, argv, [&] {
    run(request);
    return 0;
  });
}
