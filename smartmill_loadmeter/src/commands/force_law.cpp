#include "smartmill_loadmeter/commands.h"

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "recordings/bag_identification.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/parameters/parameter_options.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/identification/force_curve.h"
#include "smartmill_loadmeter/identification/force_curve_identification.h"
#include "smartmill_loadmeter/identification/force_law.h"
#include "smartmill_loadmeter/identification/slot_fit.h"
#include "smartmill_recording/recording_file.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

void printLaws(const char* name, const std::vector<double>& chip, const std::vector<double>& force) {
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

struct Options {
  std::string campaign, curve, compensated, tool, material;
  int pieces = 0;
  NodeParameters parameters;
};

/// Mean revolutions of a campaign's cuts, with the forces of `compensate` if a folder is given.
std::vector<AngleRecord> angleRecords(const Options& o, const Campaign& campaign, const MachineModel& model,
                                      const SlotFitResult& fit) {
  std::vector<AngleRecord> records;
  std::size_t cut = 0;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::cut) continue;
    const std::size_t number = cut++;
    const Record record = inFeedAxes(readRecord(campaign, test, model), test);
    const std::vector<double>* angle =
        record.has("spindle_angle") ? &record.column("spindle_angle") : nullptr;
    MeanRevolution revolution;
    const auto first = static_cast<std::size_t>(test.engage_time.value_or(0.0) * test.sample_rate);
    const std::filesystem::path compensated = std::filesystem::path(o.compensated) / (test.name + ".csv");
    const Record force = o.compensated.empty() ? record : inFeedAxes(readCsv(compensated.string()), test);
    if (force.size() != record.size())
      throw Error(formatted("%s: %zu samples, expected %zu as in the record", force.file.c_str(),
                            force.size(), record.size()));
    const std::vector<double>&fx = force.column("fx"), &fy = force.column("fy");
    for (std::size_t i = first; i < record.size(); ++i) {
      revolution.add(
          angle ? (*angle)[i]
                : test.spindle_speed * static_cast<double>(i - first) / test.sample_rate + fit.phase[number],
          fx[i], fy[i]);
    }
    AngleRecord one = revolution.record();
    one.engagement = *test.engagement;
    records.push_back(std::move(one));
  }
  return records;
}

void draw(const ForceCurves& curves, const std::string& file) {
  Gnuplot plot(std::filesystem::path(file).replace_extension(".png").string(), 900, 500, 11);
  plot << "$d << EOD\n";
  const double top = curves.tangential.knots.back();
  for (int k = 1; k <= 200; ++k) {
    const double h = top * k / 200.0;
    plot << h / units::MM;
    for (const ForceCurve* curve : {&curves.tangential, &curves.radial}) {
      const double at = curve->at(h), two = 2.0 * curve->stdAt(h);
      plot << " " << at / units::N_PER_MM << " " << (at - two) / units::N_PER_MM << " "
           << (at + two) / units::N_PER_MM;
    }
    plot << "\n";
  }
  plot << "EOD\nset grid\nset key top left\nset xlabel 'chip thickness [mm]'\nset ylabel 'force per depth "
          "[N/mm]'\nplot $d using 1:3:4 with filledcurves lc 'light-blue' t 'two deviations', $d using 1:2 "
          "with lines lw 2 lc 'blue' t 'tangential', $d using 1:6:7 with filledcurves lc 'light-salmon' t "
          "'', $d using 1:5 with lines lw 2 lc 'red' t 'radial'\n";
  plot.draw();
}

/// Writes, draws and prints curves.
void writeAndPrint(const ForceCurves& curves, const std::string& file) {
  writeForceCurves(curves, file);
  draw(curves, file);
  std::printf("%s: monotone splines of %zu segments, residual %.2f N RMS", file.c_str(),
              curves.tangential.knots.size() - 1, curves.rms);
  std::printf(curves.scatter > 0.0 ? ", cuts differ by %.1f %%\n" : "\n", 100.0 * curves.scatter);
  for (const double share : {0.1, 0.25, 0.5, 0.75, 1.0}) {
    const double h = share * curves.tangential.knots.back();
    std::printf("  h %.4f mm: tangential %8.2f +- %6.2f, radial %8.2f +- %6.2f N/mm\n", h / units::MM,
                curves.tangential.at(h) / units::N_PER_MM, curves.tangential.stdAt(h) / units::N_PER_MM,
                curves.radial.at(h) / units::N_PER_MM, curves.radial.stdAt(h) / units::N_PER_MM);
  }
}

/// Force curves as loadmeter_node identifies them.
void fromBag(const Options& o) {
  if (o.curve.empty()) throw Error(o.campaign + ": a bag requires --curve FILE");
  if (!o.compensated.empty()) throw Error("--compensated: not for a bag, which contains force/compensated");
  NodeParameters parameters = o.parameters;
  if (o.pieces > 0) parameters.curve.pieces = o.pieces;
  parameters.validate();
  for (const IdentifiedForceCurves& found : curvesFromBag(o.campaign, parameters)) {
    if ((!o.tool.empty() && found.tool != o.tool) || (!o.material.empty() && found.material != o.material))
      continue;
    std::string cuts;
    for (const std::string& name : found.cuts) cuts += (cuts.empty() ? "" : ", ") + name;
    std::printf("%s in %s: %s\n", found.tool.c_str(), found.material.c_str(), cuts.c_str());
    writeAndPrint(found.curves, o.curve);
  }
}

void writeCurve(const Options& o, const Campaign& campaign, const MachineModel& model,
                const SlotFitResult& fit) {
  ForceCurves curves =
      fitForceCurves(angleRecords(o, campaign, model, fit), model.needTool("fit a force curve"),
                     o.pieces > 0 ? o.pieces : o.parameters.curve.pieces);
  widen(curves, o.parameters.curve.gain_error);
  writeAndPrint(curves, o.curve);
}

void run(const Options& o) {
  if (isRecording(o.campaign)) {
    fromBag(o);
    return;
  }
  if (o.curve.empty() && !o.compensated.empty()) throw Error("--compensated: only with --curve");
  const Campaign campaign = readCampaign(o.campaign);
  const MachineModel model = readMachineModel(campaign.modelPath());
  const std::vector<SlotFitResult> fits = fitSlots(campaign, model);
  std::printf("fits of the mean and the first orders of a revolution, best first:\n");
  for (const SlotFitResult& f : fits) {
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
    if (f.unbalance > 0.0) std::printf("    rotating force %.1f N", f.unbalance);
    std::printf("\n");
  }
  // The curve is for any number of teeth, the force laws for a single tooth in cut.
  if (!o.curve.empty()) {
    writeCurve(o, campaign, model, fits.front());
    return;
  }
  const std::vector<ForcePoint> points = revolutionPoints(campaign, model, fits.front());
  std::vector<double> chip, tangential, radial;
  for (const ForcePoint& p : points) {
    chip.push_back(p.chip);
    tangential.push_back(p.tangential);
    radial.push_back(p.radial);
  }
  printLaws("tangential", chip, tangential);
  printLaws("radial", chip, radial);
}

}  // namespace

namespace smartmill::loadmeter {

Command forceLawCommand() {
  Command command("force-law", "compares force laws on a campaign's force records");
  command.description =
      "Compares force laws on the force records of a campaign: linear, shifted linear or power over chip "
      "thickness, size effect, runout.";
  command.examples = {
      {"campaigns/none", "the laws, best first by BIC"},
      {"campaigns/none --curve force.yaml", "a spline for `lobes --force-curve`, with a picture"}};
  command.files = {{"CURVE", "YAML of force over chip thickness; a picture of the same name with .png"},
                   {"launch/config/loadmeter.yaml", "the node's parameters, for --params"}};
  command.setBody(run, [](CommandLine& line, Options& o) {
    line.option(
            "SOURCE", o.campaign,
            "campaign folder, or a bag with force/compensated and spindle/angle (--curve: as loadmeter_node "
            "identifies it)")
        .required();
    line.option(
        "--curve", o.curve,
        "YAML of force over chip thickness as monotone splines with standard deviations, for any number "
        "of teeth in cut (`lobes --force-curve` reads it); a picture of the same name with .png");
    line.option("--compensated", o.compensated,
                "folder that `compensate CAMPAIGN -o` wrote: source of fx and fy (without the sensor's own "
                "modes)");
    line.option("--pieces", o.pieces,
                "segments of a spline (default: 8, of a bag the parameter curve_pieces)")
        .within(2, 30);
    line.option("--tool", o.tool, "bag with several tools: name of the tool");
    line.option("--material", o.material, "bag with several materials: name of the material");
    const ParameterOptions parameters(line, tableOf(o.parameters), "launch/config/loadmeter.yaml, for a bag");
  });
  return command;
}

}  // namespace smartmill::loadmeter
