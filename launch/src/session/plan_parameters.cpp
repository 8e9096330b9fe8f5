#include "smartmill_core/error.h"
#include "smartmill_launch/session/session_plan.h"

namespace smartmill::session {
namespace {

void declareTests(PlanParameters& p, ParameterTable& table) {
  table.section("Air cuts: the spindle's friction.");
  table.list("air_speeds", p.air_speeds, "rad/s", Range::positive(),
             "3000, 6000, 9000, 12000 rpm; four or more");
  table.number("air_time", p.air_time, "s", Range::positive(), "at speed");
  table.list(
      "air_feeds", p.air_feeds, "m/s", Range::positive(),
      "moves in air along +x, for the feed drives' friction where motor currents are read; empty: none");
  table.number("air_move_time", p.air_move_time, "s", Range::positive(), "of such a move");
  table.number("air_way", p.air_way, "m", Range::positive(),
               "that it goes at least: three periods of a motor's current");
  table.section("Slot tests: the cutting coefficients. Each in a lane of its own.");
  table.number("slot_speed", p.slot_speed, "rad/s", Range::positive(), "4000 rpm");
  table.number("slot_depth", p.slot_depth, "m", Range::positive(), "shallow: no chatter is wanted");
  table.list("slot_feeds", p.slot_feeds, "m", Range::positive(), "a tooth; three or more");
  table.number("slot_time", p.slot_time, "s", Range::positive(), "longest steady stretch");
  table.number("least_slot_time", p.least_slot_time, "s", Range::positive(),
               "shortest; the load meter's settling takes about 0.2 s of it");
}

void declareChecks(PlanParameters& p, ParameterTable& table) {
  table.section("The cuts that verify the chart, at the chart's feed per tooth.");
  table.number("stable_time", p.stable_time, "s", Range::positive(),
               "longest steady stretch at the recommended point");
  table.number("unstable_time", p.unstable_time, "s", Range::positive(), "at the unstable point");
  table.number("least_revolutions", p.least_revolutions, "1", Range::positive(),
               "of the spindle in a steady stretch, else the point is not taken");
  table.section(
      "A light cut whose teeth pass at the dynamometer's resonance: raw against compensated force.");
  table.number("resonance_speed", p.resonance_speed, "rad/s", Range::notNegative(),
               "13950 rpm, 4 teeth pass at 930 Hz; 0.0: none");
  table.number("resonance_depth", p.resonance_depth, "m", Range::positive(), "of that cut");
  table.number("resonance_feed", p.resonance_feed, "m", Range::positive(), "a tooth");
  table.number("resonance_time", p.resonance_time, "s", Range::positive(), "longest steady stretch");
}

}  // namespace

void PlanParameters::declare(ParameterTable& table) {
  declareNames(table);
  declareTests(*this, table);
  declareChecks(*this, table);
  declarePaths(table);
}

void PlanParameters::validate() const {
  checkBounds(*this);
  if (tool.empty()) throw Error("tool: a name is due");
  if (air_speeds.size() < 4)
    throw Error("air_speeds: " + std::to_string(air_speeds.size()) + " speeds, 4 or more are due");
  if (slot_feeds.size() < 3)
    throw Error("slot_feeds: " + std::to_string(slot_feeds.size()) + " feeds, 3 or more are due");
}

}  // namespace smartmill::session
