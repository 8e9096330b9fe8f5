#include "smartmill_launch/discovery/discovery_parameters.h"

#include "smartmill_core/error.h"

namespace smartmill::discovery {

void DiscoveryParameters::declare(ParameterTable& table) {
  const Range patience = Range::closed(1e-3, 1e5);
  table.title(
      "Parameters of discover_node (package smartmill_launch): the curious machine. SI units throughout.");
  table.atLaunch(
      "model", model,
      "path of a smartmill-model/1 file: what is believed, with coefficients, noise, axes and workpiece");
  table.atLaunch("record_folder", record_folder, "where the monitor keeps its stretches, all of them");
  table.atLaunch("folder", folder, "for reports and models");
  table.atLaunch(
      "prior", prior,
      "path of a smartmill-causes/1 file: odds of each effect by the shop's other machines; empty: none");
  table.section(
      "What is cut and watched first: full slots, each in a lane of its own, and the spindle in air.");
  table.list("watch_speeds", watch_speeds, "rad/s", Range::positive(),
             "of each slot; four or more, one of them between the others in all three: it is held out");
  table.list("watch_feeds", watch_feeds, "m", Range::positive(), "a tooth, of each slot");
  table.list("watch_depths", watch_depths, "m", Range::positive(), "of each slot");
  table.list("watch_air", watch_air, "rad/s", Range::positive(), "of the spindle in air");
  table.number("slot_time", slot_time, "s", Range::positive(),
               "longest steady stretch: two of the monitor's");
  table.number("least_slot_time", least_slot_time, "s", Range::positive(), "shortest");
  table.number("air_time", air_time, "s", Range::positive(), "at speed");
  paths.declareNames(table);
  paths.declarePaths(table);
  table.section("Patience.");
  table.number("threads", threads, "1", Range::closed(1, 64), "of explain");
  table.number("ready_timeout", ready_timeout, "s", patience, "for nodes and controller to be there");
  table.number("program_timeout", program_timeout, "s", patience, "beyond a program's own time");
  table.number("judged_timeout", judged_timeout, "s", patience, "until the monitor has judged a cut");
  table.number("quiet_time", quiet_time, "s", patience, "of the monitor after which it has judged all of it");
  table.number("explain_timeout", explain_timeout, "s", patience,
               "of one explanation; then what was found until then counts");
}

void DiscoveryParameters::validate() const {
  checkBounds(*this);
  if (model.empty()) throw Error("model: the path of a smartmill-model/1 file is due");
  if (record_folder.empty()) throw Error("record_folder: the folder of the monitor's stretches is due");
  if (folder.empty()) throw Error("folder: a folder for reports and models is due");
  if (watch_speeds.size() < 4 || watch_feeds.size() != watch_speeds.size() ||
      watch_depths.size() != watch_speeds.size()) {
    throw Error("watch_speeds, watch_feeds, watch_depths: " + std::to_string(watch_speeds.size()) + ", " +
                std::to_string(watch_feeds.size()) + " and " + std::to_string(watch_depths.size()) +
                " values, as many of each are due, four or more");
  }
}

session::SlotWish DiscoveryParameters::frame(const std::string& name, std::size_t lane) const {
  session::SlotWish wish;
  wish.name = name;
  wish.lane = lane;
  wish.time = slot_time;
  wish.least_time = least_slot_time;
  return wish;
}

std::vector<session::PlannedCut> DiscoveryParameters::watched(const session::CutPlanner& planner,
                                                              const std::string& prefix,
                                                              std::size_t lane) const {
  planner.needLanes(lane + watch_speeds.size(),
                    lane == 0 ? "slots to watch" : "slots to watch, beside those already cut");
  std::vector<session::PlannedCut> cuts;
  for (const double speed : watch_air) {
    cuts.push_back(planner.air(speed, air_time));
    cuts.back().condition.name = prefix + cuts.back().condition.name;
  }
  for (std::size_t k = 0; k < watch_speeds.size(); ++k) {
    session::SlotWish wish = frame(prefix + "slot_" + std::to_string(k + 1), lane + k);
    wish.speed = watch_speeds[k];
    wish.feed_per_tooth = watch_feeds[k];
    wish.depth = watch_depths[k];
    cuts.push_back(planner.slot(wish));
  }
  return cuts;
}

}  // namespace smartmill::discovery
