#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/stop_signal.h"
#include "smartmill_core/units.h"
#include "smartmill_program/commands.h"
#include "smartmill_program/nc/linuxcnc_program.h"
#include "smartmill_program/nc/program_reader.h"
#include "smartmill_program/plan/feed_planner.h"
#include "smartmill_program/plan/plan_report.h"
#include "smartmill_program/plan/speed_planner.h"
#include "smartmill_program/program_analysis.h"
#include "smartmill_program/report/program_page.h"
#include "smartmill_program/report/remarks.h"
#include "smartmill_program/report/tables.h"
#include "smartmill_program/stock/stock_shape.h"
#include "smartmill_program/stock/triangle_mesh.h"

namespace {

using namespace smartmill;
using namespace smartmill::program;
using Clock = std::chrono::steady_clock;
using units::MM;

constexpr double QUIET = 1.0;  // [s] after which progress is displayed, and between its lines

struct Arguments {
  std::string program, out, stl, colour = "force";
  std::vector<double> stock_mm, cylinder_mm, corner_mm;
  std::vector<std::string> models, work_offsets, radius_offsets;
  double resolution_mm = 0.1, step = SimulationOptions().step_share;
  bool stability = true, linuxcnc = false;
  std::string plan;  // file; empty: no plan
  double most_force_n = FeedLimits::UNLIMITED, most_torque_nm = FeedLimits::UNLIMITED,
         most_power_w = FeedLimits::UNLIMITED, most_chip_mm = FeedLimits::UNLIMITED, least_chip_mm = 0.0,
         most_feed_per_tooth_mm = FeedLimits::UNLIMITED, most_feed_mm_per_min = FeedLimits::UNLIMITED;
  bool chatter_probability = false;
  std::vector<double> speeds_rpm;  // lowest, highest; empty: the S words stay
  double most_chatter_probability = stability::RiskOptions().risk;
};

/// @throws UsageError, Error
FeedLimits limitsOf(const Arguments& arguments, const ToolModels& models) {
  FeedLimits limits;
  limits.force = arguments.most_force_n;
  limits.torque = arguments.most_torque_nm;
  limits.power = arguments.most_power_w;
  limits.chip = arguments.most_chip_mm * MM;
  limits.least_chip = arguments.least_chip_mm * MM;
  limits.feed_per_tooth = arguments.most_feed_per_tooth_mm * MM;
  limits.machine = arguments.most_feed_mm_per_min * MM / 60.0;
  if (std::isinf(limits.chip) && std::isinf(limits.feed_per_tooth))
    throw UsageError("--plan: expected --most-chip-mm or --most-feed-per-tooth-mm next to it");
  if (models.rapid() > 0.0) limits.machine = std::min(limits.machine, models.rapid());
  if (models.acceleration() > 0.0) limits.acceleration = models.acceleration();
  if (std::isinf(limits.machine))
    throw Error("--plan: no model states axes, expected --most-feed-mm-per-min or the section axes");
  return limits;
}

/// @throws Error when the planned program would replace the program
void refuseToReplace(const Arguments& arguments) {
  std::error_code absent;
  if (std::filesystem::equivalent(arguments.program, arguments.plan, absent))
    throw Error("--plan " + arguments.plan + ": is the program itself, expected another file");
}

/// @throws Error, UsageError
StockShape stockOf(const Arguments& arguments) {
  const int stated = !arguments.stock_mm.empty() + !arguments.cylinder_mm.empty() + !arguments.stl.empty();
  if (stated != 1) throw UsageError("expected one of --stock-mm, --stock-cylinder-mm and --stock-stl");
  if (!arguments.stl.empty())
    return StockShape::mesh(std::make_shared<TriangleMesh>(readStl(arguments.stl, MM)));
  if (!arguments.cylinder_mm.empty()) {
    const double height = arguments.cylinder_mm[1] * MM;
    const std::vector<double> centre = arguments.corner_mm.empty()
                                           ? std::vector<double>{0.0, 0.0, -arguments.cylinder_mm[1]}
                                           : arguments.corner_mm;
    return StockShape::cylinder({centre[0] * MM, centre[1] * MM}, 0.5 * arguments.cylinder_mm[0] * MM,
                                centre[2] * MM, centre[2] * MM + height);
  }
  StockBlock block;
  for (std::size_t i = 0; i < 3; ++i) {
    const double size = arguments.stock_mm[i] * MM;
    const double top_is_zero = i == 2 ? -size : 0.0;
    block.low[i] = arguments.corner_mm.empty() ? top_is_zero : arguments.corner_mm[i] * MM;
    block.high[i] = block.low[i] + size;
  }
  return block;
}

ReaderOptions readerOptions(const Arguments& arguments, ToolModels& models) {
  ReaderOptions options;
  for (const std::string& text : arguments.work_offsets) {
    const std::size_t colon = text.find(':');
    const std::string name = text.substr(0, colon);
    std::array<double, 3> offset{};
    char rest = 0;
    if (colon == std::string::npos || name.rfind("G5", 0) != 0 ||
        std::sscanf(text.c_str() + colon, ":%lf:%lf:%lf%c", &offset[0], &offset[1], &offset[2], &rest) != 3)
      throw Error("--work-offset " + text +
                  ": expected G54:X:Y:Z to G59:X:Y:Z, G59.1:X:Y:Z or G54.1P1:X:Y:Z [mm]");
    for (double& value : offset) value *= MM;
    if (!options.work_offsets.emplace(name, offset).second)
      throw Error("--work-offset " + text + ": stated a second time");
  }
  for (const std::string& text : arguments.radius_offsets) {
    int number = 0;
    double radius = 0.0;
    char rest = 0;
    if (std::sscanf(text.c_str(), "D%d=%lf%c", &number, &radius, &rest) != 2 || number < 0 ||
        !(radius >= 0.0) || std::isinf(radius))
      throw Error("--radius-offset " + text + ": expected D1=RADIUS [mm] with a radius of 0 or more");
    if (!options.radius_offsets.emplace(number, radius * MM).second)
      throw Error("--radius-offset " + text + ": stated a second time");
  }
  options.tool_radius = [&models](int tool) { return models.radius(tool); };
  return options;
}

/// Percentages on standard error, and whether to go on.
class ProgressLine {
 public:
  bool operator()(double share) {
    if (elapsed() > shown_ + QUIET) {
      shown_ = elapsed();
      std::fprintf(stderr, "\r%3.0f %% of the moves", 100.0 * share);
      open_ = true;
    }
    return !stopRequested();
  }
  void close() {
    if (open_) std::fprintf(stderr, "\n");
    open_ = false;
  }
  double elapsed() const { return std::chrono::duration<double>(Clock::now() - begin_).count(); }  // [s]

 private:
  Clock::time_point begin_ = Clock::now();
  double shown_ = 0.0;
  bool open_ = false;
};

/// A program and what its plan requires.
struct PlanJob {
  const Arguments& arguments;
  const std::string& text;
  const ReaderOptions& reader;
  ToolModels& models;
  const AnalysisOptions& options;

  Stock stock() const { return Stock(stockOf(arguments), arguments.resolution_mm * MM); }
};

SpeedLimits speedLimitsOf(const Arguments& arguments) {
  SpeedLimits limits;
  limits.low = units::radPerSecFromRpm(arguments.speeds_rpm[0]);
  limits.high = units::radPerSecFromRpm(arguments.speeds_rpm[1]);
  limits.risk.risk = arguments.most_chatter_probability;
  return limits;
}

int notWritten(const Arguments& arguments) {
  std::fprintf(stderr, "interrupted; %s has not been written\n", arguments.plan.c_str());
  return INTERRUPTED;
}

/// Plans the feeds, after the analysis of the program with its planned speeds. @return exit code
int writePlan(const PlanJob& job, FeedPlanner& planner, const AnalysedProgram& program,
              const AnalysedProgram& original) {
  const Arguments& arguments = job.arguments;
  const std::string& text = job.text;
  ProgressLine progress;
  const FeedPlan plan = planner.plan(program, original, job.stock(), job.options,
                                     [&](double share) { return progress(share); });
  progress.close();
  if (plan.interrupted) return notWritten(arguments);
  writeText(arguments.plan, plan.text);
  writeText(arguments.out + "/plan.diff", planDiff(text, plan.text, arguments.program, arguments.plan));
  planTable(plan).save(arguments.out + "/plan.csv");
  std::cout << planSummary(plan, planner.limits());
  return 0;
}

/// Plans the speeds, analyses the program with them and plans its feeds. @return exit code
int writePlanWithSpeeds(const PlanJob& job, SpeedPlanner& planner, const AnalysedProgram& original) {
  const Arguments& arguments = job.arguments;
  ProgressLine progress;
  const std::vector<PlannedSpeed> speeds = planner.plan([&](double share) { return progress(share); });
  if (stopRequested()) {
    progress.close();
    return notWritten(arguments);
  }
  const SpeedText text = withSpeeds(job.text, speeds);
  FeedPlanner feeds(arguments.program, text.text, job.reader, job.models, limitsOf(arguments, job.models),
                    text.ratios);
  const std::vector<Move> moves = interpretProgram(text.text, arguments.program, job.reader);
  Stock stock = job.stock();
  const AnalysisResult analysis =
      ProgramAnalysis(arguments.program, job.models, stock, job.options)
          .run(
              moves, [&](const Step& step, const StepPrediction&) { feeds.add(step); },
              [&](double share) { return progress(share); });
  progress.close();
  if (analysis.interrupted) return notWritten(arguments);
  std::cout << speedSummary(speeds);
  return writePlan(job, feeds, {moves, analysis}, original);
}

int run(const Arguments& arguments) {
  ToolModels models(arguments.models);
  const ReaderOptions reader = readerOptions(arguments, models);
  const std::string text = readText(arguments.program);
  AnalysisOptions options;
  const PlanJob job{arguments, text, reader, models, options};
  std::optional<FeedPlanner> planner;
  std::optional<SpeedPlanner> speeds;
  if (!arguments.plan.empty()) {
    refuseToReplace(arguments);
    planner.emplace(arguments.program, text, reader, models, limitsOf(arguments, models));
    if (!arguments.speeds_rpm.empty()) speeds.emplace(models, speedLimitsOf(arguments));
  }
  const std::vector<Move> moves = arguments.linuxcnc ? interpretWithLinuxcnc(text, arguments.program, reader)
                                                     : interpretProgram(text, arguments.program, reader);
  Stock stock(stockOf(arguments), arguments.resolution_mm * MM);
  std::error_code failed;
  std::filesystem::create_directories(arguments.out, failed);
  if (failed) throw Error(arguments.out + ": " + failed.message());

  options.simulation.step_share = arguments.step;
  options.simulation.rapid = models.rapid();
  options.stability = arguments.stability;
  options.probability = arguments.chatter_probability;
  ProgramAnalysis analysis(arguments.program, models, stock, options);
  StepTable steps;
  PathView path(stock.block(), arguments.colour);
  ProgressLine progress;
  catchInterrupt();
  const AnalysisResult result = analysis.run(
      moves,
      [&](const Step& step, const StepPrediction& prediction) {
        steps.add(step, prediction);
        path.add(step, prediction);
        if (speeds) {
          speeds->add(step);
        } else if (planner) {
          planner->add(step);
        }
      },
      [&](double share) { return progress(share); });
  progress.close();
  const double seconds = progress.elapsed();

  const std::string summary = summaryOf(result.blocks);
  const std::vector<std::string> remarks = remarksOn(result.blocks, models);
  blockTable(result.blocks).save(arguments.out + "/blocks.csv");
  steps.csv().save(arguments.out + "/steps.csv");
  programPage(std::filesystem::path(arguments.program).filename().string(), summary, remarks, path,
              result.blocks)
      .write(arguments.out + "/report.html");
  std::cout << summary;
  for (const std::string& remark : remarks) std::cout << "to be changed: " << remark << "\n";
  std::fprintf(stderr, "%zu steps and %zu stability limits in %.2f s, %.0f x real time\n", result.steps,
               result.limits, seconds, result.time / seconds);
  if (result.interrupted) {
    std::fprintf(stderr, "interrupted in line %d; %s has the blocks until then\n",
                 result.blocks.empty() ? 0 : result.blocks.back().line, arguments.out.c_str());
    return INTERRUPTED;
  }
  if (const std::string collision = collisionText(arguments.program, result.blocks); !collision.empty())
    throw Error(collision);
  if (speeds) return writePlanWithSpeeds(job, *speeds, {moves, result});
  return planner ? writePlan(job, *planner, {moves, result}, {moves, result}) : 0;
}

}  // namespace

namespace smartmill::program {

Command programCommand() {
  Command command(
      "program",
      "predicts engagement, forces and stability of every block of an NC program, and plans its feeds");
  command.description =
      "Runs an NC program (Fanuc, LinuxCNC) through a block of stock: engagement of the end mill step by "
      "step, from "
      "it forces, torque, power and the stability limit with the coefficients and modes of a machine model.";
  command.examples = {{"part.nc --stock-mm 100 60 20 --model mill.yaml -o part",
                       "stock with a corner at X0 Y0 and its top at Z0"},
                      {"part.nc --stock-mm 100 60 20 --corner-mm -50 -30 0 --model 1=rougher.yaml "
                       "2=drill.yaml -o part --colour margin",
                       "another corner, two tools, path coloured by the stability margin"},
                      {"part.nc --stock-mm 100 60 20 --model mill.yaml -o part --plan planned.nc "
                       "--most-force-n 400 --most-chip-mm 0.1",
                       "feeds that hold 400 N and 0.1 mm, as a new program"},
                      {"part.nc --stock-mm 100 60 20 --model mill.yaml -o part --plan planned.nc "
                       "--most-chip-mm 0.1 --plan-speeds-rpm 4000 12000",
                       "spindle speeds as well, each with a probability of chatter of at most 5 %"}};
  command.files = {{"OUT/blocks.csv", "a row for each executed block"},
                   {"OUT/steps.csv", "a row for each step of a feed motion"},
                   {"OUT/report.html", "the tool path from above and the table of the blocks"},
                   {"OUT/plan.diff", "with --plan: difference of the two programs"},
                   {"OUT/plan.csv", "with --plan: a row for each executed block with a feed motion"}};
  command.exits = {{INTERRUPTED, "interrupted by Ctrl-C; the files contain the blocks until then"}};
  command.setBody(run, [](CommandLine& line, Arguments& arguments) {
    line.option("PROGRAM", arguments.program, "NC program").required();
    line.option("--stock-mm", arguments.stock_mm, "size of the stock in X, Y and Z [mm]").count(3, 3);
    line.option("--stock-cylinder-mm", arguments.cylinder_mm,
                "diameter and height of a cylinder about Z [mm]")
        .count(2, 2);
    line.option("--stock-stl", arguments.stl,
                "STL file of the stock, in mm and in the coordinates of the program");
    line.option("--corner-mm", arguments.corner_mm,
                "corner of least X, Y and Z of a block, or middle of the lower face of a cylinder [mm] "
                "(default: 0 0 "
                "and minus the size in Z)")
        .count(3, 3);
    line.option("--model", arguments.models,
                "machine model file with tool, coefficients and modes; N=FILE for tool N of several")
        .count(1, 99)
        .required();
    line.option("-o,--out", arguments.out, "folder of the results").required();
    line.option("--resolution-mm", arguments.resolution_mm, "width of the columns of the stock [mm]")
        .positive()
        .showDefault();
    line.option("--step", arguments.step, "length of a step per tool radius")
        .within(0.001, 1.0)
        .showDefault();
    line.option("--work-offset", arguments.work_offsets,
                "G54:X:Y:Z ... G59:X:Y:Z, G59.1:X:Y:Z, G54.1P1:X:Y:Z [mm] zero of a work offset in the "
                "coordinates of the "
                "stock")
        .count(1, 309);
    line.option("--radius-offset", arguments.radius_offsets,
                "D1=RADIUS [mm] radius offset of G41 and G42 (default: radius of the tool)")
        .count(1, 999);
    line.option("--colour", arguments.colour, "quantity that colours the path")
        .oneOf(colourNames())
        .showDefault();
    line.flag("!--no-stability", arguments.stability, "leaves out the stability limits");
    line.flag("--chatter-probability", arguments.chatter_probability,
              "probability that each step chatters, by machines drawn from the deviations of the model");
    const auto plan =
        line.option("--plan", arguments.plan,
                    "writes the program with feeds that hold the following limits to this file");
    line.flag("--linuxcnc", arguments.linuxcnc,
              "reads the program with LinuxCNC's own interpreter (rs274): O words, named parameters")
        .excludes(plan);
    const auto limit = [&](const char* name, double& value, const char* help) {
      line.option(name, value, help).positive().needs(plan);
    };
    limit("--most-force-n", arguments.most_force_n, "peak force across the tool axis [N]");
    limit("--most-torque-nm", arguments.most_torque_nm, "peak torque of the spindle [N m]");
    limit("--most-power-w", arguments.most_power_w, "mean cutting power [W]");
    limit("--most-chip-mm", arguments.most_chip_mm, "largest chip thickness [mm]");
    limit("--least-chip-mm", arguments.least_chip_mm,
          "largest chip thickness below which a block is reported [mm]");
    limit("--most-feed-per-tooth-mm", arguments.most_feed_per_tooth_mm, "feed per tooth along the path [mm]");
    line.option(
            "--plan-speeds-rpm", arguments.speeds_rpm,
            "lowest and highest spindle speed [rpm]: each S word gets the highest speed at which its cuts "
            "hold --most-chatter-probability")
        .count(2, 2)
        .needs(plan);
    line.option("--most-chatter-probability", arguments.most_chatter_probability,
                "[1] of each cut, at planned speeds")
        .within(0.0, 1.0)
        .showDefault()
        .needs(plan);
    limit("--most-feed-mm-per-min", arguments.most_feed_mm_per_min,
          "feed of the machine [mm/min] (default: rapid feed of the model)");
  });
  return command;
}

}  // namespace smartmill::program
