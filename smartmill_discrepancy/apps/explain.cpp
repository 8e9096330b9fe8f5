// rosrun smartmill_discrepancy explain CAMPAIGN: where twin and records part, and which effect is missing.

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <iostream>
#include <string>

#include <unistd.h>

#include "node/bag_campaign.h"
#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_discrepancy/explain/explain.h"
#include "smartmill_discrepancy/report/pictures.h"
#include "smartmill_discrepancy/report/report_html.h"
#include "smartmill_discrepancy/report/report_json.h"
#include "smartmill_discrepancy/report/summary.h"

namespace {

using namespace smartmill;
using namespace smartmill::discrepancy;

constexpr int INTERRUPTED = 130;  // exit status

std::atomic<bool> interrupted{false};
static_assert(std::atomic<bool>::is_always_lock_free);

// The first Ctrl-C asks for what has been found, the second ends at once.
void interrupt(int) {
  constexpr char HEARD[] = "cancelled: what was found until now is judged and written (again: end at once)\n";
  [[maybe_unused]] const auto written = write(STDERR_FILENO, HEARD, sizeof(HEARD) - 1);
  interrupted = true;
  std::signal(SIGINT, SIG_DFL);
}

struct Arguments {
  std::string campaign, model, prior, out;
  int threads = 2;
};

Campaign load(const Arguments& arguments, const std::function<void(const std::string&)>& progress) {
  if (std::filesystem::path(arguments.campaign).extension() != ".bag")
    return readCampaign(arguments.campaign);
  if (arguments.model.empty())
    throw Error(arguments.campaign + ": a bag holds no model, give one with --model");
  std::error_code failed;
  std::filesystem::remove_all(arguments.out + "/campaign", failed);
  return campaignOfBag(arguments.campaign, arguments.model, arguments.out + "/campaign", progress);
}

// @return exit status
int run(const Arguments& arguments) {
  const auto begin = std::chrono::steady_clock::now();
  ExplainOptions options;
  options.bench.threads = arguments.threads;
  if (!arguments.prior.empty()) options.search.prior = readCauseOdds(arguments.prior);
  options.bench.cancelled = [] { return interrupted.load(); };
  const auto elapsed = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  options.search.progress = [&](const std::string& line) {
    std::fprintf(stderr, "[%5.1f s] %s\n", elapsed(), line.c_str());
  };
  options.search.course = [&](double share) {
    const double t = elapsed();
    std::fprintf(stderr, "[%5.1f s] about %.0f s more, should nothing else be found\n", t, t / share - t);
  };
  std::error_code failed;
  std::filesystem::create_directories(arguments.out, failed);
  if (failed) throw Error(arguments.out + ": " + failed.message());
  const Campaign campaign = load(arguments, options.search.progress);
  const Dataset data = loadDataset(
      campaign, readMachineModel(arguments.model.empty() ? campaign.modelPath() : arguments.model));
  std::signal(SIGINT, interrupt);
  const Explanation explanation = explain(data, options, arguments.out);
  writeReport(explanation, arguments.out);
  writeHtml(explanation, std::filesystem::path(arguments.campaign).filename().string(),
            drawPictures(explanation, arguments.out), arguments.out);
  std::cout << summaryOf(explanation);
  return explanation.interrupted ? INTERRUPTED : 0;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CommandLine line{"Finds where twin and records of a campaign part and which effects the model lacks."};
  line.option("campaign", arguments.campaign, "campaign folder, or a bag").required();
  line.option("--model", arguments.model, "machine model file (default: the campaign's)");
  line.option("--prior", arguments.prior,
              "odds of each effect by other machines (coefficients_db proposals --prior)");
  line.option("-o,--out", arguments.out, "folder of the report").required();
  line.option("--threads", arguments.threads, "threads").within(1, 64);
  return runProgram(line, argc, argv, [&] { return run(arguments); });
}
