#include "smartmill_launch/discovery/discovery_parameters.h"

#include <algorithm>

#include "smartmill_core/error.h"

namespace smartmill::discovery {

void DiscoveryParameters::declare(ParameterTable& table) {
  const Range waiting_time = Range::closed(1e-3, 1e5);
  table.title(
      "Parameters of discover_node (package smartmill_launch): self-identification. SI units throughout.");
  table.atLaunch(
      "model", model,
      "path of a smartmill-model/1 file: nominal model with coefficients, noise, axes and workpiece");
  table.atLaunch("record_folder", record_folder, "folder to which the monitor records all segments");
  table.atLaunch("folder", folder, "folder for reports and models");
  table.atLaunch("prior", prior,
                 "path of a smartmill-causes/1 file: odds of each effect on the other machines of the shop; "
                 "empty: none");
  table.section("Initial cuts: full slots, each in its own lane, and air cuts.");
  table.list("watch_speeds", watch_speeds, "rad/s", Range::positive(),
             "spindle speed of each slot; four or more, one of them between the others in speed, feed and "
             "depth: it is held out");
  table.list("watch_feeds", watch_feeds, "m", Range::positive(), "feed per tooth of each slot");
  table.list("watch_depths", watch_depths, "m", Range::positive(), "axial depth of each slot");
  table.list("watch_air", watch_air, "rad/s", Range::positive(), "spindle speed of each air cut");
  table.number("slot_time", slot_time, "s", Range::positive(),
               "maximum time of steady cutting: two segments of the monitor");
  table.number("least_slot_time", least_slot_time, "s", Range::positive(), "minimum time of steady cutting");
  table.number("stable_share", stable_share, "1", Range::openLow(0.0, 1.0),
               "largest depth of a slot over the stability limit that the model in use predicts; deeper cuts "
               "are made at this depth");
  table.number("air_time", air_time, "s", Range::positive(), "time of an air cut at speed");
  paths.declareNames(table);
  paths.declarePaths(table);
  table.section("Computing and time limits.");
  table.number("threads", threads, "1", Range::closed(1, 64), "threads of explain");
  table.number("ready_timeout", ready_timeout, "s", waiting_time, "until nodes and controller are available");
  table.number("program_timeout", program_timeout, "s", waiting_time, "of a program, beyond its own time");
  table.number("judged_timeout", judged_timeout, "s", waiting_time,
               "until the monitor reports a result of a cut");
  table.number("quiet_time", quiet_time, "s", waiting_time,
               "without a result of the monitor, after which its results are complete");
  table.number("explain_budget", explain_budget, "s", waiting_time, "of one run of explain");
}

void DiscoveryParameters::validate() const {
  checkBounds(*this);
  if (model.empty()) throw Error("model: empty, expected the path of a smartmill-model/1 file");
  if (record_folder.empty())
    throw Error("record_folder: empty, expected the folder of the segments of the monitor");
  if (folder.empty()) throw Error("folder: empty, expected a folder for reports and models");
  if (watch_speeds.size() < 4 || watch_feeds.size() != watch_speeds.size() ||
      watch_depths.size() != watch_speeds.size()) {
    throw Error("watch_speeds, watch_feeds, watch_depths: " + std::to_string(watch_speeds.size()) + ", " +
                std::to_string(watch_feeds.size()) + " and " + std::to_string(watch_depths.size()) +
                " values, expected equal numbers, four or more");
  }
}

session::SlotRequest DiscoveryParameters::slotRequest(const std::string& name, std::size_t lane) const {
  session::SlotRequest request;
  request.name = name;
  request.lane = lane;
  request.time = slot_time;
  request.least_time = least_slot_time;
  return request;
}

std::vector<session::PlannedCut> DiscoveryParameters::initialCuts(const session::CutPlanner& planner,
                                                                  const std::string& prefix, std::size_t lane,
                                                                  const BelievedLimits& limits) const {
  planner.requireLanes(lane + watch_speeds.size(),
                       lane == 0 ? "initial slots" : "initial slots, in addition to those already cut");
  std::vector<session::PlannedCut> cuts;
  for (const double speed : watch_air) {
    cuts.push_back(planner.air(speed, air_time));
    cuts.back().condition.name = prefix + cuts.back().condition.name;
  }
  for (std::size_t k = 0; k < watch_speeds.size(); ++k) {
    session::SlotRequest request = slotRequest(prefix + "slot_" + std::to_string(k + 1), lane + k);
    request.speed = watch_speeds[k];
    request.feed_per_tooth = watch_feeds[k];
    request.depth = std::min(watch_depths[k], limits.depthAt(request.speed));
    cuts.push_back(planner.slot(request));
  }
  return cuts;
}

}  // namespace smartmill::discovery
