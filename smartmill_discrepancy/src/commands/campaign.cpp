#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_discrepancy/commands.h"
#include "smartmill_discrepancy/recordings/bag_campaign.h"
#include "smartmill_discrepancy/recordings/path_campaign.h"
#include "smartmill_recording/import/import_campaign.h"
#include "smartmill_recording/recording_file.h"

namespace {

using namespace smartmill;
using namespace smartmill::recording;

constexpr double NOT_STATED = std::numeric_limits<double>::quiet_NaN();

struct Arguments {
  std::string program;
  std::vector<std::string> files;
  std::string out, plan, model, measures, kind, direction, channels;
  std::vector<double> numbers = std::vector<double>(settingKeys().size(), NOT_STATED);
  int teeth = 0;
  double diameter = NOT_STATED, helix = NOT_STATED;
};

template <typename T>
void take(std::optional<T>& to, const T& value, bool stated) {
  if (stated) to = value;
}

ImportPlan planOf(const Arguments& arguments) {
  ImportPlan plan;
  if (!arguments.plan.empty()) plan = readImport(arguments.plan);
  if (!arguments.model.empty()) {
    plan.model = arguments.model;
    plan.tool = {};
    plan.measures.clear();
  }
  take(plan.tool.teeth, arguments.teeth, arguments.teeth > 0);
  take(plan.tool.diameter_mm, arguments.diameter, !std::isnan(arguments.diameter));
  take(plan.tool.helix_deg, arguments.helix, !std::isnan(arguments.helix));
  if (!arguments.measures.empty()) plan.measures = "force_on_" + arguments.measures;
  if (!plan.model.empty() &&
      (plan.tool.teeth || plan.tool.diameter_mm || plan.tool.helix_deg || !plan.measures.empty()))
    throw UsageError(plan.model +
                     ": --teeth, --diameter-mm, --helix-deg and --force-on cannot be combined with a model");
  take(plan.stated.kind, arguments.kind, !arguments.kind.empty());
  take(plan.stated.direction, arguments.direction, !arguments.direction.empty());
  for (std::size_t i = 0; i < settingKeys().size(); ++i) {
    const SettingKey& key = settingKeys()[i];
    if (std::isnan(arguments.numbers[i])) continue;
    if (!key.range.contains(arguments.numbers[i]))
      throw UsageError(std::string(key.option) + ": " + outOfRange(arguments.numbers[i], key.range));
    plan.stated.*key.value = arguments.numbers[i];
  }
  try {
    plan.stated.channels = channelChoices(arguments.channels);
  } catch (const Error& error) {
    throw UsageError(error.what());
  }
  return plan;
}

int run(const Arguments& arguments) {
  const ImportPlan plan = planOf(arguments);
  std::vector<std::string> files = arguments.files;
  if (files.empty()) {
    for (const ImportPlan::Entry& entry : plan.files) files.push_back(entry.file);
  }
  if (files.empty()) throw UsageError("FILES is required, or a list of files in --import");
  const auto note = [](const std::string& line) { std::printf("%s\n", line.c_str()); };
  const ImportResult result = importCampaign(
      plan, files, arguments.out,
      [&](const std::string& source, const std::string& model, const std::string& folder) {
        return isRecording(source)
                   ? discrepancy::campaignOfBag(source, model, folder, note)
                   : discrepancy::campaignOfPaths(readCampaignWithPaths(source), model, folder, note);
      });
  for (const std::string& line : result.report) note(line);
  const char* const program = arguments.program.c_str();
  for (const std::string& fault : result.faults) std::fprintf(stderr, "%s: %s\n", program, fault.c_str());
  if (result.faults.size() > 1)
    std::fprintf(stderr, "%s: %zu faults, nothing was written\n", program, result.faults.size());
  if (!result.faults.empty()) return 1;
  note(arguments.out + "/campaign.yaml: written");
  return 0;
}

}  // namespace

namespace smartmill::discrepancy {

Command campaignCommand() {
  Command command("campaign", "converts measurement files and recordings into a campaign");
  command.description =
      "Converts measurement files (MATLAB, HDF5, CSV and other text, DynoWare, WAV, FLAC, UFF58), recordings "
      "(bag, MCAP) and campaigns into one campaign: campaign.yaml, model.yaml and one CSV per test. "
      "Recordings "
      "and tests of kind path are replaced by their steady cuts. Missing or wrong statements are reported "
      "one "
      "per line; then nothing is written.";
  command.examples = {
      {"cut.mat --kind cut --speed-rpm 4500 --feed-per-tooth-mm 0.06 --axial-depth-mm 2 --entry-deg 0 "
       "--exit-deg 180 --teeth 4 --diameter-mm 19.05 --helix-deg 30 -o campaign",
       "one cut, stated on the command line"},
      {"--import import.yaml -o campaign", "the files and statements of import.yaml"},
      {"hit.csv --kind tap --direction x --channels 'acceleration=Ch2[V]*981' -o taps",
       "a hammer test with an accelerometer of 981 m/s2 per volt"},
      {"session.mcap --model mill.yaml -o campaign", "the steady cuts of a recording"}};
  command.files = {{"OUT/campaign.yaml", "the tests"},
                   {"OUT/model.yaml", "the given model, or one with the tool only"},
                   {"import.yaml", "smartmill-import/1: statements about the files (docs/formats.md)"}};
  command.setBody(run, [](CommandLine& line, Arguments& a) {
    a.program = line.program();
    line.option("FILES", a.files, "measurement files, recordings, campaigns (default: those of --import)");
    line.option("-o,--out", a.out, "folder of the campaign; must not exist or be empty").required();
    line.option("--import", a.plan, "import.yaml: statements about the files");
    line.option("--model", a.model, "machine model of the campaign");
    line.option("--kind", a.kind, "kind of the tests: cut, air or tap").oneOf({"cut", "air", "tap"});
    for (std::size_t i = 0; i < settingKeys().size(); ++i)
      line.option(settingKeys()[i].option, a.numbers[i], settingKeys()[i].help);
    line.option("--direction", a.direction, "axis of the hammer in a tap: x, y or z")
        .oneOf({AXIS_NAMES.begin(), AXIS_NAMES.end()});
    line.option("--channels", a.channels,
                "COLUMN=NAME[UNIT]*SCALE,...: channels of the file and their units");
    line.option("--teeth", a.teeth, "teeth of the tool, if no model is given").within(1, 20);
    line.option("--diameter-mm", a.diameter, "diameter of the tool").positive();
    line.option("--helix-deg", a.helix, "helix angle of the tool").within(0.0, 79.999);
    line.option("--force-on", a.measures, "object on which the measured force acts: tool or workpiece")
        .oneOf({"tool", "workpiece"});
  });
  return command;
}

}  // namespace smartmill::discrepancy
