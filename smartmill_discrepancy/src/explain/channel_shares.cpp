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
  double squares = 0.0, before = 0.0, after = 0.0;     // about the mean; what the models leave
  double heldout_squares = 0.0, heldout_after = 0.0;   // of these, in held-out tests
  double periodic_squares = 0.0, floor_squares = 0.0;  // of the steady parts
  double steady = 0.0;                                 // [samples] of them
  double noise = 0.0;                                  // [unit of the channel]
};

// In cut, after the sensor's first ringing; all that repeats is looked at in turns of the spindle.
std::optional<Repeatability> steadyPart(const TestData& test, const std::vector<double>& values) {
  if (!test.record.has("spindle_angle")) return {};
  const std::size_t from = test.first_cut + (values.size() - test.first_cut) / 8;
  const std::vector<double>& angle = test.record.column("spindle_angle");
  const auto part = [from](const std::vector<double>& all) {
    return std::vector<double>(all.begin() + static_cast<std::ptrdiff_t>(from), all.end());
  };
  return repeatability(part(values), part(angle));
}

void add(const TwinRunner& runner, const std::vector<double>& before, const std::vector<double>& after,
         std::map<std::string, Sums>* sums) {
  const std::vector<Block>& blocks = runner.blocks();
  const auto valuesOf = [&](const Block& b) {
    const auto at = runner.measured().begin() + static_cast<std::ptrdiff_t>(b.offset);
    return std::vector<double>(at, at + static_cast<std::ptrdiff_t>(b.size));
  };
  const auto isCut = [&](const Block& b) {
    return b.judged && runner.data().tests[b.test].test.kind == TestKind::cut;
  };
  std::vector<std::optional<Repeatability>> repeat(blocks.size());
  runParallel(blocks.size(), runner.threads(), [&](std::size_t k) {
    // The load meter settles for longer than a record.
    if (isCut(blocks[k]) && blocks[k].channel != "load_meter")
      repeat[k] = steadyPart(runner.data().tests[blocks[k].test], valuesOf(blocks[k]));
  });
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const Block& b = blocks[k];
    if (!isCut(b)) continue;
    const std::vector<double> values = valuesOf(b);
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

void addChannelShares(const Workbench& bench, const Remains& before, const Remains& after,
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
      share.repeats = 1.0 - s.floor_squares / s.periodic_squares;
      share.floor = floor * s.noise;
      share.floor_gap = floor;
    }
    explanation->channels.push_back(share);
  }
}

}  // namespace smartmill::discrepancy
