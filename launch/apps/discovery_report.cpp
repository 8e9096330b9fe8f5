// rosrun smartmill_launch discovery_report discovery.json [--hidden MODEL]: what a discovery found.

#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/program.h"
#include "smartmill_launch/discovery/discovery_report.h"

namespace {

using namespace smartmill;
using namespace smartmill::discovery;

// @return exit status
int run(const std::string& file, const std::string& hidden, const std::string& out) {
  const nlohmann::json result = nlohmann::json::parse(readText(file), nullptr, false);
  for (const char* key : {"code", "message", "report", "tests"})
    if (!result.is_object() || !result.contains(key)) throw Error(file + ": no result of a discovery");
  if (result["code"] != 0) throw Error(file + ": " + result["message"].get<std::string>());
  const Explained explained = readExplained(result["report"].get<std::string>() + "/report.json");
  const std::vector<EffectEntry> effects =
      hidden.empty() ? std::vector<EffectEntry>() : readMachineModel(hidden).effects;
  const DiscoveryReport report = reportOf(explained, result["tests"], effects);
  std::printf("%s", report.text.c_str());
  if (!out.empty()) {
    std::ofstream to(out, std::ios::app);
    to << "\n## Discovery\n\n" << report.text;
    to.close();
    if (!to) throw Error(out + ": cannot be written");
  }
  return hidden.empty() || (report.named && report.improved) ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  std::string file, hidden, out;
  smartmill::CommandLine line{"Says what a discovery found, beside what a simulated machine hides."};
  line.option("result", file, "JSON file of `discover`").required();
  line.option("--hidden", hidden, "model of the machine; exit status 1 when its effects were not named");
  line.option("--append", out, "Markdown file that gets the tables too");
  return smartmill::runProgram(line, argc, argv, [&] { return run(file, hidden, out); });
}
