#include "smartmill_discrepancy/hypotheses/hypothesis.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/campaign/record_columns.h"
#include "smartmill_core/model/effect_catalogue.h"

namespace smartmill::discrepancy {
namespace {

EffectScope scopeOf(const Dataset& data) {
  EffectScope scope{data.nominal, {}};
  scope.start_times = scope.cut_times = true;
  double first_cut = 0.0, chip = 0.0, depth = 0.0;
  for (const TestData& t : data.tests) {
    const bool cut = t.test.kind == TestKind::cut;
    scope.channels.insert(t.channels.begin(), t.channels.end());
    for (const SlowMeans& slow : t.slow) scope.channels.insert(slow.channel);
    for (const std::string& column : t.record.names) {
      if (const auto axis = motionAxis(column)) scope.axes.insert(std::string(1, "xyz"[*axis]));
    }
    scope.cuts = scope.cuts || cut;
    scope.start_times = scope.start_times && t.test.start_time;
    scope.cut_times = scope.cut_times && (!cut || t.test.cut_time_before);
    if (t.test.engagement) {
      chip = std::max(chip, t.test.engagement->feed_per_tooth);
      depth = std::max(depth, t.test.engagement->axial_depth);
    }
    const double start = cut ? t.test.start_time.value_or(0.0) : 0.0;
    if (start > 0.0 && (first_cut == 0.0 || start < first_cut)) first_cut = start;
    for (const char* name : {"fx", "fy", "fz"}) {
      if (!t.record.has(name)) continue;
      for (const double f : t.record.column(name))
        scope.largest_force = std::max(scope.largest_force, std::abs(f));
    }
  }
  if (first_cut > 0.0) scope.first_cut = first_cut;
  if (chip > 0.0) scope.largest_chip = chip;
  if (depth > 0.0) scope.largest_depth = depth;
  return scope;
}

}  // namespace

std::vector<Hypothesis> catalogueHypotheses(const Dataset& data, std::vector<Untestable>* untestable) {
  const EffectScope scope = scopeOf(data);
  std::vector<Hypothesis> all;
  for (const EffectKind& kind : effectCatalogue()) {
    const std::optional<std::string> missing = missingNeed(kind, scope);
    if (!missing) {
      for (Hypothesis& form : formsOf(kind, scope)) all.push_back(std::move(form));
    } else if (!missing->empty() && untestable) {
      untestable->push_back({kind.name, *missing});
    }
  }
  return all;
}

std::vector<Hypothesis> empiricalHypotheses(const Dataset& data) {
  const EffectScope scope = scopeOf(data);
  std::vector<Hypothesis> all;
  for (const EffectKind& kind : empiricalCatalogue()) {
    if (missingNeed(kind, scope)) continue;
    for (Hypothesis& form : formsOf(kind, scope)) all.push_back(std::move(form));
  }
  return all;
}

}  // namespace smartmill::discrepancy
