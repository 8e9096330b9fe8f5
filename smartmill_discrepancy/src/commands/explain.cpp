#include "smartmill_discrepancy/commands.h"

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <iostream>
#include <optional>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/io/inspection_file.h"
#include "smartmill_core/stop_signal.h"
#include "smartmill_discrepancy/explain/explain.h"
#include "smartmill_discrepancy/recordings/bag_campaign.h"
#include "smartmill_discrepancy/recordings/path_campaign.h"
#include "smartmill_discrepancy/report/report_html.h"
#include "smartmill_discrepancy/report/report_json.h"
#include "smartmill_discrepancy/report/summary.h"
#include "smartmill_recording/recording_file.h"

namespace {

using namespace smartmill;
using namespace smartmill::discrepancy;

struct Arguments {
  std::string campaign, model, prior, inspection, out;
  int threads = 2;
  double budget = 60.0;
};

Campaign load(const Arguments& arguments, const std::function<void(const std::string&)>& progress) {
  const std::string folder = arguments.out + "/campaign";
  std::error_code failed;
  if (isRecording(arguments.campaign)) {
    if (arguments.model.empty())
      throw Error(arguments.campaign + ": a bag contains no model; state one with --model");
    std::filesystem::remove_all(folder, failed);
    return campaignOfBag(arguments.campaign, arguments.model, folder, progress);
  }
  const Campaign campaign = readCampaignWithPaths(arguments.campaign);
  if (!hasPaths(campaign)) return campaign;
  std::filesystem::remove_all(folder, failed);
  return campaignOfPaths(campaign, arguments.model.empty() ? campaign.modelPath() : arguments.model, folder,
                         progress);
}

// @return exit status
int run(const Arguments& arguments) {
  const auto begin = std::chrono::steady_clock::now();
  ExplainOptions options;
  options.bench.threads = arguments.threads;
  if (!arguments.prior.empty()) options.search.prior = readCauseOdds(arguments.prior);
  options.bench.cancelled = stopRequested;
  const auto elapsed = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  options.search.on_log = [&](const std::string& line) {
    std::fprintf(stderr, "[%5.1f s] %s\n", elapsed(), line.c_str());
  };
  if (arguments.budget > 0.0) {
    options.budget = arguments.budget;
    options.elapsed = elapsed;
  }
  std::error_code failed;
  std::filesystem::create_directories(arguments.out, failed);
  if (failed) throw Error(arguments.out + ": " + failed.message());
  const Campaign campaign = load(arguments, options.search.on_log);
  const Dataset data = loadDataset(
      campaign, readMachineModel(arguments.model.empty() ? campaign.modelPath() : arguments.model));
  std::optional<InspectionFile> inspection;
  if (!arguments.inspection.empty()) inspection = readInspectionFile(arguments.inspection);
  catchInterrupt("cancelled: the effects found so far are validated and written (again: end at once)\n");
  Explanation explanation = explain(data, options, arguments.out);
  if (inspection) {
    explanation.inspection = checkInspection(*inspection, campaign.tests, data.nominal, explanation.model);
    const std::vector<std::string>& notes = explanation.inspection.notes;
    explanation.notes.insert(explanation.notes.end(), notes.begin(), notes.end());
  }
  writeReport(explanation, arguments.out);
  writeHtml(explanation, arguments.campaign, arguments.out);
  std::cout << summaryOf(explanation);
  return explanation.interrupted ? INTERRUPTED : 0;
}

}  // namespace

namespace smartmill::discrepancy {

Command explainCommand() {
  Command command("explain", "finds which effects a machine model lacks, from a campaign or a bag");
  command.description =
      "Finds where the twin and the records of a campaign disagree and which effects the model lacks.";
  command.examples = {{"campaigns/runout -o report", "searches a campaign; report/report.html is the result"},
                      {"session.bag --model mill.yaml -o report --budget 0",
                       "the same for a recorded session, without a limit of its time"}};
  command.files = {{"OUT/report.html", "the report for the machine: causes, what to do, next test"},
                   {"OUT/report.json", "the report for programs"},
                   {"OUT/model.yaml", "the model with the effects found"}};
  command.exits = {{INTERRUPTED, "interrupted by Ctrl-C; the report contains the effects found until then"}};
  command.setBody(run, [](CommandLine& line, Arguments& arguments) {
    line.option("CAMPAIGN", arguments.campaign, "campaign folder, or a bag").required();
    line.option("--model", arguments.model, "machine model file (default: the campaign's)");
    line.option("--prior", arguments.prior,
                "odds of each effect from other machines (`database proposals --prior` writes them)");
    line.option(
        "--inspection", arguments.inspection,
        "measured dimensions of the cuts (smartmill-inspection/1), compared with the model before and after");
    line.option("-o,--out", arguments.out, "folder of the report").required();
    line.option("--budget", arguments.budget,
                "seconds after which the best result so far is judged and written; 0: none")
        .within(0, 1e6)
        .showDefault();
    line.option("--threads", arguments.threads, "threads").within(1, 64).showDefault();
  });
  return command;
}

}  // namespace smartmill::discrepancy
