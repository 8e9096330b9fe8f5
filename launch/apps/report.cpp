// rosrun smartmill_launch report results/session.bag --session results/session.json -o results

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>

#include "../src/report/report_pictures.h"
#include "../src/report/session_bag.h"
#include "../src/session/child.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"

namespace {

using namespace smartmill;
using namespace smartmill::report;
namespace fs = std::filesystem;

/// Stability limit of the true machine, from the tool `lobes`: collocation with the full search at each
/// speed. The check thus covers the error of the measured modes and coefficients, and of a chart that is
/// continued over the speed or by the zero-order solution.
class TrueLimit {
 public:
  /// @param model file of the true machine @param folder for the output of the tool
  TrueLimit(std::string model, fs::path folder, const StabilityChart& chart)
      : model_(std::move(model)), folder_(std::move(folder)), chart_(chart) {}

  StabilityChart over(double low, double high, std::size_t count) const {
    const std::string csv = (folder_ / "lobes_true.csv").string(),
                      log = (folder_ / "lobes_true.txt").string();
    const session::Tool lobes{"lobes", "the stability limit of the true machine"};
    const std::vector<std::string> arguments{
        model_,
        "--entry-deg",
        formatted("%.12g", units::degFromRad(chart_.entry)),
        "--exit-deg",
        formatted("%.12g", units::degFromRad(chart_.exit)),
        "--speeds",
        formatted("%.12g:%.12g:%zu", units::rpmFromRadPerSec(low), units::rpmFromRadPerSec(high), count),
        "--max-depth-mm",
        "1000",
        "--method",
        "collocation",
        "-o",
        csv};
    if (session::runTool(lobes, arguments, log) != 0) {
      throw Error("the stability limit of the true machine was not computed, see " + log);
    }
    return read(csv);
  }

  /// [m]
  double at(double speed) const { return over(speed, speed, 1).limit.depth.at(0); }

 private:
  StabilityChart read(const std::string& csv) const {
    StabilityChart curve;
    curve.entry = chart_.entry;
    curve.exit = chart_.exit;
    std::ifstream in(csv);
    std::string line;
    std::getline(in, line);
    double least = std::numeric_limits<double>::infinity();
    while (std::getline(in, line)) {
      const std::size_t comma = line.find(',');
      const std::string depth = line.substr(comma + 1, line.find(',', comma + 1) - comma - 1);
      curve.limit.spindle_speed.push_back(units::radPerSecFromRpm(std::stod(line)));
      curve.limit.depth.push_back(depth.empty() ? std::numeric_limits<double>::infinity()
                                                : std::stod(depth) * units::MM);
      least = std::min(least, curve.limit.depth.back());
    }
    if (curve.limit.depth.empty()) throw Error(csv + ": expected a stability limit, found no line");
    curve.absolute_depth_limit = least;
    return curve;
  }

  std::string model_;
  fs::path folder_;
  StabilityChart chart_;
};

/// Model file of the true machine; empty if the recording lacks its parameters.
std::string trueModel(const SessionRecording& recording, const fs::path& folder) {
  const MeasuredModes* x = recording.modal(true, POINT_TOOL_TIP, "x");
  const MeasuredModes* y = recording.modal(true, POINT_TOOL_TIP, "y");
  if (!recording.true_coefficients || !x || !y || recording.cuts.empty()) return "";
  MachineModel model;
  model.tool = recording.cuts.front().condition.tool;
  model.cutting = recording.true_coefficients->value;
  model.tool_tip = {x->model, y->model};
  const std::string file = (folder / "true_machine.yaml").string();
  writeMachineModel(model, file);
  return file;
}

/// A failure leaves the targets unchecked; the report is written all the same.
TrueStability trueStability(const SessionRecording& recording, const TrueLimit& limit) {
  TrueStability truth;
  try {
    const std::vector<double>& speeds = recording.chart->limit.spindle_speed;
    truth.chart = limit.over(speeds.front(), speeds.back(), speeds.size());
    for (const RecordedCut& cut : recording.cuts) {
      const bool verifies = cut.condition.name.rfind("verify_", 0) == 0;
      truth.limits.push_back(verifies ? limit.at(cut.condition.spindle_speed) : NOT_A_NUMBER);
    }
  } catch (const Error& error) {
    truth.failure = error.what();
  }
  return truth;
}

struct Request {
  std::string bag, session, out = "results";
  bool check = false, pictures = true;
};

std::string readAll(const std::string& file) {
  std::ifstream in(file);
  if (!in) throw Error(file + ": cannot be read");
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

void write(const fs::path& file, const std::string& text) {
  std::ofstream out(file);
  out << text;
  out.close();
  if (!out) throw Error(file.string() + ": cannot be written");
}

std::string captionOf(const std::string& picture) {
  if (picture == "frf.png") return "Measured and true FRF of the tool, with the coherence";
  if (picture == "chart.png") return "Stability limit, measured and true, and the two cuts that verify it";
  return "Force over three revolutions, tooth passing frequency at the sensor's resonance: raw, compensated, "
         "true";
}

int run(const Request& request) {
  const std::string session = request.session.empty() ? "" : readAll(request.session);
  const bool terminal = isatty(STDERR_FILENO) != 0;
  const SessionRecording recording = readSession(request.bag, [terminal](double share) {
    if (terminal) std::fprintf(stderr, "\rreading %3.0f %%", 100.0 * share);
  });
  if (terminal) std::fprintf(stderr, "\r             \r");
  const fs::path folder(request.out), data = folder / "data";
  std::error_code error;
  fs::create_directories(data, error);
  if (error) throw Error(data.string() + ": " + error.message());

  TrueStability truth;
  const std::string model = recording.chart ? trueModel(recording, data) : "";
  if (!model.empty()) truth = trueStability(recording, TrueLimit(model, data, *recording.chart));
  Report report = makeReport(recording, truth);
  report.unchecked = notMeasured(recording, session);
  for (const std::string& note : testPlanNotes(session)) report.notes.push_back(note);
  if (report.sections.empty() && report.cuts.empty() && report.unchecked.empty())
    throw Error(request.bag + ": contains no results");
  const std::string text = markdown(report);
  write(folder / "summary.md", text);
  write(folder / "summary.json", json(report, session));
  std::fputs(text.c_str(), stdout);
  std::string files = "summary.md, summary.json";
  if (request.pictures) {
    std::string pictures;
    for (const std::string& picture : drawPictures(recording, report, truth.chart, folder)) {
      files += ", " + picture;
      pictures += "\n![" + captionOf(picture) + "](" + picture + ")\n";
    }
    write(folder / "summary.md", text + pictures);
  }
  std::printf("written to %s: %s\n", folder.string().c_str(), files.c_str());
  return request.check && report.met() < report.targets() ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Reports the results of a recorded session, compared with the truth if a simulator recorded it: "
      "tables, a summary file and pictures."};
  line.option("bag", request.bag, "recorded session").required();
  line.option("--session", request.session, "JSON summary of the session node, included in summary.json");
  line.option("-o,--out", request.out, "folder for summary.md, summary.json and pictures").showDefault();
  line.flag("--check", request.check, "exit code 1 if a target is missed");
  line.flag("!--no-pictures", request.pictures, "tables only");
  return runProgram(line, argc, argv, [&] { return run(request); });
}
