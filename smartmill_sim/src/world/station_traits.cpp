#include "smartmill_sim/world/station_traits.h"

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

void declareStructure(StationTraits& t, ParameterTable& table) {
  table.choice(
      "structure", t.structure, {"modes", "beam"},
      "modes: the model's tool_tip, the tool is rigid and rotates about one point in every mode; beam: the "
      "tool is a beam on spindle and holder with the keys up to plane_turn, instead of the model's tool_tip");
  table.number("pivot", t.pivot, "m", Range::closed(0.05, 100.0),
               "height above the tip of the point about which a rigid tool rotates");
  table.number("shank_diameter", t.shank_diameter, "m", Range::closed(0.0, 0.1),
               "diameter of the shank; 0: that of the tool");
  table.number("flute_length", t.flute_length, "m", Range::closed(0.0, 0.5),
               "length of the flutes from the tip");
  table.number("flute_core", t.flute_core, "1", Range::openLow(0.3, 1.0),
               "equivalent diameter of the fluted part, relative to the tool's diameter");
  table.number("young", t.young, "Pa", Range::closed(1e10, 1e12),
               "Young's modulus; 5.8e+11: carbide, 2.1e+11: steel");
  table.number("density", t.density, "kg/m3", Range::closed(1e3, 2e4), "14500: carbide, 7850: steel");
  table.number("tool_damping", t.tool_damping, "1", Range::closed(0.0, 0.2), "loss factor of the tool");
  table.list("spindle_frequency", t.spindle_frequency, "Hz", Range::openLow(10.0, 2e4),
             "natural frequencies of spindle and holder without the tool, one per mode");
  table.list("spindle_damping", t.spindle_damping, "1", Range::open(0.0, 0.5), "damping ratio, one per mode");
  table.list("spindle_stiffness", t.spindle_stiffness, "N/m", Range::openLow(1e5, 1e12),
             "modal stiffness at the holder's face, one per mode");
  table.list("spindle_slope", t.spindle_slope, "rad/m", Range::closed(-200.0, 200.0),
             "rotation of the holder's face over its displacement, one per mode");
  table.number("joint_stiffness", t.joint_stiffness, "N/m", Range::closed(1e6, 1e13),
               "lateral stiffness between holder and tool");
  table.number("joint_rotation", t.joint_rotation, "N m/rad", Range::closed(1e2, 1e9),
               "tilting stiffness between holder and tool");
  table.number("joint_damping", t.joint_damping, "1", Range::closed(0.0, 0.5), "loss factor of the joint");
  table.number("plane_ratio", t.plane_ratio, "1", Range::closed(0.5, 2.0),
               "spindle frequencies in the second principal plane over those of the first");
  table.number("plane_turn", t.plane_turn, "rad", Range::closed(-units::PI, units::PI),
               "angle of the first principal plane from x towards y");
}

void declareSensor(StationTraits& t, ParameterTable& table) {
  table.number(
      "read_height", t.read_height, "m", Range::closed(0.0, 0.05),
      "height of the sensor's centre above the tip; the hammer is above the sensor by the model's offset");
  table.number(
      "electrode", t.electrode, "m", Range::closed(0.0, 0.01),
      "diameter of the electrode, which averages 1 / gap over the tool's surface; 0: a point sensor");
  table.number("housing", t.housing, "m", Range::closed(0.0, 0.05),
               "diameter of the sensor's face, contact with the tool raises an alarm; 0: no alarm");
  table.number("beside", t.beside, "m", Range::closed(-1e-3, 1e-3),
               "lateral offset of the sensor from the tool axis");
  table.number("gain_error", t.gain_error, "1", Range::closed(-0.5, 0.5),
               "relative error of the sensor's gain");
  table.number("bend", t.bend, "1", Range::closed(-0.2, 0.2),
               "nonlinearity: output V + bend V^2 / range for the nominal voltage V");
  table.flag("cross_sensor", t.cross_sensor,
             "whether a second sensor is perpendicular to the first, channel gap_cross of daq/hammer");
  table.choice("tooth", t.tooth, {"flute", "insert"},
               "flute: rounded on both sides of the edge; insert: a straight relief behind a sharp edge");
  table.number("rake_flank", t.rake_flank, "rad", Range::closed(0.005, 3.0),
               "width of the rake flank in front of an edge");
  table.number("relief_flank", t.relief_flank, "rad", Range::closed(0.005, 3.0),
               "width of the relief flank behind it, for an insert down to the floor");
  table.number("land", t.land, "rad", Range::closed(0.0, 1.0),
               "width of the cylindrical land behind an edge");
  table.list("tooth_low", t.tooth_low, "m", Range::closed(0.0, 1e-3),
             "distance of each tooth from the cutting circle; empty: 0");
  table.number("eccentricity", t.eccentricity, "m", Range::closed(0.0, 2e-4),
               "eccentricity of the tool in the spindle");
  table.number("eccentricity_angle", t.eccentricity_angle, "rad", {},
               "angle of the eccentricity from tooth 1");
}

void declareSolenoid(StationTraits& t, ParameterTable& table) {
  table.number("pulse_skew", t.pulse_skew, "1", Range::closed(-0.4, 0.4),
               "skew of the pulse sin(pi u^(1 + skew)) over the relative contact time u");
  table.number("pulse_scatter", t.pulse_scatter, "1", Range::closed(0.0, 0.2),
               "standard deviation of the skew");
  table.number("contact_scatter", t.contact_scatter, "1", Range::closed(0.0, 0.3),
               "standard deviation of the contact time, relative to its nominal value");
  table.number("bounce_chance", t.bounce_chance, "1", Range::closed(0.0, 1.0), "probability of a second hit");
  table.number("bounce_share", t.bounce_share, "1", Range::closed(0.0, 1.0),
               "mean peak of the second hit, relative to the first");
  table.number("bounce_delay", t.bounce_delay, "s", Range::closed(1e-4, 0.05),
               "mean time from the end of the first hit to the second");
  table.number("coil_time", t.coil_time, "s", Range::closed(1e-4, 0.05),
               "time constant of the solenoid's current, which ends at the contact");
  table.number("coil_force", t.coil_force, "N", Range::closed(-50.0, 50.0),
               "offset of the force channel at full current");
  table.number("coil_volt", t.coil_volt, "V", Range::closed(-1.0, 1.0),
               "offset of the sensor's channel at full current");
  table.number("axis_scatter", t.axis_scatter, "m", Range::closed(0.0, 1e-5),
               "standard deviation of the position at which an axis stops");
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
    throw Error(std::string(key) + ": " + std::to_string(size) + " values, expected " +
                std::to_string(modes) + " as spindle_frequency");
  };
  if (structure == "beam" && modes == 0) throw Error("spindle_frequency: empty, expected at least one mode");
  same("spindle_damping", spindle_damping.size());
  same("spindle_stiffness", spindle_stiffness.size());
  same("spindle_slope", spindle_slope.size());
}

}  // namespace smartmill::sim
