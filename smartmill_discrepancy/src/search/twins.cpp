#include "smartmill_discrepancy/search/twins.h"

#include <algorithm>
#include <cmath>

namespace smartmill::discrepancy {
namespace {

std::vector<std::size_t> testsOf(const Dataset& data, bool heldout) {
  std::vector<std::size_t> tests;
  for (std::size_t t = 0; t < data.tests.size(); ++t) {
    if (data.tests[t].heldout == heldout) tests.push_back(t);
  }
  return tests;
}

}  // namespace

Twins::Twins(const Dataset& dataset, const WorkbenchOptions& options)
    : data(dataset),
      quick(data, testsOf(data, false), options.threads, options.screening_substeps),
      exact(data, testsOf(data, false), options.threads, options.final_substeps),
      guided(data, testsOf(data, false), options.threads, options.final_substeps),
      heldout(data, testsOf(data, true), options.threads, options.final_substeps),
      options_(options) {
  quick.set({freeSubsteps(), options_.quick.slices, false});
  guided.set({options.final_substeps, CORNER_SLICES, true});
}

// Of the unguided quick twin.
int Twins::freeSubsteps() const {
  double substeps = options_.screening_substeps;
  for (const ModalModel* axis : {&data.nominal.tool_tip.x, &data.nominal.tool_tip.y}) {
    for (const Mode& mode : axis->modes) {
      for (const TestData& t : data.tests) {
        if (t.test.kind == TestKind::cut)
          substeps = std::max(
              substeps, std::ceil(options_.quick.steps_per_period * mode.frequency / t.test.sample_rate));
      }
    }
  }
  const double most =
      std::max(options_.quick.max_free_substeps, static_cast<double>(options_.screening_substeps));
  return std::min(static_cast<int>(std::min(substeps, most)), options_.final_substeps);
}

void Twins::readGuidance() {
  for (TwinRunner* runner : all()) runner->readGuidance();
}

void Twins::setGuided(bool is_guided) {
  is_guided_ = is_guided;
  TwinSettings of_quick = quick.settings(), of_heldout = heldout.settings();
  of_quick.guided = of_heldout.guided = is_guided;
  of_quick.substeps = is_guided ? options_.screening_substeps : freeSubsteps();
  quick.set(of_quick);
  heldout.set(of_heldout);
}

}  // namespace smartmill::discrepancy
