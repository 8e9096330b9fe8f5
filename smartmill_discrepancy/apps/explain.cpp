// rosrun smartmill_discrepancy explain CAMPAIGN: where twin and records part, and which effect is missing.

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <string>

#include "node/bag_campaign.h"
#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_discrepancy/explain/explanation.h"

namespace {

void run(const std::string& folder, const std::string& model_file, const std::string& out, int threads) {
  using namespace smartmill;
  using namespace smartmill::discrepancy;
  const auto begin = std::chrono::steady_clock::now();
  ExplainOptions options;
  options.search.threads = threads;
  options.search.progress = [&](const std::string& line) {
    const double t = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    std::fprintf(stderr, "[%5.1f s] %s\n", t, line.c_str());
  };
  std::error_code failed;
  std::filesystem::create_directories(out, failed);
  if (failed) throw Error(out + ": " + failed.message());
  Campaign campaign;
  if (std::filesystem::path(folder).extension() == ".bag") {
    if (model_file.empty()) throw Error(folder + ": a bag holds no model, give one with --model");
    std::filesystem::remove_all(out + "/campaign", failed);
    campaign = campaignOfBag(folder, model_file, out + "/campaign", options.search.progress);
  } else {
    campaign = readCampaign(folder);
  }
  const Dataset data =
      loadDataset(campaign, readMachineModel(model_file.empty() ? campaign.modelPath() : model_file));
  const Explanation explanation = explain(data, options, out);
  writeReport(explanation, out);
  writeHtml(explanation, std::filesystem::path(folder).filename().string(), drawPictures(explanation, out),
            out);
  std::printf("verdict: %s\n", explanation.verdict.c_str());
  for (const FoundEffect& e : explanation.effects) {
    std::printf("%s:", e.name.c_str());
    for (const auto& [key, word] : e.words) std::printf(" %s %s", key.c_str(), word.c_str());
    for (const FoundParameter& p : e.parameters)
      std::printf(" %s %.5g +- %.2g", p.key.c_str(), p.value, p.std_dev);
    std::printf("\n");
  }
  for (const Finding& f : explanation.unexplained) {
    std::printf("unexplained: %s, %s", f.channel.c_str(), f.domain.c_str());
    for (const auto& [key, value] : f.location) std::printf(" %s %.5g", key.c_str(), value);
    std::printf(", amplitude %.3g, share %.3f\n", f.amplitude, f.share_of_gap);
  }
  std::printf("gap: fit %.4f -> %.4f, held out %.4f -> %.4f\n", explanation.before.fit, explanation.after.fit,
              explanation.before.heldout, explanation.after.heldout);
}

}  // namespace

int main(int argc, char** argv) {
  std::string campaign, model, out;
  int threads = 2;
  smartmill::CommandLine line{"Finds where twin and records of a campaign part and which effects the model lacks."};
  line.option("campaign", campaign, "campaign folder, or a bag").required();
  line.option("--model", model, "machine model file (default: the campaign's)");
  line.option("-o,--out", out, "folder of the report").required();
  line.option("--threads", threads, "threads").within(1, 64);
  return runProgram(line, argc, argv, [&] {
    run(campaign, model, out, threads);
  });
}
