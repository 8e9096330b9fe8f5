#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "commands/coefficients_results.h"
#include "recordings/bag_identification.h"
#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_options.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/commands.h"
#include "smartmill_recording/reading_progress.h"
#include "smartmill_recording/recording_file.h"

namespace smartmill::loadmeter {
namespace {

const char* nameOf(Means means) {
  return means == Means::all ? "means of all samples in cut" : "means over whole revolutions";
}

void fromForce(const CoefficientOptions& o, const Campaign& campaign, const MachineModel& model) {
  const Means chosen = o.means == "all" ? Means::all : Means::revolutions;
  for (const Means means : {chosen, chosen == Means::all ? Means::revolutions : Means::all}) {
    const IdentifiedCoefficients found = identifyFromForceRecords(campaign, model, means);
    std::printf("%sfrom the forces of %d cuts, %s (unweighted fit):\n",
                means == chosen ? "" : "\nfor comparison, ", found.tests, nameOf(means));
    printCoefficients(found.value, found.std_dev);
    std::printf("  R2 of the mean forces: x %.4f, y %.4f, z %.4f\n", found.r_squared_x, found.r_squared_y,
                found.r_squared_z);
    if (means != chosen) continue;
    writeSection(o.output, found.value, found.std_dev);
    CoefficientRecord record = recordOf(campaign, model);
    record.set.source = "force";
    record.set.tests = found.tests;
    record.set.value = found.value;
    record.set.std_dev = found.std_dev;
    for (std::size_t i = 0; i < 6; ++i) {
      for (std::size_t j = i; j < 6; ++j) {
        record.covariance[CoefficientRecord::covarianceIndex(i, j)] =
            found.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
      }
    }
    storeRecord(o, record);
  }
}

void fromBag(const CoefficientOptions& o) {
  if (o.source == "force") throw Error(o.source_path + ": --source force requires a campaign, not a bag");
  const NodeParameters& parameters = o.parameters;
  parameters.validate();
  const std::string model_file = o.model.empty() ? parameters.model : o.model;
  if (model_file.empty()) throw Error(o.source_path + ": a bag requires the machine's model (--model)");
  std::vector<CoefficientRecord> cuts;
  BagListeners listeners;
  listeners.progress = printReadingProgress;
  listeners.cut = [&](const CoefficientRecord& cut) { cuts.push_back(cut); };
  if (o.forces) {
    listeners.force = [](const ForceEstimate& f) {
      std::printf("%s: %s\n", f.name.c_str(), f.text().c_str());
    };
  }
  std::vector<InspectionResult> inspected;
  listeners.inspected = [&](const InspectionResult& one) { inspected.push_back(one); };
  const MachineModel model = readMachineModel(model_file);
  const auto results = identifyFromBag(o.source_path, model, parameters, listeners);
  storeCuts(o, std::move(cuts));
  storeInspections(o, model, inspected);
  for (const IdentifyResult& result : results) {
    if (result.code != IdentifyResult::Code::ok) throw Error(o.source_path + ": " + result.message);
    std::printf("%s\n", result.message.c_str());
    printLoad(result.coefficients);
    writeSection(o.output, result.coefficients.value, result.coefficients.std_dev);
    storeRecord(o, result.record);
  }
}

LoadRecordOptions loadOptions(const CoefficientOptions& o) {
  LoadRecordOptions options;
  options.spindle_uncertainty = o.spindle_uncertainty;
  options.choose_terms = !o.plain_friction;
  options.runout_uncertainty = o.runout_um * units::UM;
  options.depth_uncertainty = o.depth_percent / 100.0;
  return options;
}

/// Prints, writes and stores what the load meter gives.
void reportLoad(const CoefficientOptions& o, const Campaign& campaign, const MachineModel& model,
                const LoadRecordResult& found) {
  for (const std::string& note : found.notes)
    std::fprintf(stderr, "%s: %s\n", o.program.c_str(), note.c_str());
  printLoad(found.set);
  writeSection(o.output, found.set.value, found.set.std_dev);
  printTerms(o, found);
  CoefficientRecord record = recordOf(campaign, model);
  const double stamp = record.set.stamp;
  record.set = found.set;
  record.set.stamp = stamp;
  const auto index = CoefficientRecord::covarianceIndex;
  record.covariance[index(0, 0)] = found.set.std_dev.ktc * found.set.std_dev.ktc;
  record.covariance[index(0, 3)] = found.covariance_tc_te;
  record.covariance[index(3, 3)] = found.set.std_dev.kte * found.set.std_dev.kte;
  storeRecord(o, record);
}

void fromCampaign(const CoefficientOptions& o) {
  const Campaign campaign = readCampaign(o.source_path);
  const MachineModel model = readMachineModel(o.model.empty() ? campaign.modelPath() : o.model);
  if (o.source == "load_meter") {
    reportLoad(o, campaign, model, identifyFromLoadRecords(campaign, model, loadOptions(o)));
  } else {
    fromForce(o, campaign, model);
  }
}

/// Dunwoody, section 6.1.
void fromServoRecord(const CoefficientOptions& o) {
  if (o.source == "force")
    throw Error(o.source_path + ": --source force requires a campaign, not --servo-cuts");
  if (o.model.empty())
    throw Error(o.source_path + ": a record of Servo Guide requires the machine's model (--model)");
  if (!isRecording(o.source_path))
    throw Error(o.source_path + ": expected a bag or MCAP file with daq/servo, as --servo-cuts is given");
  const MachineModel model = readMachineModel(o.model);
  const std::vector<ServoTest> tests = readServoTests(o.servo_cuts);
  const Spindle& spindle = model.needSpindle("read the load meter");
  if (!spindle.load_meter_full_scale)
    throw Error(o.model + ": spindle.load_meter_full_scale_v is missing (required for the load meter)");
  const std::vector<TestRecord> records = servoLoadFromBag(o.source_path, printReadingProgress)
                                              .records(tests, *spindle.load_meter_full_scale, o.source_path);
  Campaign campaign;
  for (const TestRecord& record : records) campaign.tests.push_back(record.test);
  reportLoad(o, campaign, model, identifyFromLoadRecords(records, model, loadOptions(o), o.source_path));
}

void run(const CoefficientOptions& o) {
  if (!std::filesystem::exists(o.source_path)) throw Error(o.source_path + ": cannot be read");
  if (!o.servo_cuts.empty()) {
    fromServoRecord(o);
  } else if (isRecording(o.source_path)) {
    fromBag(o);
  } else {
    fromCampaign(o);
  }
}

void addOptions(CommandLine& line, CoefficientOptions& o) {
  o.program = line.program();
  line.option("SOURCE", o.source_path, "campaign folder, or a bag").required();
  line.option("--source", o.source, "what to use (default: force of a campaign, load_meter of a bag)")
      .oneOf({"force", "load_meter"});
  line.option(
      "--servo-cuts", o.servo_cuts,
      "bag with a record of Servo Guide (daq/servo): conditions of its cuts, smartmill-servo-cuts/1; the "
      "coefficients are from its spindle load");
  line.option("--model", o.model, "model file (default: the campaign's); its cutting section is not used");
  line.option("--means", o.means, "force: means of all samples in cut, or over whole revolutions")
      .showDefault()
      .oneOf({"all", "revolutions"});
  line.flag("--spindle-uncertainty", o.spindle_uncertainty,
            "load_meter of a campaign: the model's stated uncertainty of the spindle also applies to "
            "load_meter_v_per_w and the bandwidth (default: both exact)");
  line.option("--depth-uncertainty", o.depth_percent,
              "[%] load_meter of a campaign: standard deviation of the axial depth, common to all cuts")
      .within(0.0, 100.0);
  line.option("--runout-uncertainty", o.runout_um,
              "[um] load_meter of a campaign: standard deviation of the cutter axis' offset")
      .within(0.0, 100.0);
  line.flag("--forces", o.forces,
            "bag: prints the force of each cut from all its measurements (force/estimate)");
  line.flag("--plain-friction", o.plain_friction,
            "load_meter of a campaign: Coulomb and viscous friction only, no terms added by evidence");
  line.option("--database", o.database, "SQLite file of the machine to which the result is added");
  line.option("--tool", o.tool, "name of the tool, for the database");
  line.option("--material", o.material, "workpiece material, for the database");
  line.option("--rake", o.rake, "[deg] normal rake of the tool, for the database");
  line.option("-o,--output", o.output, "file for the coefficients, as a model file's cutting section");
  ParameterOptions parameters(line, tableOf(o.parameters), "launch/config/loadmeter.yaml, for a bag");
  parameters.add("--motor-method", "motor_method");
}

}  // namespace

Command coefficientsCommand() {
  Command command("coefficients", "identifies cutting coefficients from forces or the load meter");
  command.description =
      "Cutting coefficients with standard deviations, from the force records or the load meter of a campaign "
      "(a folder with campaign.yaml), or from the load meter or a record of Servo Guide in a recorded bag.";
  command.examples = {{"campaigns/none --source force -o cutting.yaml",
                       "from the force records, as a section of a model file"},
                      {"campaigns/none --source load_meter", "from the spindle's load meter"},
                      {"servo.bag --servo-cuts cuts.yaml --model mill.yaml",
                       "from the spindle load in a record of Servo Guide"},
                      {"session.bag --model mill.yaml --database machine.sqlite",
                       "from a recorded session, into the database"}};
  command.files = {{"SERVO_CUTS", "smartmill-servo-cuts/1, see docs/formats.md"},
                   {"OUTPUT", "section cutting of a model file"},
                   {"DATABASE", "SQLite file, see smartmill-database(1)"},
                   {"launch/config/loadmeter.yaml", "the node's parameters, for --params"}};
  command.setBody(run, addOptions);
  return command;
}

}  // namespace smartmill::loadmeter
