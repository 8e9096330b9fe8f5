#include "smartmill_hammer/commands.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "node/parameters.h"
#include "node/wiring.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/names.h"
#include "smartmill_hammer/analysis/health.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::hammer {
namespace {

struct Options {
  std::vector<std::string> bags;
  std::string out;
  HealthAllowance allowance;
};

struct ModesOfBag {
  std::string bag;
  MeasuredModes modes;
};
struct FrictionOfBag {
  std::string bag;
  double stamp = 0.0, viscous = 0.0, coulomb = 0.0;
};
/// Air cuts of one tool in one bag.
struct AirCuts {
  std::string bag;
  double stamp = 0.0;
  AirCutRecord record;
};

/// Measurements of all bags in order of time; modes by tool, point and direction.
struct History {
  std::map<std::string, std::vector<ModesOfBag>> modes;
  std::vector<FrictionOfBag> friction;
  std::map<std::string, std::vector<AirCuts>> air;  // by tool
  std::map<std::string, ModalModel> sensors;        // latest, by channel of the dynamometer
};

History read(const std::vector<std::string>& bags) {
  History history;
  for (const std::string& bag : bags) {
    std::fprintf(stderr, "reading %s\n", bag.c_str());
    RecordingReader reader(bag);
    reader.on<MeasuredModes>(names::TOOL_MODES, [&](const MeasuredModes& modes, double) {
      const std::string name =
          (modes.tool.empty() ? std::string() : modes.tool + " ") + modes.point + " " + modes.direction;
      history.modes[name].push_back({bag, modes});
      if (modes.point == POINT_FORCE_SENSOR) history.sensors["f" + modes.direction] = modes.model;
    });
    reader.on<CoefficientSet>(names::COEFFICIENTS, [&](const CoefficientSet& set, double) {
      if (std::isfinite(set.friction_viscous) && std::isfinite(set.friction_coulomb))
        history.friction.push_back({bag, set.stamp, set.friction_viscous, set.friction_coulomb});
    });
    IdleSpindlePipeline idle(NodeParameters().hold_back);
    connectIdle(reader, idle);
    feed<SpindleAngle>(reader, names::SPINDLE_ANGLE, idle);
    reader.run();
    idle.finish();
    for (const auto& [tool, record] : idle.records())
      history.air[tool].push_back({bag, endTime(record), record});
  }
  for (auto& [tool, list] : history.air)
    std::stable_sort(list.begin(), list.end(),
                     [](const AirCuts& a, const AirCuts& b) { return a.stamp < b.stamp; });
  for (auto& [name, list] : history.modes)
    std::stable_sort(list.begin(), list.end(),
                     [](const ModesOfBag& a, const ModesOfBag& b) { return a.modes.stamp < b.modes.stamp; });
  std::stable_sort(history.friction.begin(), history.friction.end(),
                   [](const FrictionOfBag& a, const FrictionOfBag& b) { return a.stamp < b.stamp; });
  return history;
}

/// Prints one measurement compared with the first and adds it to the CSV. @return number of drifted
/// quantities
int report(const std::string& name, const std::string& bag, double first, double stamp,
           const std::vector<HealthChange>& changes, CsvWriter& csv) {
  const double days = (stamp - first) / DAY;
  std::printf("%s, %s, %.2f days after the first\n", name.c_str(), bag.c_str(), days);
  int drifted = 0;
  for (const HealthChange& c : changes) {
    std::printf("  %-52s %12.5g -> %12.5g  %+8.2f %%  %7.1f std%s\n", c.quantity.c_str(), c.before, c.now,
                100.0 * c.relative, c.sigmas, c.drifted() ? "  DRIFT" : "");
    csv.row(name, bag, days, c.quantity, c.before, c.now, c.sigmas, c.drifted() ? "true" : "false", stamp);
    drifted += c.drifted();
  }
  return drifted;
}

int run(const Options& options) {
  const History history = read(options.bags);
  CsvWriter csv("measured,bag,days,quantity,first,now,deviations,drifted,stamp", 16);
  int compared = 0, drifted = 0;
  for (const auto& [name, list] : history.modes) {
    for (std::size_t i = 1; i < list.size(); ++i, ++compared)
      drifted += report(name, list[i].bag, list[0].modes.stamp, list[i].modes.stamp,
                        modeChanges(list[0].modes, list[i].modes, options.allowance), csv);
  }
  for (std::size_t i = 1; i < history.friction.size(); ++i, ++compared) {
    const FrictionOfBag &first = history.friction[0], &now = history.friction[i];
    drifted +=
        report("spindle", now.bag, first.stamp, now.stamp,
               {valueChange("viscous friction", {first.viscous}, {now.viscous}, options.allowance.friction),
                valueChange("Coulomb friction", {first.coulomb}, {now.coulomb}, options.allowance.friction)},
               csv);
  }
  for (const auto& [tool, list] : history.air) {
    for (std::size_t i = 1; i < list.size(); ++i, ++compared)
      drifted +=
          report("spindle in air, " + (tool.empty() ? std::string("tool") : tool), list[i].bag, list[0].stamp,
                 list[i].stamp,
                 airCutChanges(list[0].record, list[i].record, history.sensors, options.allowance), csv);
  }
  if (compared == 0)
    throw Error(options.bags.front() +
                ": no quantity was measured twice (topics tool/modes, material/coefficients; air cuts)");
  if (!options.out.empty()) csv.save(options.out);
  std::printf("%d measurements compared with the first of their kind, %d quantities drifted\n", compared,
              drifted);
  return 0;
}

}  // namespace

smartmill::Command healthCommand() {
  smartmill::Command command("health",
                             "reports drift of modes, friction and unbalance over recorded sessions");
  command.description =
      "Health of a spindle over recorded sessions: modes of each tool, point and direction, friction, and "
      "from "
      "air cuts unbalance and spindle load, each compared with its first measurement.";
  command.examples = {
      {"monday.bag friday.bag", "changes in standard deviations, DRIFT where significant"},
      {"*.bag -o health.csv", "every comparison as a table; `database DB keep health.csv` stores it"}};
  command.files = {{"OUT", "CSV measured,bag,days,quantity,first,now,deviations,drifted,stamp"}};
  command.setBody(run, [](CommandLine& line, Options& o) {
    line.option("BAGS", o.bags, "recorded sessions").required();
    line.option("-o,--out", o.out, "CSV of every comparison");
    line.option("--frequency", o.allowance.frequency,
                "allowed change of a frequency from day to day, relative")
        .notNegative()
        .showDefault();
    line.option("--damping", o.allowance.damping, "allowed change of a damping ratio, relative")
        .notNegative()
        .showDefault();
    line.option("--gain", o.allowance.gain, "allowed change of a gain, relative").notNegative().showDefault();
    line.option("--friction", o.allowance.friction, "allowed change of the friction, relative")
        .notNegative()
        .showDefault();
    line.option("--unbalance", o.allowance.unbalance,
                "allowed change of the unbalance, relative; a tool clamped anew turns it")
        .notNegative()
        .showDefault();
  });
  return command;
}

}  // namespace smartmill::hammer
