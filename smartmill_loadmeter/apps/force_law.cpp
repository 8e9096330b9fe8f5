#include <cstdio>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/identification/force_law.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

void laws(const char* name, const std::vector<double>& chip, const std::vector<double>& force) {
  std::printf("%s force per depth against chip thickness, best first (%zu points):\n", name, chip.size());
  for (const ForceLaw& law : fitForceLaws(chip, force)) {
    std::printf("  BIC %9.1f, RMS %6.2f N/mm  %s: ", law.bic, law.rms / units::N_PER_MM, nameOf(law.kind));
    if (law.kind == ForceLawKind::power) {
      std::printf("%.2f +- %.2f N/mm x (h / 0.1 mm)^(%.3f +- %.3f)\n", law.value[0] / units::N_PER_MM,
                  law.std_dev[0] / units::N_PER_MM, law.value[1], law.std_dev[1]);
    } else {
      std::printf("%.1f +- %.1f N/mm2 h + %.2f +- %.2f N/mm", law.value[0] / units::N_PER_MM2,
                  law.std_dev[0] / units::N_PER_MM2, law.value[1] / units::N_PER_MM,
                  law.std_dev[1] / units::N_PER_MM);
      if (law.kind == ForceLawKind::shifted_linear) {
        std::printf(" above %.1f um", law.value[2] / units::UM);
      }
      std::printf("\n");
    }
  }
}

void run(const std::string& path) {
  const Campaign campaign = readCampaign(path);
  const MachineModel model = readMachineModel(campaign.modelPath());
  const std::vector<SlotFit> fits = fitSlots(campaign, model);
  std::printf("fits of the mean and the first orders of a revolution, best first:\n");
  for (const SlotFit& f : fits) {
    std::printf("  BIC %8.1f, RMS %6.2f N  %s\n", f.bic, f.rms, f.name.c_str());
    for (const CuttingKey& k : cuttingKeys()) {
      const std::string key = k.key;
      std::printf("    %s %.2f +- %.2f", key.substr(0, key.find('_')).c_str(),
                  f.value.*k.coefficient / k.unit, f.std_dev.*k.coefficient / k.unit);
    }
    std::printf("\n");
    if (f.size_exponent != 0.0)
      std::printf("    size exponent %.3f +- %.3f", f.size_exponent, f.size_exponent_std);
    if (f.offset > 0.0) {
      std::printf("    runout %.1f +- %.1f um", f.offset / units::UM, f.offset_std / units::UM);
    }
    if (f.unbalance > 0.0) std::printf("    turning force %.1f N", f.unbalance);
    std::printf("\n");
  }
  const std::vector<ForcePoint> points = revolutionPoints(campaign, model, fits.front());
  std::vector<double> chip, tangential, radial;
  for (const ForcePoint& p : points) {
    chip.push_back(p.chip);
    tangential.push_back(p.tangential);
    radial.push_back(p.radial);
  }
  laws("tangential", chip, tangential);
  laws("radial", chip, radial);
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Which force law a campaign's force records prefer: linear, shifted linear or power against chip "
      "thickness, "
      "size effect, runout.");
  std::string path;
  line.option("CAMPAIGN", path, "campaign folder").required();
  return runProgram(line, argc, argv, [&] { run(path); });
}
