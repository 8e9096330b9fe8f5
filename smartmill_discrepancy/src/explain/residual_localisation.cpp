#include "smartmill_discrepancy/explain/residual_localisation.h"

#include "explain/forms/form_family.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill::discrepancy {
namespace {

std::map<std::string, std::vector<ChannelResidual>> residualByChannel(const TwinRunner& runner,
                                                                      const std::vector<double>& residual) {
  std::map<std::string, std::vector<ChannelResidual>> channels;
  for (const ChannelSpan& b : runner.spans()) {
    if (b.slow || !b.in_gap) continue;
    ChannelResidual channel{&runner.data().tests[b.test], valuesOf(residual, b), 0.0, b.noise};
    channel.mean = mean(channel.values);
    for (double& v : channel.values) v -= channel.mean;
    channels[b.channel].push_back(std::move(channel));
  }
  return channels;
}

}  // namespace

bool isForm(const Hypothesis& h, const char* form, const std::string& variant) {
  return h.effect == std::string(EMPIRICAL) + ":" + form && h.variant.rfind(variant, 0) == 0;
}

std::vector<Hypothesis> localisedForms(const TwinRunner& runner, const std::vector<Hypothesis>& all,
                                       const FitResult& now, const std::vector<Finding>& unexplained) {
  const FormContext context{runner, all, now, unexplained, residualByChannel(runner, now.residual)};
  std::vector<Hypothesis> located;
  for (const auto& make : {makeLines, makeSteps, makeBursts, makeResonances, makeForceCourses})
    make()->locate(context, &located);
  return located;
}

}  // namespace smartmill::discrepancy
