#include "smartmill_sim/world/station_traits.h"

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

void declareStructure(StationTraits& t, ParameterTable& table) {
  table.choice(
      "structure", t.structure, {"modes", "beam"},
      "modes: the model's tool_tip, the tool rigid and turning about one point in every mode; beam: the "
      "tool as a beam on spindle and holder, as the keys up to plane_turn say, in the place of the "
      "model's tool_tip");
  table.number("pivot", t.pivot, "m", Range::closed(0.05, 100.0),
               "height above the tip of the point about which a rigid tool turns");
  table.number("shank_diameter", t.shank_diameter, "m", Range::closed(0.0, 0.1), "0: the tool's");
  table.number("flute_length", t.flute_length, "m", Range::closed(0.0, 0.5), "from the tip");
  table.number("flute_core", t.flute_core, "1", Range::openLow(0.3, 1.0),
               "diameter of the round beam that bends like the fluted part, over the tool's");
  table.number("young", t.young, "Pa", Range::closed(1e10, 1e12), "5.8e+11: carbide, 2.1e+11: steel");
  table.number("density", t.density, "kg/m3", Range::closed(1e3, 2e4), "14500: carbide, 7850: steel");
  table.number("tool_damping", t.tool_damping, "1", Range::closed(0.0, 0.2), "loss factor of the tool");
  table.list("spindle_frequency", t.spindle_frequency, "Hz", Range::openLow(10.0, 2e4),
             "of spindle and holder without the tool, one a mode");
  table.list("spindle_damping", t.spindle_damping, "1", Range::open(0.0, 0.5), "ratio, one a mode");
  table.list("spindle_stiffness", t.spindle_stiffness, "N/m", Range::openLow(1e5, 1e12),
             "at the holder's face, one a mode");
  table.list("spindle_slope", t.spindle_slope, "rad/m", Range::closed(-200.0, 200.0),
             "turn of the holder's face over its displacement, one a mode");
  table.number("joint_stiffness", t.joint_stiffness, "N/m", Range::closed(1e6, 1e13),
               "between holder and tool, across");
  table.number("joint_rotation", t.joint_rotation, "N m/rad", Range::closed(1e2, 1e9), "against tilting");
  table.number("joint_damping", t.joint_damping, "1", Range::closed(0.0, 0.5), "loss factor of the joint");
  table.number("plane_ratio", t.plane_ratio, "1", Range::closed(0.5, 2.0),
               "spindle frequencies in the second principal plane over those of the first");
  table.number("plane_turn", t.plane_turn, "rad", Range::closed(-units::PI, units::PI),
               "of the first principal plane from x towards y");
}

void declareSensor(StationTraits& t, ParameterTable& table) {
  table.number("read_height", t.read_height, "m", Range::closed(0.0, 0.05),
               "of the sensor's centre above the tip; the hammer stands the model's offset above the sensor");
  table.number("electrode", t.electrode, "m", Range::closed(0.0, 0.01),
               "diameter of the electrode, which averages 1 / gap over the tool's surface; 0: a point");
  table.number("housing", t.housing, "m", Range::closed(0.0, 0.05),
               "diameter of the sensor's face, which the tool touches with an alarm; 0: it gives way");
  table.number("beside", t.beside, "m", Range::closed(-1e-3, 1e-3), "sensor off the tool's axis");
  table.number("gain_error", t.gain_error, "1", Range::closed(-0.5, 0.5), "of the sensor over its nominal");
  table.number("bend", t.bend, "1", Range::closed(-0.2, 0.2),
               "the sensor shows V + bend V^2 / range, V that of its nominal curve");
  table.flag("cross_sensor", t.cross_sensor,
             "a second sensor at right angles to the first, channel gap_cross of daq/hammer");
  table.choice("tooth", t.tooth, {"flute", "insert"},
               "flute: rounded either side of the edge; insert: a straight relief behind a sharp edge");
  table.number("rake_flank", t.rake_flank, "rad", Range::closed(0.005, 3.0),
               "width of the flank before an edge");
  table.number("relief_flank", t.relief_flank, "rad", Range::closed(0.005, 3.0),
               "width of the flank behind it, of an insert down to the floor");
  table.number("land", t.land, "rad", Range::closed(0.0, 1.0), "cylindrical part behind an edge");
  table.list("tooth_low", t.tooth_low, "m", Range::closed(0.0, 1e-3),
             "how far each tooth stands behind the cutting circle; empty: none");
  table.number("eccentricity", t.eccentricity, "m", Range::closed(0.0, 2e-4), "of the tool in the spindle");
  table.number("eccentricity_angle", t.eccentricity_angle, "rad", {}, "from tooth 1");
}

void declareSolenoid(StationTraits& t, ParameterTable& table) {
  table.number("pulse_skew", t.pulse_skew, "1", Range::closed(-0.4, 0.4),
               "the pulse is sin(pi u^(1 + skew)), u the share of the contact");
  table.number("pulse_scatter", t.pulse_scatter, "1", Range::closed(0.0, 0.2),
               "standard deviation of the skew");
  table.number("contact_scatter", t.contact_scatter, "1", Range::closed(0.0, 0.3),
               "standard deviation of the contact time over its nominal value");
  table.number("bounce_chance", t.bounce_chance, "1", Range::closed(0.0, 1.0), "of a second blow");
  table.number("bounce_share", t.bounce_share, "1", Range::closed(0.0, 1.0),
               "mean peak of the second blow over the first's");
  table.number("bounce_delay", t.bounce_delay, "s", Range::closed(1e-4, 0.05),
               "mean time from the first blow's end to the second");
  table.number("coil_time", t.coil_time, "s", Range::closed(1e-4, 0.05),
               "time constant of the solenoid's current, which ends at the touch");
  table.number("coil_force", t.coil_force, "N", Range::closed(-50.0, 50.0),
               "that the full current adds to the force channel");
  table.number("coil_volt", t.coil_volt, "V", Range::closed(-1.0, 1.0),
               "that the full current adds to the sensor's channel");
  table.number("axis_scatter", t.axis_scatter, "m", Range::closed(0.0, 1e-5),
               "standard deviation of where an axis stops");
}

}  // namespace

void StationTraits::declare(ParameterTable& table) {
  table.section("Hammer station: structure of the tool.");
  declareStructure(*this, table);
  table.section("Hammer station: displacement sensor and the tool's surface before it.");
  declareSensor(*this, table);
  table.section("Hammer station: solenoid and axes.");
  declareSolenoid(*this, table);
}

void StationTraits::validate() const {
  checkBounds(*this);
  const std::size_t modes = spindle_frequency.size();
  const auto same = [&](const char* key, std::size_t size) {
    if (size == modes) return;
    throw Error(std::string(key) + ": " + std::to_string(size) + " values, spindle_frequency has " +
                std::to_string(modes));
  };
  if (structure == "beam" && modes == 0) throw Error("spindle_frequency: a mode is due");
  same("spindle_damping", spindle_damping.size());
  same("spindle_stiffness", spindle_stiffness.size());
  same("spindle_slope", spindle_slope.size());
}

}  // namespace smartmill::sim
