#include "smartmill_core/model/effect_catalogue.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "smartmill_core/units.h"

// One entry an effect: this is the place to add one. Ranges of a fit are those of its coordinates, wider than
// what a workshop meets; draws are what it meets.

namespace smartmill {

namespace {

using Forms = std::vector<EffectForm>;
using Need = EffectNeed;
using Random = EffectKind::Random;
using Scope = EffectScope;
using Seek = EffectForm::Seek;
using Stage = EffectStage;

const Range NOT_NEGATIVE = Range::notNegative(), POSITIVE = Range::positive();
const std::vector<std::string> AXES{"x", "y", "z"};

// ---- keys

EffectParameter number(const char* key, const char* unit, const Range& range = {}) {
  EffectParameter p;
  p.key = key;
  p.unit = unit;
  p.range = range;
  return p;
}

EffectParameter orZero(const char* key, const char* unit) {
  EffectParameter p = number(key, unit);
  p.optional = true;
  return p;
}

EffectParameter angle(const char* key) {
  EffectParameter p = number(key, "deg").drawn(0.0, 360.0);
  p.period = 360.0;
  return p;
}

EffectParameter angleOrZero(const char* key) {
  EffectParameter p = angle(key);
  p.optional = true;
  return p;
}

EffectParameter oneOf(const char* key, const std::vector<std::string>& words) {
  EffectParameter p = number(key, "1");
  p.value = EffectValue::word;
  p.words = words;
  return p;
}

EffectParameter oneOfNumbers(const char* key, const char* unit, const std::vector<double>& choices) {
  EffectParameter p = number(key, unit);
  p.choices = choices;
  return p;
}

EffectParameter perTooth(const char* key, const char* unit, const Range& range, std::optional<double> sum) {
  EffectParameter p = number(key, unit, range);
  p.value = EffectValue::list;
  p.sum = sum;
  return p;
}

EffectParameter modes(const char* key) {
  EffectParameter p = number(key, "modes");
  p.value = EffectValue::modes;
  p.optional = true;
  return p;
}

// ---- forms

std::function<Forms(const Scope&)> always(const EffectForm& form) {
  return [form](const Scope&) { return Forms{form}; };
}

// What is added takes away no more than the model has: no edge pulls.
EffectCoordinates added(const char* key, double stated, FitRange range) {
  range.low = -stated;
  return amplitude(key, range);
}

Forms addedEdgeForces(const Scope& scope) {
  const CuttingCoefficients k = scope.nominal.cutting.value_or(CuttingCoefficients{});
  const FitRange range{0.0, 200.0, 0.005, 20.0};
  return {EffectForm({added("Kte_n_per_mm", k.kte / units::N_PER_MM, range),
                      added("Kre_n_per_mm", k.kre / units::N_PER_MM, range),
                      added("Kae_n_per_mm", k.kae / units::N_PER_MM, range)})
              .straight({2.0})};
}

Forms addedChipCoefficients(const Scope& scope) {
  const CuttingCoefficients k = scope.nominal.cutting.value_or(CuttingCoefficients{});
  return {EffectForm({added("Ktc_n_per_mm2", k.ktc / units::N_PER_MM2, {0.0, 4000.0, 0.05, 300.0}),
                      added("Krc_n_per_mm2", k.krc / units::N_PER_MM2, {0.0, 3000.0, 0.05, 200.0}),
                      added("Kac_n_per_mm2", k.kac / units::N_PER_MM2, {0.0, 3000.0, 0.05, 200.0})})
              .straight({10.0})};
}

Forms flexibility(const Scope&) {
  return {EffectForm({tipMode('x')}).named("x").of({"x"}).sought(Seek::tip_mode),
          EffectForm({tipMode('y')}).named("y").of({"y"}).sought(Seek::tip_mode),
          EffectForm({tipMode('x'), tipMode('y')}).named("xy").of({"x", "y"}).sought(Seek::tip_mode)};
}

// The direct share gives the gain; how large that is, a nominal model may not know well.
Forms extraModes(const Scope& scope) {
  Forms forms;
  for (std::size_t a = 0; a < AXES.size(); ++a) {
    if (scope.channels.count("f" + AXES[a]) == 0) continue;
    const double most = std::max(scope.nominal.force_sensor.axis[a].direct, 0.2);
    const EffectForm mode =
        EffectForm(
            {logarithm("frequency_hz", {std::log(20.0), std::log(12000.0), 2.5e-06, 1.5}, 1.0,
                       std::log(800.0)),
             logarithm("damping_ratio", {std::log(0.001), std::log(0.6), 0.00025, 1.0}, 1.0, std::log(0.03)),
             amplitude("gain", {-most, most, 2.5e-05, 0.2})})
            .word("axis", AXES[a])
            .sought(Seek::sensor_mode);
    forms.push_back(EffectForm(mode).named(AXES[a]));
    forms.push_back(EffectForm(mode).named(AXES[a] + ", second").onlyAfter(AXES[a]));
  }
  return forms;
}

Forms crossTalk(const Scope&) {
  std::vector<EffectCoordinates> pairs;
  for (const char* pair : {"xy", "xz", "yx", "yz", "zx", "zy"})
    pairs.push_back(amplitude(pair, {-0.9, 0.9, 0.002, 0.1}));
  return {EffectForm(pairs).straight({0.01})};
}

Forms gainErrors(const Scope& scope) {
  Forms forms;
  for (const std::string& channel : scope.channels) {
    forms.push_back(EffectForm({logarithm("gain", {std::log(0.05), std::log(5.0), 1e-4, 0.2})})
                        .straight({0.02})
                        .word("channel", channel)
                        .named(channel));
  }
  return forms;
}

Forms channelDelays(const Scope& scope) {
  Forms forms;
  for (const std::string& channel : scope.channels) {
    EffectForm form =
        channel == "load_meter"
            ? EffectForm({amplitude("delay_us", {0.0, 2e5, 2.0, 10000.0})}).straight({500.0, 5000.0, 30000.0})
            : EffectForm({amplitude("delay_us", {0.0, 5000.0, 0.02, 200.0})})
                  .straight({10.0, 60.0, 150.0, 400.0});
    forms.push_back(form.word("channel", channel).named(channel));
  }
  return forms;
}

Forms hums(const Scope&) {
  Forms forms;
  for (const double frequency : {50.0, 60.0}) {
    // The twin takes each record's phase from the record, for which the amplitude must not be zero.
    forms.push_back(EffectForm({amplitude("amplitude_n", {0.0, 1e4, 0.0005, 10.0}),
                                amplitude("y_ratio", {-20.0, 20.0, 0.000125, 1.0}, 0.5)})
                        .probe({0.0, 0.6}, {{2.0, 0.6}})
                        .probe({0.0, -0.6}, {{2.0, -0.6}})
                        .number("frequency_hz", frequency)
                        .foundInEachRecord(1)
                        .named(frequency == 50.0 ? "50 Hz" : "60 Hz"));
  }
  return forms;
}

Forms saturations(const Scope& scope) {
  const double most = scope.largest_force;
  return {EffectForm({amplitude("limit_n", {0.02 * most, 8.0 * most, 1e-5 * most, 4.0 * most}, 4.0 * most)})
              .startingAt({0.99 * most})
              .startingAt({0.97 * most})};
}

// Tried at several time constants, in units of the time before the first cut.
Forms thermalGrowth(const Scope& scope) {
  EffectForm form(
      {saturating("growth_um", "time_constant_s", scope.first_cut, {-2000.0, 2000.0, 0.0125, 50.0})});
  for (const double constants : {0.2, 0.6, 1.75}) {
    const double share = std::exp(-1.0 / constants);
    form.probe({0.0, share}, {{10.0, share}});
  }
  return {form};
}

// Up to a ball end.
Forms cornerRadius(const Scope& scope) {
  const double most = scope.nominal.tool->radius() / units::MM;
  return {EffectForm({amplitude("corner_radius_mm", {0.0, most, 1e-4 * most, 0.3 * most})})
              .straight({0.02 * most, 0.1 * most, 0.4 * most})};
}

// ---- draws

double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

double eitherSign(Random& random, double low, double high) {
  const double size = between(random, low, high);
  return std::bernoulli_distribution(0.5)(random) ? size : -size;
}

void drawPitches(const MachineModel& machine, Random& random, EffectEntry& entry) {
  std::vector<double>& pitch = entry.lists["pitch_deg"];
  double rest = 360.0;
  for (int k = 0; k + 1 < machine.tool->teeth; ++k) {
    pitch.push_back(360.0 / machine.tool->teeth + eitherSign(random, 1.0, 5.0));
    rest -= pitch.back();
  }
  pitch.push_back(rest);
}

// One tooth is shorter, the others about alike.
void drawTeeth(const MachineModel& machine, Random& random, EffectEntry& entry) {
  const auto teeth = static_cast<std::size_t>(machine.tool->teeth);
  std::vector<double>& offset = entry.lists["offset_um"];
  for (std::size_t k = 0; k < teeth; ++k) offset.push_back(between(random, -3.0, 3.0));
  offset[std::uniform_int_distribution<std::size_t>(0, teeth - 1)(random)] -= between(random, 8.0, 30.0);
  const double mean = std::accumulate(offset.begin(), offset.end(), 0.0) / static_cast<double>(teeth);
  for (double& o : offset) o -= mean;
}

void drawCorner(const MachineModel& machine, Random& random, EffectEntry& entry) {
  entry.numbers["corner_radius_mm"] = between(random, 0.08, 0.5) * machine.tool->radius() / units::MM;
}

void drawHelix(const MachineModel& machine, Random& random, EffectEntry& entry) {
  entry.numbers["helix_deg"] = units::degFromRad(machine.tool->helix) + eitherSign(random, 3.0, 9.0);
}

void drawTipModes(const MachineModel&, Random& random, EffectEntry& entry) {
  for (ModalModel* axis : {&entry.flexibility.x, &entry.flexibility.y}) {
    Mode mode;
    mode.frequency = between(random, 800.0, 2200.0);
    mode.damping_ratio = between(random, 0.03, 0.06);
    mode.gain = 1.0 / (units::N_PER_UM * between(random, 25.0, 50.0));
    axis->modes = {mode};
  }
}

void drawCrossTalk(const MachineModel&, Random& random, EffectEntry& entry) {
  for (auto& [pair, share] : entry.numbers) {
    if (std::bernoulli_distribution(0.5)(random)) share = 0.0;
  }
  if (entry.numbers["xz"] == 0.0 && entry.numbers["yx"] == 0.0)
    entry.numbers["xy"] = eitherSign(random, 0.02, 0.08);
}

// What the stated uncertainty of the load meter's constant covers is no effect.
void drawLargerLoadGain(const MachineModel&, Random& random, EffectEntry& entry) {
  if (entry.words["channel"] == "load_meter") entry.numbers["gain"] = 1.0 + eitherSign(random, 0.15, 0.3);
}

// ---- entries, in the order in which they act

std::vector<EffectKind> geometry() {
  return {
      {"uneven_pitch",
       Stage::geometry,
       "teeth not evenly spaced; each tooth takes its pitch's share of the feed",
       "Budak 2003",
       {perTooth("pitch_deg", "deg", POSITIVE, 360.0)},
       {Need::cuts, Need::several_teeth},
       [](const Scope& s) {
         return Forms{
             EffectForm({pitches("pitch_deg", *s.nominal.tool, {-30.0, 30.0, 5e-4, 5.0})}).straight({0.5})};
       },
       drawPitches},
      {"runout",
       Stage::geometry,
       "tooth j cuts at radius R + offset cos(angle - position of tooth j)",
       "Kline & DeVor 1983; Dunwoody 6.1",
       {number("offset_um", "um", NOT_NEGATIVE).drawn(5.0, 25.0), angle("angle_deg")},
       {Need::cuts},
       always(EffectForm({planar("offset_um", "angle_deg", 200.0, 5e-4, 20.0)}).straight({1.0, 15.0}))},
      {"tooth_radius",
       Stage::geometry,
       "tooth j cuts at radius R + offset[j]: a chipped, re-ground or badly seated insert; only differences "
       "act",
       "Kline & DeVor 1983, with a radius for each tooth",
       {perTooth("offset_um", "um", {}, {})},
       {Need::cuts, Need::several_teeth},
       [](const Scope& s) {
         return Forms{EffectForm({contrasts("offset_um", s.nominal.tool->teeth, {-200.0, 200.0, 5e-4, 20.0})})
                          .straight({1.0, 15.0})};
       },
       drawTeeth,
       20.0},  // up to three teeth no record tells it from runout
      {"helix",
       Stage::geometry,
       "another helix angle than nominal",
       "Dunwoody eq. 5.64",
       {number("helix_deg", "deg", {0.0, 80.0, false, true})},
       {Need::cuts},
       [](const Scope& s) {
         const double helix = units::degFromRad(s.nominal.tool->helix);
         return Forms{EffectForm({amplitude("helix_deg", {0.0, 75.0, 0.0025, 8.0}, helix)})
                          .straight({helix > 60.0 ? -1.0 : 1.0})};
       },
       drawHelix},
      {"corner_radius",
       Stage::geometry,
       "bull-nose or ball end: below this height the edge's normal turns from radial to axial; chip, local "
       "radius and split of forces follow",
       "Altintas & Lee 1996; Engin & Altintas 2001",
       {number("corner_radius_mm", "mm", NOT_NEGATIVE)},
       {Need::cuts},
       cornerRadius,
       drawCorner},
  };
}

std::vector<EffectKind> motion() {
  return {
      {"feed_error",
       Stage::motion,
       "actual feed over commanded feed",
       "feed drive or override away from the commanded feed",
       {number("ratio", "1", POSITIVE).drawnOnBothSides(0.12, 0.25, 1.0)},
       {Need::cuts},
       always(EffectForm({logarithm("ratio", {std::log(0.2), std::log(5.0), 1e-4, 0.2})}).straight({0.02}))},
      {"depth_tilt",
       Stage::motion,
       "the axial depth changes along the feed path from engagement",
       "stock or table not level along the feed",
       {number("slope_um_per_mm", "um/mm").drawnOnBothSides(15.0, 60.0)},
       {Need::cuts},
       always(EffectForm({amplitude("slope_um_per_mm", {-900.0, 900.0, 0.0125, 50.0})}).straight({5.0}))},
      {"thermal_growth",
       Stage::motion,
       "the axial depth of a cut grows by growth x (1 - exp(-start_time / constant))",
       "Ramesh, Mannan & Poo 2000: spindle and tool grow while they warm up",
       {number("growth_um", "um").drawn(30.0, 120.0),
        number("time_constant_s", "s", POSITIVE).drawn(120.0, 500.0)},
       {Need::cuts, Need::start_time},
       thermalGrowth},
  };
}

std::vector<EffectKind> chipAndEdge() {
  return {
      {"edge_forces",
       Stage::cutting_law,
       "adds to the edge coefficients",
       "Dunwoody eq. 2.1; Armarego & Deshpande 1991",
       {orZero("Kte_n_per_mm", "N/mm").drawn(4.0, 15.0), orZero("Kre_n_per_mm", "N/mm").drawn(4.0, 15.0),
        orZero("Kae_n_per_mm", "N/mm").drawn(0.5, 4.0)},
       {Need::cuts},
       addedEdgeForces},
      {"size_effect",
       Stage::cutting_law,
       "Kc multiplied by (h / reference)^-exponent",
       "Kienzle 1952",
       {number("exponent", "1").drawn(0.1, 0.35),
        number("reference_chip_um", "um", POSITIVE).drawn(40.0, 120.0)},
       {Need::cuts},
       // A level without a slope cannot be written: each point has some slope.
       always(EffectForm({powerLaw("exponent", "reference_chip_um", 60.0, 1.0, 3000.0)})
                  .probe({0.0, 0.0}, {{0.02, 0.0}, {0.02, 0.01}}))},
      {"cutting_speed",
       Stage::cutting_law,
       "Kc multiplied by (v / reference)^-exponent",
       "Altintas, Manufacturing Automation, 2.4",
       {number("exponent", "1").drawn(0.05, 0.25),
        number("reference_m_per_min", "m/min", POSITIVE).drawn(100.0, 300.0)},
       {Need::cuts},
       always(EffectForm({powerLaw("exponent", "reference_m_per_min", 150.0, 1.0, 5000.0)})
                  .probe({0.0, 0.0}, {{0.02, 0.0}, {0.02, 0.01}}))},
      {"chip_coefficients",
       Stage::cutting_law,
       "adds to the chip coefficients",
       "Dunwoody eq. 2.1: coefficients of another material, or of a regression that runout had bent",
       {orZero("Ktc_n_per_mm2", "N/mm2").drawnOnBothSides(120.0, 300.0),
        orZero("Krc_n_per_mm2", "N/mm2").drawnOnBothSides(50.0, 110.0),
        orZero("Kac_n_per_mm2", "N/mm2").drawnOnBothSides(30.0, 90.0)},
       {Need::cuts},
       addedChipCoefficients},
      {"edge_buildup",
       Stage::cutting_law,
       "edge coefficients multiplied by 1 - exp(-h / chip)",
       "Endres, DeVor & Kapoor 1995: ploughing needs some chip to build up",
       {number("chip_um", "um", NOT_NEGATIVE).drawn(8.0, 40.0)},
       {Need::cuts},
       always(
           EffectForm({amplitude("chip_um", {0.0, 300.0, 0.0025, 20.0})}).straight({1.0, 5.0, 15.0, 40.0}))},
      {"tool_wear",
       Stage::cutting_law,
       "edge coefficients (added ones too) multiplied by 1 + growth x cutting time of the edge",
       "Teitenberg, Bayoumi & Yucesan 1992",
       {number("edge_growth_per_min", "1/min").drawn(0.1, 0.8)},
       {Need::cuts, Need::cut_time},
       always(EffectForm({amplitude("edge_growth_per_min", {-0.2, 20.0, 0.000125, 1.0})}).straight({0.1}))},
  };
}

std::vector<EffectKind> vibration() {
  return {
      {"process_damping",
       Stage::cutting_law,
       "radial force C v_r / v_c per mm of engaged edge, v_r the velocity into the work; tangential 0.3 of "
       "it",
       "Tunc & Budak 2012; Altintas, Eynian & Onozuka 2008",
       {number("coefficient_n_per_mm", "N/mm").drawn(150.0, 800.0)},
       {Need::cuts, Need::flexible_tool},
       always(EffectForm({amplitude("coefficient_n_per_mm", {-1e4, 1e6, 0.125, 2000.0})})
                  .straight({50.0, 300.0, 1500.0}))},
      {"tool_flexibility",
       Stage::structure,
       "modes added to the tool tip's: it vibrates and the chip regenerates",
       "Dunwoody 2.2; Altintas & Budak 1995",
       {modes("x"), modes("y")},
       {Need::cuts},
       flexibility,
       drawTipModes},
      {"mass_loading",
       Stage::sensor,
       "the first sensor mode of each axis falls by 1/sqrt(1 + ratio), damping ratio unchanged",
       "Dunwoody 5.2: workpiece mass on the dynamometer",
       {number("mass_ratio", "1", {-1.0, Range().high, true, false}).drawn(0.08, 0.4)},
       {Need::forces, Need::sensor_modes},
       // In logarithms the mass does just what the modes' stated frequencies do, all at once. A light mode
       // answers in proportion only while it moves by less than its width.
       always(EffectForm({logarithmOfOnePlus("mass_ratio", {std::log(0.4), std::log(4.0), 5e-05, 0.3})})
                  .straight({0.01, 0.05, 0.12, 0.2, 0.3, 0.45, 0.7, -0.05, -0.12, -0.25}))},
      {"speed_dependent_mode",
       Stage::sensor,
       "the first sensor mode of each axis falls linearly with spindle speed",
       "Cao & Altintas 2007: bearing preload falls with speed",
       {number("softening_per_krpm", "1/krpm").drawn(0.004, 0.015)},
       {Need::forces, Need::sensor_modes},
       always(EffectForm({amplitude("softening_per_krpm", {-0.04, 0.04, 5e-06, 0.02})})
                  .straight({0.001, 0.003, 0.006, 0.01, 0.015, 0.025, -0.003, -0.01}))},
      {"extra_mode",
       Stage::sensor,
       "one more mode in the force sensor; its gain is taken from the direct share",
       "Dunwoody eq. 5.5",
       {oneOf("axis", AXES), number("frequency_hz", "Hz", POSITIVE).drawn(300.0, 3500.0),
        number("damping_ratio", "1", {0.0, 1.0, true, true}).drawn(0.01, 0.05),
        number("gain", "1").drawn(0.03, 0.09)},
       {Need::forces},
       extraModes},
  };
}

std::vector<EffectKind> sensorForce() {
  return {
      {"unbalance",
       Stage::sensor_force,
       "m e omega^2 on the sensor: x sin(a), y cos(a), a = spindle angle + angle; the tip does not move",
       "ISO 21940-11",
       {number("mass_eccentricity_g_mm", "g mm", NOT_NEGATIVE).drawn(4.0, 20.0), angle("angle_deg")},
       {Need::forces},
       always(
           EffectForm({planar("mass_eccentricity_g_mm", "angle_deg", 5000.0, 5e-4, 30.0)}).straight({1.0}))},
      {"spindle_order",
       Stage::sensor_force,
       "x_n sin(order x spindle angle + x_deg) and so on, on the sensor while the spindle turns",
       "bearings, drive and draw bar: lines locked to the spindle angle",
       {number("order", "1", POSITIVE).drawn(0.35, 12.0), orZero("x_n", "N").drawn(2.0, 8.0),
        orZero("y_n", "N").drawn(2.0, 8.0), orZero("z_n", "N").drawn(2.0, 8.0), angleOrZero("x_deg"),
        angleOrZero("y_deg"), angleOrZero("z_deg")},
       {Need::forces},
       always(
           EffectForm({amplitude("order", {0.05, 60.0, 2e-4, 20.0}, 1.0),
                       planar("x_n", "x_deg", 2000.0, 5e-4, 20.0), planar("y_n", "y_deg", 2000.0, 5e-4, 20.0),
                       planar("z_n", "z_deg", 2000.0, 5e-4, 20.0)})
               .sought(Seek::spindle_order))},
  };
}

std::vector<EffectKind> drive() {
  return {
      {"stribeck_friction",
       Stage::drive,
       "spindle friction breakaway x exp(-(n / speed)^2) more",
       "Armstrong-Helouvry, Dupont & Canudas de Wit 1994",
       {number("breakaway_nm", "N m").drawn(0.1, 0.6),
        number("speed_rpm", "rpm", POSITIVE).drawn(1200.0, 4500.0)},
       {Need::load_meter},
       always(EffectForm({amplitude("breakaway_nm", {-20.0, 20.0, 0.000125, 0.5}),
                          logarithm("speed_rpm", {std::log(50.0), std::log(30000.0), 2.5e-4, 1.0}, 1.0,
                                    std::log(1200.0))})
                  .scaled(0.05, {400.0, 1200.0, 3500.0}))},
      {"friction_warmup",
       Stage::drive,
       "spindle friction (Stribeck's too) multiplied by 1 + cold x exp(-start_time / constant)",
       "Dunwoody 3.2.1: friction falls while the spindle warms up",
       {number("cold_ratio", "1").drawn(0.2, 0.8),
        number("time_constant_s", "s", POSITIVE).drawn(120.0, 500.0)},
       {Need::load_meter, Need::start_time},
       always(EffectForm({amplitude("cold_ratio", {-0.9, 20.0, 0.000125, 0.5}),
                          logarithm("time_constant_s", {std::log(2.0), std::log(20000.0), 2.5e-4, 1.0}, 1.0,
                                    std::log(250.0))})
                  .scaled(0.05, {80.0, 250.0, 700.0}))},
      {"load_meter_lag",
       Stage::drive,
       "bandwidth of the load meter, in place of the nominal one",
       "Dunwoody 3.2.1: first-order load meter",
       {number("bandwidth_hz", "Hz", POSITIVE).drawn(1.5, 5.0)},
       {Need::load_meter},
       [](const Scope& s) {
         return Forms{EffectForm({logarithm("bandwidth_hz", {std::log(0.01), std::log(20.0), 0.000125, 0.7},
                                            s.nominal.spindle->load_meter_bandwidth)})
                          .straight({-0.1, -0.5, -1.2, 0.4})};
       }},
  };
}

std::vector<EffectKind> sensorOutput() {
  return {
      {"cross_talk",
       Stage::sensor_output,
       "xy: share of the y signal in the x channel, and so on",
       "Kistler, data sheets of multi-component dynamometers",
       {orZero("xy", "1").drawnOnBothSides(0.02, 0.08), orZero("xz", "1").drawnOnBothSides(0.02, 0.08),
        orZero("yx", "1").drawnOnBothSides(0.02, 0.08), orZero("yz", "1").drawnOnBothSides(0.02, 0.08),
        orZero("zx", "1").drawnOnBothSides(0.02, 0.08), orZero("zy", "1").drawnOnBothSides(0.02, 0.08)},
       {Need::forces},
       crossTalk,
       drawCrossTalk},
      {"gain_error",
       Stage::sensor_output,
       "one channel's sensitivity is wrong: it shows gain times the value",
       "calibration of one channel",
       {oneOf("channel", measuredChannels()).drawnFromFirst(4),
        number("gain", "1").drawnOnBothSides(0.06, 0.2, 1.0)},
       {},
       gainErrors,
       drawLargerLoadGain},
      {"channel_delay",
       Stage::delay,
       "one channel is late",
       "filters and converters of one channel",
       {oneOf("channel", measuredChannels()).drawnFromFirst(3),
        number("delay_us", "us", NOT_NEGATIVE).drawn(30.0, 200.0)},
       {},
       channelDelays},
  };
}

std::vector<EffectKind> signal() {
  return {
      {"zero_offset",
       Stage::signal,
       "a constant on each force channel",
       "Kistler, charge amplifiers: zero after the last reset",
       {orZero("x_n", "N").drawnOnBothSides(2.0, 15.0), orZero("y_n", "N").drawnOnBothSides(2.0, 15.0),
        orZero("z_n", "N").drawnOnBothSides(2.0, 15.0)},
       {Need::forces},
       always(EffectForm({amplitude("x_n", {-2000.0, 2000.0, 5e-4, 30.0}),
                          amplitude("y_n", {-2000.0, 2000.0, 5e-4, 30.0}),
                          amplitude("z_n", {-2000.0, 2000.0, 5e-4, 30.0})})
                  .straight({1.0}))},
      {"charge_drift",
       Stage::signal,
       "linear drift from the start of each record: rate on fx, y_ratio of it on fy",
       "Kistler, charge amplifiers: drift of the insulation",
       {number("rate_n_per_min", "N/min").drawnOnBothSides(800.0, 4000.0),
        number("y_ratio", "1").drawnOnBothSides(0.3, 1.5)},
       {Need::forces},
       // The two need both: a rate of zero on x leaves y without its ratio.
       always(EffectForm({sizes("rate_n_per_min", "y_ratio", {-1e5, 1e5, 0.025, 500.0})})
                  .probe({0.0, 0.0}, {{20.0, 0.0}, {20.0, 20.0}}))},
      {"mains_hum",
       Stage::signal,
       "sine on fx, y_ratio of it in phase on fy; the phase of each record is found in the record",
       "coupling of the mains into the charge lines",
       {oneOfNumbers("frequency_hz", "Hz", {50.0, 60.0}), number("amplitude_n", "N").drawn(2.0, 12.0),
        number("y_ratio", "1").drawnOnBothSides(0.3, 1.2)},
       {Need::plane_forces},
       hums},
      {"saturation",
       Stage::signal,
       "fx, fy and fz clipped at plus and minus the limit",
       "range of the charge amplifier",
       {number("limit_n", "N", POSITIVE).drawn(150.0, 350.0)},
       {Need::forces},
       saturations},
  };
}

std::vector<EffectKind> makeCatalogue() {
  std::vector<EffectKind> all;
  for (const auto& part :
       {geometry(), motion(), chipAndEdge(), vibration(), sensorForce(), drive(), sensorOutput(), signal()})
    all.insert(all.end(), part.begin(), part.end());
  return all;
}

}  // namespace

const std::vector<EffectKind>& effectCatalogue() {
  static const std::vector<EffectKind> CATALOGUE = makeCatalogue();
  return CATALOGUE;
}

}  // namespace smartmill
