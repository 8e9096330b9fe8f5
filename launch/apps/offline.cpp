// rosrun smartmill_launch offline results/session.bag -o results/offline

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <ros/package.h>
#include "../src/report/session_bag.h"
#include "../src/session/child.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/model/force_sensor_kind.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_launch/comparison/offline_comparison.h"

namespace {

using namespace smartmill;
using namespace smartmill::report;
namespace fs = std::filesystem;

// Half a unit of the last printed digit: ten digits, forces six.
constexpr double TEN_DIGITS = 6e-10, SIX_DIGITS = 6e-6;
// Share of the force blocks that a recorder may lose on a busy computer.
constexpr double MOST_LOST = 0.05;  // [1]

struct Request {
  std::string bag, out = "offline", model, config, sensor = "table";
  double least_ratio = 20.0;
};

Agreement compareFrf(const SessionRecording& live, const fs::path& folder) {
  Agreement agreement;
  for (const char* direction : {"x", "y"}) {
    const MeasuredFrf* frf = live.frf(false, POINT_TOOL_TIP, direction);
    const MeasuredModes* modes = live.modal(false, POINT_TOOL_TIP, direction);
    if (!frf || !modes) continue;
    const NumberTable lines = readNumberTable(folder / ("frf_" + std::string(direction) + ".csv"));
    std::vector<double> real, imag;
    for (const std::complex<double>& value : frf->frf.value) {
      real.push_back(value.real());
      imag.push_back(value.imag());
    }
    agreement.add(frf->frf.frequency, lines.column("frequency_hz"));
    agreement.add(real, lines.column("real"));
    agreement.add(imag, lines.column("imag"));
    agreement.add(frf->frf.coherence, lines.column("coherence"));
    const std::string file = (folder / ("modes_" + std::string(direction) + ".yaml")).string();
    std::vector<double> frequency, damping, stiffness, found_frequency, found_damping, found_stiffness;
    for (const Mode& mode : modes->model.modes) {
      frequency.push_back(mode.frequency);
      damping.push_back(mode.damping_ratio);
      stiffness.push_back(stiffnessOf(mode).first / units::N_PER_UM);
    }
    for (const StrictYaml& mode : StrictYaml::fromFile(file).maps("modes")) {
      found_frequency.push_back(mode.number("frequency_hz"));
      found_damping.push_back(mode.number("damping_ratio"));
      found_stiffness.push_back(mode.number("stiffness_n_per_um"));
    }
    agreement.add(frequency, found_frequency);
    agreement.add(damping, found_damping);
    agreement.add(stiffness, found_stiffness);
  }
  return agreement;
}

Agreement compareCoefficients(const SessionRecording& live, const std::string& file) {
  Agreement agreement;
  if (!live.coefficients) return agreement;
  const StrictYaml root = StrictYaml::fromFile(file);
  const StrictYaml cutting = root.map("cutting");
  for (const CuttingKey& key : cuttingKeys()) {
    for (const bool std_dev : {false, true}) {
      const double value = (std_dev ? live.coefficients->std_dev : live.coefficients->value).*key.coefficient;
      if (!std::isfinite(value)) continue;
      agreement.add({value / key.unit}, {cutting.number(key.key + std::string(std_dev ? "_std" : ""))});
    }
  }
  return agreement;
}

Agreement compareForces(const SessionRecording& live, const fs::path& folder) {
  Agreement agreement;
  for (const RecordedCut& cut : live.cuts) {
    const NumberTable table = readNumberTable(folder / (cut.condition.name + ".csv"));
    const std::vector<double>& time = table.column("time");
    if (time.empty() || cut.compensated.empty()) continue;
    // Compared by time: the tool omits lost samples.
    std::vector<double> stamps;
    for (const double t : time) stamps.push_back(cut.condition.stamp + t);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      agreement.add(cut.compensated.axisAt(axis, stamps), table.column(std::string("f") + "xyz"[axis]));
    }
  }
  return agreement;
}

Agreement compareChart(const SessionRecording& live, const std::string& file) {
  Agreement agreement;
  if (!live.chart) return agreement;
  const NumberTable table = readNumberTable(file);
  std::vector<double> rpm, depth;
  for (const double speed : live.chart->limit.spindle_speed) rpm.push_back(units::rpmFromRadPerSec(speed));
  for (const double limit : live.chart->limit.depth) depth.push_back(limit / units::MM);
  agreement.add(rpm, table.column("rpm"));
  agreement.add(depth, table.column("limit_mm"));
  return agreement;
}

/// CPU time of the ended child processes [s].
double childrenTime() {
  rusage usage{};
  getrusage(RUSAGE_CHILDREN, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

struct Comparison {
  session::Tool tool;
  std::vector<std::string> arguments;
  std::string parameters;
  fs::path out;
  double printed;  // [1] tolerance
  double lost;     // [1] tolerated share of numbers on one side only
  std::function<Agreement(const SessionRecording&, const fs::path&)> compare;
};

/// Prints one line of the table. @return whether the results agree and the tool is fast enough. @throws Error
/// if the tool fails.
bool compareOne(const Request& request, const SessionRecording& live, const Comparison& comparison) {
  const std::string& name = comparison.tool.subcommand;
  const std::string log = (fs::path(request.out) / (name + ".txt")).string();
  const auto begin = std::chrono::steady_clock::now();
  const double computed_before = childrenTime();
  std::vector<std::string> arguments{request.bag, "--model", request.model, "--params",
                                     (fs::path(request.config) / comparison.parameters).string()};
  arguments.insert(arguments.end(), comparison.arguments.begin(), comparison.arguments.end());
  arguments.insert(arguments.end(), {"-o", comparison.out.string()});
  if (session::runTool(comparison.tool, arguments, log) != 0) {
    throw Error(name + " failed on " + request.bag + ", see " + log);
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const double computed = childrenTime() - computed_before;
  // On a busy computer the tool's CPU time is the measure of its speed.
  const double ratio = live.duration / std::min(seconds, computed);
  const Agreement agreement = comparison.compare(live, comparison.out);
  const bool same = agreement.same(comparison.printed, comparison.lost), fast = ratio >= request.least_ratio;
  std::printf("%-14s %8.2f %8.2f %8.1f %10zu %12.2g  %s%s\n", name.c_str(), seconds, computed, ratio,
              agreement.compared, agreement.largest, same ? "same in all printed digits" : "DIFFERENT",
              fast ? "" : ", SLOW");
  if (agreement.missing > 0) {
    std::printf("%14s %zu numbers are on one side only\n", "", agreement.missing);
  }
  return same && fast;
}

int run(const Request& request) {
  std::error_code folder_error;
  fs::create_directories(request.out, folder_error);
  if (folder_error) throw Error(request.out + ": " + folder_error.message());
  const SessionRecording live = readSession(request.bag, {});
  const fs::path out(request.out);
  const std::vector<Comparison> comparisons{{{"frf", "the FRF and modes of the hits"},
                                             {"--no-picture"},
                                             "hammer.yaml",
                                             out / "frf",
                                             TEN_DIGITS,
                                             0.0,
                                             compareFrf},
                                            {{"coefficients", "the cutting coefficients"},
                                             {},
                                             "loadmeter.yaml",
                                             out / "coefficients.yaml",
                                             TEN_DIGITS,
                                             0.0,
                                             compareCoefficients},
                                            {{"compensate", "the compensated forces"},
                                             {"--sensor", request.sensor},
                                             "kalman.yaml",
                                             out / "compensated",
                                             SIX_DIGITS,
                                             MOST_LOST,
                                             compareForces},
                                            {{"chart", "the stability chart"},
                                             {},
                                             "stability.yaml",
                                             out / "chart.csv",
                                             TEN_DIGITS,
                                             0.0,
                                             compareChart}};
  std::printf("%-14s %8s %8s %8s %10s %12s  %s\n", "offline tool", "seconds", "CPU s", "x real", "numbers",
              "difference", "against the live session");
  bool good = true;
  for (const Comparison& comparison : comparisons) {
    try {
      good = compareOne(request, live, comparison) && good;
    } catch (const Error& error) {
      std::printf("%-14s NOT CHECKED: %s\n", comparison.tool.subcommand.c_str(), error.what());
      good = false;
    }
    std::fflush(stdout);
  }
  return good ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  const std::string package = ros::package::getPath("smartmill_launch");
  request.model = package + "/models/mill.yaml";
  request.config = package + "/config";
  CommandLine line{
      "Runs the offline tools on a recorded session, measures their time and compares their results with "
      "those of the nodes; exit code 1 if a printed digit differs or a tool is slower than --least-ratio."};
  line.option("bag", request.bag, "recorded session").required().existingFile();
  line.option("-o,--out", request.out, "folder for the output of the tools").showDefault();
  line.option("--model", request.model, "machine model of the session").showDefault();
  line.option("--config", request.config, "folder with the parameter files of the nodes").showDefault();
  line.option("--sensor", request.sensor, "force sensor of the session")
      .oneOf(forceSensorWords())
      .showDefault();
  line.option("--least-ratio", request.least_ratio, "minimum speed of each tool, in multiples of real time")
      .showDefault();
  return runProgram(line, argc, argv, [&] { return run(request); });
}
