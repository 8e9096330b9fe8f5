#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "bag_identification.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/campaign_identification.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

struct Options {
  std::string source_path, source, model, means = "all", output, parameters;
};

const char* practice(Means means) {
  return means == Means::all ? "means of all samples in cut" : "means over whole revolutions";
}

void print(const CuttingCoefficients& value, const CuttingCoefficients& std_dev) {
  for (const CuttingKey& k : cuttingKeys()) {
    const double v = value.*k.coefficient, s = std_dev.*k.coefficient;
    const std::string key = k.key;
    const std::string name = key.substr(0, key.find('_'));
    const char* unit = k.unit == units::N_PER_MM2 ? "N/mm2" : "N/mm";
    if (std::isfinite(v)) {
      std::printf("  %s %10.4f +- %8.4f %s\n", name.c_str(), v / k.unit, s / k.unit, unit);
    }
  }
}

void write(const std::string& file, const CuttingCoefficients& value, const CuttingCoefficients& std_dev) {
  if (file.empty()) return;
  std::ofstream stream(file);
  stream << cuttingSection(value, std_dev);
  stream.close();
  if (!stream) throw Error(file + ": cannot be written");
}

void fromForce(const Options& o, const Campaign& campaign, const MachineModel& model) {
  const Means chosen = o.means == "all" ? Means::all : Means::revolutions;
  for (const Means means : {chosen, chosen == Means::all ? Means::revolutions : Means::all}) {
    const IdentifiedCoefficients found = identifyFromForceRecords(campaign, model, means);
    std::printf("%sfrom the forces of %d cuts, %s (unweighted fit):\n",
                means == chosen ? "" : "\nfor comparison, ", found.tests, practice(means));
    print(found.value, found.std_dev);
    std::printf("  R2 of the mean forces: x %.4f, y %.4f, z %.4f\n", found.r_squared_x, found.r_squared_y,
                found.r_squared_z);
    if (means == chosen) write(o.output, found.value, found.std_dev);
  }
}

void fromLoad(const Options& o, const CoefficientSet& found) {
  std::printf("from the load meter in %d cuts:\n", found.tests);
  print(found.value, found.std_dev);
  if (std::isfinite(found.friction_viscous)) {
    std::printf("  friction found in the air cuts: %.4e Nm s/rad viscous, %.4f Nm Coulomb\n",
                found.friction_viscous, found.friction_coulomb);
  } else {
    std::printf("  friction: the model's (no air cuts)\n");
  }
  write(o.output, found.value, found.std_dev);
}

void run(const Options& o) {
  if (!std::filesystem::exists(o.source_path)) throw Error(o.source_path + ": cannot be read");
  if (std::filesystem::path(o.source_path).extension() == ".bag") {
    if (o.source == "force")
      throw Error(o.source_path + ": a bag gives coefficients from the load meter only");
    NodeParameters parameters;
    if (!o.parameters.empty()) {
      ParameterReader reader = ParameterReader::fromFile(o.parameters);
      parameters = readParameters(reader);
    }
    const std::string model_file = o.model.empty() ? parameters.model : o.model;
    if (model_file.empty()) throw Error(o.source_path + ": a bag needs the machine's model (--model)");
    const bool terminal = isatty(STDERR_FILENO);
    const auto progress = [terminal](double share) {
      if (terminal) std::fprintf(stderr, "\rreading %3.0f %%%s", 100.0 * share, share >= 1.0 ? "\n" : "");
    };
    const auto results = identifyFromBag(o.source_path, readMachineModel(model_file), parameters, progress);
    for (const IdentifyResult& result : results) {
      if (result.code != IdentifyResult::Code::ok) throw Error(o.source_path + ": " + result.message);
      std::printf("%s\n", result.message.c_str());
      fromLoad(o, result.coefficients);
    }
    return;
  }
  const Campaign campaign = readCampaign(o.source_path);
  const MachineModel model = readMachineModel(o.model.empty() ? campaign.modelPath() : o.model);
  if (o.source != "load_meter") {
    fromForce(o, campaign, model);
    return;
  }
  std::vector<std::string> notes;
  const CoefficientSet found = identifyFromLoadRecords(campaign, model, &notes);
  for (const std::string& note : notes) std::fprintf(stderr, "coefficients: %s\n", note.c_str());
  fromLoad(o, found);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Cutting coefficients with standard deviations, from the force records or the load meter of a campaign "
      "(a folder with campaign.yaml) or from the load meter in a recorded bag.");
  Options o;
  app.add_option("SOURCE", o.source_path, "campaign folder, or a bag")->required();
  app.add_option("--source", o.source, "what to use (default: force of a campaign, load_meter of a bag)")
      ->check(CLI::IsMember({"force", "load_meter"}));
  app.add_option("--model", o.model, "model file (default: the campaign's); its cutting section is not used");
  app.add_option("--means", o.means, "force: means of all samples in cut, or over whole revolutions")
      ->capture_default_str()
      ->check(CLI::IsMember({"all", "revolutions"}));
  app.add_option("--params", o.parameters, "bag: parameter file of the node (launch/config/loadmeter.yaml)");
  app.add_option("-o,--output", o.output, "writes the coefficients as a model file's cutting section");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    run(o);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "coefficients: %s\n", error.what());
    return 1;
  }
  return 0;
}
