#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "convert.h"
#include "module.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/cause_odds.h"
#include "smartmill_discrepancy/data/alignment.h"
#include "smartmill_discrepancy/explain/explain.h"
#include "smartmill_discrepancy/gap/gap.h"
#include "smartmill_discrepancy/report/report_html.h"
#include "smartmill_discrepancy/report/report_json.h"
#include "smartmill_discrepancy/report/summary.h"
#include "work.h"

namespace smartmill::python {
namespace {

using namespace smartmill::discrepancy;

py::object gap(const std::string& path, const std::optional<MachineModel>& given, int threads) {
  struct Found {
    CampaignGap gap;
    std::map<std::string, double> noise;
    std::vector<std::string> notes;
  };
  const Found found = interruptible(py::none(), [=](Work& work) {
    const Campaign campaign = readCampaign(path);
    const MachineModel nominal = readMachineModel(campaign.modelPath());
    // The noise is that of the campaign, whatever model is compared with it.
    Dataset data = loadDataset(campaign, nominal);
    work.check();
    const MachineModel model = given.value_or(nominal);
    alignPhases(data, model);
    work.check();
    return Found{campaignGap(data, model, threads), data.noise, data.notes};
  });
  return make("GapResult", found.gap.overall,
              tupleOf(found.gap.channels,
                      [](const ChannelGap& row) {
                        return make("ChannelGap", row.test, row.channel, row.gap, row.residual_rms);
                      }),
              found.noise, py::tuple(py::cast(found.notes)));
}

py::object toPython(const GapPair& pair) {
  return make("Gap", pair.fit, pair.heldout);
}

py::object toPython(const Finding& finding) {
  return make("Finding", finding.channel, py::tuple(py::cast(finding.tests)), finding.domain,
              finding.location, py::tuple(py::cast(finding.depends_on)), finding.amplitude,
              finding.share_of_gap, finding.p_value);
}

py::object toPython(const FoundEffect& effect) {
  py::dict parameters;
  py::dict modulo;
  for (const FoundParameter& p : effect.parameters) {
    parameters[p.key.c_str()] = estimate(p.known(), p.std_dev);
    if (p.modulo > 0.0) modulo[p.key.c_str()] = p.modulo;
  }
  py::dict alternatives;
  for (const Rival& rival : effect.alternatives) alternatives[rival.name.c_str()] = rival.delta_bic;
  return make("Effect", effect.name, effect.variant, effect.words, parameters, modulo, effect.confidence,
              effect.delta_bic, effect.heldout_gap_reduction, alternatives);
}

py::object toPython(const Explanation& e, const std::string& summary) {
  using py::arg;
  const auto converted = [](const auto& item) { return toPython(item); };
  return make(
      "Explanation", arg("verdict") = nameOf(e.verdict), arg("sentence") = e.sentence,
      arg("effects") = tupleOf(e.effects, converted),
      arg("recalibrated") = tupleOf(e.recalibrated,
                                    [](const RecalibratedValue& v) {
                                      return make("RecalibratedValue", v.name, v.before, v.after, v.std_dev,
                                                  v.deviations);
                                    }),
      arg("gap_before") = toPython(e.before), arg("gap_after") = toPython(e.after),
      arg("gap_named_only") = e.named_only ? toPython(*e.named_only) : py::object(py::none()),
      arg("where") = tupleOf(e.where, converted), arg("unexplained") = tupleOf(e.unexplained, converted),
      arg("resembles") = tupleOf(
          e.resembles, [](const Resemblance& r) { return make("Resemblance", r.name, r.variant, r.reason); }),
      arg("not_separable") =
          tupleOf(e.not_separable, [](const auto& names) { return py::tuple(py::cast(names)); }),
      arg("suggested_test") = e.suggested_test,
      arg("gaps") = tupleOf(e.gaps,
                            [](const TestGap& g) {
                              return make("TestGap", g.test, g.channel, g.heldout, g.before, g.after,
                                          g.std_dev);
                            }),
      arg("channels") = tupleOf(e.channels,
                                [](const ChannelShare& c) {
                                  return make("ChannelShare", c.channel, c.explained_before,
                                              c.explained_after, c.explained_heldout, c.synchronous_share,
                                              c.floor, c.floor_gap);
                                }),
      arg("revolutions") = tupleOf(e.revolutions,
                                   [](const RevolutionCurve& r) {
                                     return make("RevolutionCurve", r.test, r.channel, arrayOf(r.angle_deg),
                                                 arrayOf(r.measured), arrayOf(r.nominal),
                                                 arrayOf(r.improved));
                                   }),
      arg("model") = e.model, arg("notes") = py::tuple(py::cast(e.notes)), arg("interrupted") = e.interrupted,
      arg("spent_budget") = e.spent_budget, arg("not_tried") = py::tuple(py::cast(e.not_tried)),
      arg("seconds") = e.seconds, arg("summary") = summary);
}

py::object explainCampaign(const std::string& path, const std::optional<MachineModel>& given,
                           const std::string& out, bool report, int threads,
                           const std::optional<std::string>& prior, std::optional<double> budget,
                           const py::object& progress) {
  Explanation found = interruptible(progress, [=](Work& work) {
    double done = 0.0;
    ExplainOptions options;
    options.bench.threads = threads;
    if (prior) options.search.prior = readCauseOdds(*prior);
    options.bench.cancelled = [&work] { return work.cancelled(); };
    if (budget) {
      options.budget = *budget;
      options.elapsed = [begin = std::chrono::steady_clock::now()] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      };
    }
    options.search.on_log = [&](const std::string& line) { work.progress(done, line); };
    options.search.on_progress = [&](double share) { work.progress(done = share); };
    std::error_code failed;
    std::filesystem::create_directories(out, failed);
    if (failed) throw Error(out + ": " + failed.message());
    const Campaign campaign = readCampaign(path);
    work.progress(0.0, "reading the records");
    const Dataset data = loadDataset(campaign, modelOf(campaign, given));
    Explanation explanation = explain(data, options, out);
    work.check();
    if (report) {
      writeReport(explanation, out);
      writeHtml(explanation, path, out);
    }
    work.progress(1.0);
    return explanation;
  });
  return toPython(found, summaryOf(found));
}

}  // namespace

void addDiscrepancy(py::module_& m) {
  m.def("gap", &gap, py::arg("campaign"), py::arg("model"), py::arg("threads"));
  m.def("explain", &explainCampaign, py::arg("campaign"), py::arg("model"), py::arg("out"), py::arg("report"),
        py::arg("threads"), py::arg("prior"), py::arg("budget"), py::arg("progress"));
}

}  // namespace smartmill::python
