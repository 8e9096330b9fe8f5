// rosrun smartmill_launch discovery_report discovery.json [--hidden MODEL]: result of a discovery.

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
    if (!result.is_object() || !result.contains(key))
      throw Error(file + ": expected the result of a discovery (keys code, message, report, tests)");
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
  smartmill::CommandLine line{
      "Prints the result of a discovery, compared with the hidden effects of a simulated machine."};
  line.option("result", file, "JSON file of `discover`").required();
  line.option("--hidden", hidden,
              "true model of the machine; exit code 1 if its effects were not named or the gap did not fall");
  line.option("--append", out, "Markdown file to which the tables are appended");
  return smartmill::runProgram(line, argc, argv, [&] { return run(file, hidden, out); });
}
