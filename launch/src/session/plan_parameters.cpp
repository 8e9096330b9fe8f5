#include "smartmill_core/error.h"
#include "smartmill_launch/session/session_plan.h"

namespace smartmill::session {
namespace {

void declareTests(PlanParameters& p, ParameterTable& table) {
  table.section("Air cuts: friction of the spindle.");
  table.list("air_speeds", p.air_speeds, "rad/s", Range::positive(),
             "spindle speeds, four or more (3000, 6000, 9000, 12000 rpm)");
  table.number("air_time", p.air_time, "s", Range::positive(), "time at speed");
  table.list(
      "air_feeds", p.air_feeds, "m/s", Range::positive(),
      "feeds of moves in air along +x, for the friction of the feed drives from motor currents; empty: none");
  table.number("air_move_time", p.air_move_time, "s", Range::positive(), "minimum time of such a move");
  table.number("air_way", p.air_way, "m", Range::positive(),
               "minimum distance of such a move: three periods of a motor's current");
  table.section("Slot tests: cutting coefficients. Each slot has its own lane.");
  table.number("slot_speed", p.slot_speed, "rad/s", Range::positive(), "spindle speed (4000 rpm)");
  table.number("slot_depth", p.slot_depth, "m", Range::positive(), "axial depth, shallow to avoid chatter");
  table.list("slot_feeds", p.slot_feeds, "m", Range::positive(), "feeds per tooth, three or more");
  table.number("slot_time", p.slot_time, "s", Range::positive(), "maximum time of steady cutting");
  table.number("least_slot_time", p.least_slot_time, "s", Range::positive(),
               "minimum time of steady cutting; the load meter settles in about 0.2 s");
  table.choice(
      "test_cuts", p.test_cuts, {"slots", "informative"},
      "slots: one at each feed; informative: of slots and cuts of half immersion at these feeds, those "
      "with the most information per second of cutting until the targets are reached");
  table.number("half_up_depth", p.half_up_depth, "m", Range::positive(),
               "axial depth of up-milling cuts of half immersion; more informative than slots from twice "
               "their depth on");
  table.number("half_down_depth", p.half_down_depth, "m", Range::positive(), "the same of down-milling cuts");
  table.number("target_ktc_std", p.target_ktc_std, "N/m2", Range::positive(),
               "informative: standard deviation of Ktc at which no further cut is made");
  table.number("target_kte_std", p.target_kte_std, "N/m", Range::positive(), "the same of Kte");
}

void declareChecks(PlanParameters& p, ParameterTable& table) {
  table.section("Cuts that verify the stability chart, at its feed per tooth.");
  table.number("stable_time", p.stable_time, "s", Range::positive(),
               "maximum time of steady cutting at the recommended point");
  table.number("unstable_time", p.unstable_time, "s", Range::positive(),
               "maximum time of steady cutting at the unstable point");
  table.number(
      "control_time", p.control_time, "s", Range::notNegative(),
      "maximum time of steady cutting at the unstable point under chatter control (set by the launch "
      "file where the control acts); 0.0: no such cut");
  table.number("least_revolutions", p.least_revolutions, "1", Range::positive(),
               "minimum spindle revolutions of steady cutting; points with fewer are skipped");
  table.section("Without a hammer: stability is learned from cuts (docs/stability.md).");
  table.flag(
      "hammer", p.hammer,
      "false: no FRFs, no taps, no cut at the sensor's resonance; a slot is chosen, made and judged up to "
      "probing_cuts times, and the recommended slot verifies the result");
  table.number("probing_cuts", p.probing_cuts, "1", Range::closed(3, 20),
               "largest number of these slots; fewer if the stock has no lanes for them");
  table.section(
      "A light cut with the tooth passing frequency at the resonance of the dynamometer: raw and compensated "
      "force.");
  table.number("resonance_speed", p.resonance_speed, "rad/s", Range::notNegative(),
               "spindle speed (13950 rpm: 4 teeth pass at 930 Hz); 0.0: no such cut");
  table.number("resonance_depth", p.resonance_depth, "m", Range::positive(), "axial depth");
  table.number("resonance_feed", p.resonance_feed, "m", Range::positive(), "feed per tooth");
  table.number("resonance_time", p.resonance_time, "s", Range::positive(), "maximum time of steady cutting");
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
  if (tool.empty()) throw Error("tool: empty, expected a name");
  if (air_speeds.size() < 4)
    throw Error("air_speeds: " + std::to_string(air_speeds.size()) + " speeds, expected 4 or more");
  if (slot_feeds.size() < 3)
    throw Error("slot_feeds: " + std::to_string(slot_feeds.size()) + " feeds, expected 3 or more");
}

}  // namespace smartmill::session
