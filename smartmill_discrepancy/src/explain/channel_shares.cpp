#include <algorithm>
#include <cmath>
#include <map>

#include "smartmill_core/signal/statistics.h"
#include "smartmill_discrepancy/explain/outcome.h"
#include "smartmill_discrepancy/gap/repeatability.h"

namespace smartmill::discrepancy {
namespace {

// Sums over the cuts of one channel.
struct Sums {
  double squares = 0.0, before = 0.0, after = 0.0;     // about the mean; of the residuals
  double heldout_squares = 0.0, heldout_after = 0.0;   // of held-out tests
  double periodic_squares = 0.0, floor_squares = 0.0;  // of the steady parts
  double steady = 0.0;                                 // [samples] of them
  double noise = 0.0;                                  // [unit of the channel]
};

void add(const TwinRunner& runner, const std::vector<double>& before, const std::vector<double>& after,
         std::map<std::string, Sums>* sums) {
  const std::vector<ChannelSpan>& spans = runner.spans();
  const auto isCut = [&](const ChannelSpan& b) {
    return b.in_gap && runner.data().tests[b.test].test.kind == TestKind::cut;
  };
  std::vector<std::optional<Repeatability>> repeat(spans.size());
  runParallel(spans.size(), runner.threads(), [&](std::size_t k) {
    // The load meter settles more slowly than a record lasts.
    if (isCut(spans[k]) && spans[k].channel != "load_meter")
      repeat[k] =
          steadyRepeatability(runner.data().tests[spans[k].test], valuesOf(runner.measured(), spans[k]));
  });
  for (std::size_t k = 0; k < spans.size(); ++k) {
    const ChannelSpan& b = spans[k];
    if (!isCut(b)) continue;
    const std::vector<double> values = valuesOf(runner.measured(), b);
    const double level = mean(values);
    Sums& s = (*sums)[b.channel];
    s.noise = b.noise;
    for (std::size_t i = 0; i < b.size; ++i) {
      s.squares += (values[i] - level) * (values[i] - level);
      s.before += before[b.offset + i] * before[b.offset + i];
      s.after += after[b.offset + i] * after[b.offset + i];
    }
    if (const std::optional<Repeatability>& r = repeat[k]) {
      const auto samples = static_cast<double>(r->samples);
      s.steady += samples;
      s.periodic_squares += samples * r->variance;
      s.floor_squares += samples * r->floor * r->floor;
    }
  }
}

}  // namespace

void addChannelShares(const Workbench& bench, const ModelResidual& before, const ModelResidual& after,
                      Explanation* explanation) {
  std::map<std::string, Sums> sums;
  add(bench.heldout(), before.heldout, after.heldout, &sums);
  for (auto& [channel, s] : sums) {
    s.heldout_squares = s.squares;
    s.heldout_after = s.after;
  }
  add(bench.fitted(), before.fit, after.fit, &sums);
  for (const auto& [channel, s] : sums) {
    if (s.squares <= 0.0) continue;
    ChannelShare share;
    share.channel = channel;
    share.explained_before = 1.0 - s.before / s.squares;
    share.explained_after = 1.0 - s.after / s.squares;
    if (s.heldout_squares > 0.0) share.explained_heldout = 1.0 - s.heldout_after / s.heldout_squares;
    if (s.steady > 0.0) {
      const double floor = std::sqrt(s.floor_squares / s.steady);
      share.synchronous_share = 1.0 - s.floor_squares / s.periodic_squares;
      share.floor = floor * s.noise;
      share.floor_gap = floor;
    }
    explanation->channels.push_back(share);
  }
}

}  // namespace smartmill::discrepancy
