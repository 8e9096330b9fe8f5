#include "smartmill_core/model/effect_catalogue.h"

#include <utility>

namespace smartmill {

namespace {

// A number that is neutral (0 unless said) where the effect is absent.
EffectParameter number(const char* key, const char* unit, Range range, EffectPrior prior) {
  EffectParameter p;
  p.key = key;
  p.unit = unit;
  p.range = range;
  p.prior = prior;
  return p;
}

EffectParameter orZero(const char* key, const char* unit, EffectPrior prior) {
  EffectParameter p = number(key, unit, {}, prior);
  p.optional = true;
  return p;
}

EffectParameter angle(const char* key) {
  return number(key, "deg", {}, {0.0, 360.0, 0.0, 0.0, true});
}

EffectParameter angleOrZero(const char* key) {
  EffectParameter p = angle(key);
  p.optional = true;
  return p;
}

EffectParameter oneOf(const char* key, std::vector<std::string> words) {
  EffectParameter p;
  p.key = key;
  p.unit = "1";
  p.value = EffectValue::word;
  p.words = std::move(words);
  return p;
}

EffectParameter modes(const char* key) {
  EffectParameter p;
  p.key = key;
  p.unit = "modes";
  p.value = EffectValue::modes;
  p.optional = true;
  return p;
}

EffectParameter pitches() {
  EffectParameter p = number("pitch_deg", "deg", Range::positive(), {-30.0, 30.0, 0.0, 3.0});
  p.value = EffectValue::pitch;
  return p;
}

EffectParameter mainsFrequency() {
  EffectParameter p = number("frequency_hz", "Hz", {}, {50.0, 60.0});
  p.choices = {50.0, 60.0};
  return p;
}

EffectKind timed(EffectKind kind, bool start_time, bool cut_time) {
  kind.needs_start_time = start_time;
  kind.needs_cut_time = cut_time;
  return kind;
}

std::vector<EffectKind> makeCatalogue() {
  const Range positive = Range::positive(), not_negative = Range::notNegative();
  const std::vector<std::string> axes{"x", "y", "z"};
  const std::vector<std::string> channels{"fx",     "fy",     "fz",           "load_meter",
                                          "tool_x", "tool_y", "displacement", "acceleration"};
  const EffectPrior share{-0.3, 0.3, 0.0, 0.05};
  return {
      {"runout",
       {number("offset_um", "um", not_negative, {0.0, 80.0, 0.0, 15.0}), angle("angle_deg")},
       "Kline & DeVor 1983; Dunwoody 6.1"},
      {"edge_forces",
       {orZero("Kte_n_per_mm", "N/mm", {-60.0, 60.0, 0.0, 10.0}),
        orZero("Kre_n_per_mm", "N/mm", {-60.0, 60.0, 0.0, 10.0}),
        orZero("Kae_n_per_mm", "N/mm", {-30.0, 30.0, 0.0, 3.0})},
       "Dunwoody eq. 2.1; Armarego & Deshpande 1991"},
      {"size_effect",
       {number("exponent", "1", {}, {-0.2, 0.8, 0.0, 0.2}),
        number("reference_chip_um", "um", positive, {5.0, 300.0})},
       "Kienzle 1952"},
      timed({"tool_wear",
             {number("edge_growth_per_min", "1/min", {}, {-0.5, 5.0, 0.0, 0.5})},
             "Teitenberg, Bayoumi & Yucesan 1992"},
            false, true),
      {"cutting_speed",
       {number("exponent", "1", {}, {-0.3, 0.6, 0.0, 0.15}),
        number("reference_m_per_min", "m/min", positive, {20.0, 2000.0})},
       "Altintas, Manufacturing Automation, 2.4"},
      {"uneven_pitch", {pitches()}, "Budak 2003"},
      {"helix", {number("helix_deg", "deg", {0.0, 80.0, false, true}, {0.0, 65.0})}, "Dunwoody eq. 5.64"},
      {"tool_flexibility", {modes("x"), modes("y")}, "Dunwoody 2.2; Altintas & Budak 1995"},
      {"process_damping",
       {number("coefficient_n_per_mm", "N/mm", {}, {0.0, 5000.0, 0.0, 300.0})},
       "Tunc & Budak 2012; Altintas, Eynian & Onozuka 2008"},
      {"extra_mode",
       {oneOf("axis", axes), number("frequency_hz", "Hz", positive, {100.0, 8000.0}),
        number("damping_ratio", "1", {0.0, 1.0, true, true}, {0.002, 0.3}),
        number("gain", "1", {}, {-0.5, 0.5, 0.0, 0.1})},
       "Dunwoody eq. 5.5"},
      {"mass_loading",
       {number("mass_ratio", "1", {-1.0, Range().high, true, false}, {-0.3, 1.0, 0.0, 0.15})},
       "Dunwoody 5.2: workpiece mass on the dynamometer"},
      {"speed_dependent_mode",
       {number("softening_per_krpm", "1/krpm", {}, {-0.02, 0.04, 0.0, 0.005})},
       "Cao & Altintas 2007: bearing preload falls with speed"},
      {"cross_talk",
       {orZero("xy", "1", share), orZero("xz", "1", share), orZero("yx", "1", share),
        orZero("yz", "1", share), orZero("zx", "1", share), orZero("zy", "1", share)},
       "Kistler, data sheets of multi-component dynamometers"},
      {"charge_drift",
       {number("rate_n_per_min", "N/min", {}, {-5000.0, 5000.0, 0.0, 500.0}),
        number("y_ratio", "1", {}, {-3.0, 3.0, 0.0, 1.0})},
       "Kistler, charge amplifiers: drift of the insulation"},
      {"mains_hum",
       {mainsFrequency(), number("amplitude_n", "N", {}, {0.0, 100.0, 0.0, 5.0}),
        number("y_ratio", "1", {}, {-3.0, 3.0, 0.0, 1.0})},
       "coupling of the mains into the charge lines"},
      {"unbalance",
       {number("mass_eccentricity_g_mm", "g mm", not_negative, {0.0, 200.0, 0.0, 15.0}), angle("angle_deg")},
       "ISO 21940-11: force m e omega^2"},
      {"channel_delay",
       {oneOf("channel", channels), number("delay_us", "us", not_negative, {0.0, 2000.0, 0.0, 100.0})},
       "filters and converters of one channel"},
      {"gain_error",
       {oneOf("channel", channels), number("gain", "1", {}, {0.3, 2.0, 1.0, 0.1})},
       "calibration of one channel"},
      {"saturation", {number("limit_n", "N", positive, {5.0, 5000.0})}, "range of the charge amplifier"},
      {"stribeck_friction",
       {number("breakaway_nm", "N m", {}, {-0.5, 3.0, 0.0, 0.3}),
        number("speed_rpm", "rpm", positive, {100.0, 10000.0})},
       "Armstrong-Helouvry, Dupont & Canudas de Wit 1994"},
      timed({"friction_warmup",
             {number("cold_ratio", "1", {}, {-0.5, 3.0, 0.0, 0.3}),
              number("time_constant_s", "s", positive, {20.0, 5000.0})},
             "Dunwoody 3.2.1: friction falls while the spindle warms up"},
            true, false),
      {"load_meter_lag",
       {number("bandwidth_hz", "Hz", positive, {0.3, 50.0})},
       "Dunwoody 3.2.1: first-order load meter"},
      {"depth_tilt",
       {number("slope_um_per_mm", "um/mm", {}, {-300.0, 300.0, 0.0, 20.0})},
       "stock or table not level along the feed"},
      {"feed_error",
       {number("ratio", "1", positive, {0.5, 1.5, 1.0, 0.08})},
       "feed drive or override away from the commanded feed"},
  };
}

std::vector<EffectKind> makeFurther() {
  const EffectPrior force{-300.0, 300.0, 0.0, 20.0};
  return {
      {"chip_coefficients",
       {orZero("Ktc_n_per_mm2", "N/mm2", {-2000.0, 2000.0, 0.0, 150.0}),
        orZero("Krc_n_per_mm2", "N/mm2", {-1500.0, 1500.0, 0.0, 100.0}),
        orZero("Kac_n_per_mm2", "N/mm2", {-1000.0, 1000.0, 0.0, 100.0})},
       "Dunwoody eq. 2.1: coefficients of another material, or of a regression that runout had bent"},
      {"edge_buildup",
       {number("chip_um", "um", Range::notNegative(), {0.0, 150.0, 0.0, 15.0})},
       "Endres, DeVor & Kapoor 1995: ploughing needs some chip to build up"},
      {"spindle_order",
       {number("order", "1", Range::positive(), {0.1, 60.0}), orZero("x_n", "N", force),
        orZero("y_n", "N", force), orZero("z_n", "N", force), angleOrZero("x_deg"), angleOrZero("y_deg"),
        angleOrZero("z_deg")},
       "bearings, drive and draw bar: lines locked to the spindle angle"},
      {"zero_offset",
       {orZero("x_n", "N", force), orZero("y_n", "N", force), orZero("z_n", "N", force)},
       "Kistler, charge amplifiers: zero after the last reset"},
  };
}

}  // namespace

const std::vector<EffectKind>& effectCatalogue() {
  static const std::vector<EffectKind> CATALOGUE = makeCatalogue();
  return CATALOGUE;
}

const std::vector<EffectKind>& furtherEffects() {
  static const std::vector<EffectKind> FURTHER = makeFurther();
  return FURTHER;
}

const EffectKind* findEffect(const std::string& name) {
  for (const std::vector<EffectKind>* list : {&effectCatalogue(), &furtherEffects()}) {
    for (const EffectKind& kind : *list) {
      if (kind.name == name) return &kind;
    }
  }
  return nullptr;
}

const EffectParameter* findParameter(const EffectKind& kind, const std::string& key) {
  for (const EffectParameter& parameter : kind.parameters) {
    if (parameter.key == key) return &parameter;
  }
  return nullptr;
}

}  // namespace smartmill
