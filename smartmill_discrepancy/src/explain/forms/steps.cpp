#include <algorithm>
#include <utility>
#include <vector>

#include "explain/forms/form_family.h"
#include "smartmill_core/formatted.h"

namespace smartmill::discrepancy {
namespace {

struct StepOptions {
  double min_gain = 50.0;  ///< [squares] chance maximum over all positions of a record
};

struct Step {
  double at = 0.0;    // [s]
  double size = 0.0;  // over the noise
  double gain = 0.0;  // squares
};

// One step at the same time of every record.
Step stepInRecords(const std::vector<ChannelResidual>& tests) {
  const double rate = tests.front().test->test.sample_rate;
  std::vector<double> product, squares;  // with the step, and of the step itself, by its sample
  for (const ChannelResidual& t : tests) {
    if (t.test->test.sample_rate != rate) continue;
    const std::size_t n = t.values.size();
    if (product.size() < n) product.resize(n, 0.0), squares.resize(n, 0.0);
    double after = 0.0;
    for (std::size_t i = n - 1; i > 0; --i) {
      after += t.values[i];
      const double share = static_cast<double>(n - i) / static_cast<double>(n);
      product[i] += after;
      squares[i] += static_cast<double>(i) * share;
    }
  }
  Step best;
  for (std::size_t i = 1; i < product.size(); ++i) {
    const double gain = product[i] * product[i] / squares[i];
    if (gain > best.gain) best = {(static_cast<double>(i) - 0.5) / rate, product[i] / squares[i], gain};
  }
  return best;
}

// [s] since the cold start, of a record.
double endOf(const TestData& test) {
  return *test.test.start_time + static_cast<double>(test.record.size()) / test.test.sample_rate;
}

// The same step at each time between two tests from one time to another: other tests than those of the
// residual may lie there.
std::vector<Step> betweenTests(const Dataset& data, const Step& step, double from, double to) {
  std::vector<std::pair<double, double>> records;
  for (const TestData& t : data.tests) {
    if (t.test.start_time && *t.test.start_time > from && *t.test.start_time < to)
      records.emplace_back(*t.test.start_time, endOf(t));
  }
  records.emplace_back(to, to);
  std::sort(records.begin(), records.end());
  std::vector<Step> steps;
  for (const auto& [begin, end] : records) {
    steps.push_back({0.5 * (from + begin), step.size, step.gain});
    from = end;
  }
  return steps;
}

// One step between two tests.
std::vector<Step> stepBetweenTests(const Dataset& data, std::vector<ChannelResidual> tests) {
  tests.erase(std::remove_if(tests.begin(), tests.end(),
                             [](const ChannelResidual& t) { return !t.test->test.start_time; }),
              tests.end());
  std::sort(tests.begin(), tests.end(), [](const ChannelResidual& a, const ChannelResidual& b) {
    return *a.test->test.start_time < *b.test->test.start_time;
  });
  double all = 0.0, sum = 0.0;
  for (const ChannelResidual& t : tests) {
    all += static_cast<double>(t.values.size());
    sum += t.mean * static_cast<double>(t.values.size());
  }
  Step best;
  double from = 0.0, to = 0.0, before = 0.0, product = 0.0;
  for (std::size_t k = 0; k + 1 < tests.size(); ++k) {
    const ChannelResidual& t = tests[k];
    const auto n = static_cast<double>(t.values.size());
    before += n;
    product -= n * (t.mean - sum / all);
    const double squares = before * (all - before) / all, gain = product * product / squares;
    if (gain <= best.gain) continue;
    best = {0.0, product / squares, gain};
    from = endOf(*t.test);
    to = *tests[k + 1].test->test.start_time;
  }
  return betweenTests(data, best, from, to);
}

/// The best step of each channel, at a time of every record and between two tests.
class Steps : public FormFamily {
 public:
  void locate(const FormContext& context, std::vector<Hypothesis>* located) const override {
    for (const auto& [channel, tests] : context.channels) {
      for (const Hypothesis& h : context.forms) {
        if (!isForm(h, "step", channel + ",")) continue;
        const bool record = h.variant == channel + ", record";
        const std::vector<Step> steps =
            record ? std::vector<Step>{stepInRecords(tests)} : stepBetweenTests(context.runner.data(), tests);
        for (const Step& step : steps) {
          if (step.gain < options_.min_gain) continue;
          Hypothesis at = h;
          at.number("at_s", step.at).probe({0.0}, {{step.size * tests.front().noise}});
          located->push_back(at.named(h.variant + formatted(", %.5g s", step.at)));
        }
      }
    }
  }

 private:
  StepOptions options_;
};

}  // namespace

std::unique_ptr<FormFamily> makeSteps() {
  return std::make_unique<Steps>();
}

}  // namespace smartmill::discrepancy
