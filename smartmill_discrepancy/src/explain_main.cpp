// rosrun smartmill_discrepancy explain CAMPAIGN: where twin and records part, and which effect is missing.

#include <chrono>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>

#include <CLI/CLI.hpp>

#include "smartmill_discrepancy/search.h"

namespace {

void run(const std::string& folder, const std::string& model_file, int threads) {
  using namespace smartmill;
  using namespace smartmill::discrepancy;
  const auto begin = std::chrono::steady_clock::now();
  const auto say = [&](const std::string& line) {
    const double t = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    std::fprintf(stderr, "[%5.1f s] %s\n", t, line.c_str());
  };
  const Campaign campaign = readCampaign(folder);
  const Dataset data =
      loadDataset(campaign, readMachineModel(model_file.empty() ? campaign.modelPath() : model_file));
  std::vector<std::string> notes = data.notes;
  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, &notes);
  for (const std::string& note : notes) say("note: " + note);
  std::vector<std::size_t> fitted;
  for (std::size_t t = 0; t < data.tests.size(); ++t) {
    if (data.tests[t].heldout) {
      say("held out: " + data.tests[t].test.name);
    } else {
      fitted.push_back(t);
    }
  }
  SearchOptions options;
  options.threads = threads;
  options.progress = say;
  const NominalFreedom freedom(data.nominal);
  const TwinRunner quick_runner(data, fitted, threads, options.screening_substeps);
  const TwinRunner exact_runner(data, fitted, threads, options.final_substeps);
  const Fitter quick(quick_runner, freedom), exact(exact_runner, freedom);
  const SearchResult result = search(quick, exact, hypotheses, options);
  (void)result;
  say("done");
}

}  // namespace

int main(int argc, char** argv) {
  std::string campaign, model, out;
  int threads = 2;
  CLI::App app{"Finds where twin and records of a campaign part and which effects the model lacks."};
  app.add_option("campaign", campaign, "campaign folder")->required();
  app.add_option("--model", model, "machine model file (default: the campaign's)");
  app.add_option("-o,--out", out, "folder of the report")->required();
  app.add_option("--threads", threads, "threads")->check(CLI::Range(1, 64));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  try {
    run(campaign, model, threads);
  } catch (const std::exception& e) {
    std::cerr << "explain: " << e.what() << "\n";
    return 1;
  }
  return 0;
}
