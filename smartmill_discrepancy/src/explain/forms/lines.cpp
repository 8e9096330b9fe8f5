#include <algorithm>
#include <cmath>

#include "explain/forms/form_family.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/effect_catalogue.h"

namespace smartmill::discrepancy {
namespace {

struct LineOptions {
  std::size_t most = 12;    ///< lines, the strongest findings first: each costs a simulation
  double min_cycles = 4.0;  ///< of the longest record: with fewer a sine follows a drift
  double resolved = 2.0;    ///< cycles of the longest record between two tones of a channel
};

// A line of the residual as a hypothesis at its order or frequency.
void addLine(const std::vector<Hypothesis>& forms, const char* form, const Finding& f, double location,
             std::vector<Hypothesis>* lines) {
  const bool by_order = f.domain == "order";
  for (const Hypothesis& h : forms) {
    if (!isForm(h, form, f.channel)) continue;
    Hypothesis line = h;
    line.named(h.variant + formatted(by_order ? ", order %.4g" : ", %.4g Hz", location));
    const double size = std::max(f.amplitude, h.coordinates.back().step);
    if (by_order) {
      line.number("order", location).probe({0.0}, {{size}});
    } else {
      line.probe({location, 0.0}, {{location, size}});
    }
    lines->push_back(std::move(line));
  }
}

double longestRecord(const Dataset& data) {
  double longest = 0.0;
  for (const TestData& t : data.tests) {
    if (t.record.size() > 1) longest = std::max(longest, t.record.time.back() - t.record.time.front());
  }
  return longest;
}

// Whether a line differs from a slow drift, which a sine with free phases in each record can follow, and from
// an existing tone of the channel, with which it would form individual amplitudes.
bool isTone(const Dataset& data, const FitState& state, const Finding& f, const LineOptions& options) {
  const double frequency = f.location.at("frequency_hz"), longest = longestRecord(data);
  return frequency * longest > options.min_cycles &&
         std::none_of(state.members.begin(), state.members.end(), [&](const Member& m) {
           const EffectEntry e = m.hypothesis->entry(m.values);
           return e.name == std::string(EMPIRICAL) + ":tone" && e.words.at("channel") == f.channel &&
                  std::abs(e.numbers.at("frequency_hz") - frequency) * longest < options.resolved;
         });
}

/// Tones and orders at the findings.
class Lines : public FormFamily {
 public:
  void locate(const FormContext& context, std::vector<Hypothesis>* located) const override {
    for (const Finding& f : context.unexplained) {
      if (located->size() >= options_.most) break;
      if (f.domain == "frequency" && isTone(context.runner.data(), context.now.state, f, options_))
        addLine(context.forms, "tone", f, f.location.at("frequency_hz"), located);
      if (f.domain == "order") addLine(context.forms, "order", f, f.location.at("order"), located);
    }
  }

 private:
  LineOptions options_;
};

}  // namespace

std::unique_ptr<FormFamily> makeLines() {
  return std::make_unique<Lines>();
}

}  // namespace smartmill::discrepancy
