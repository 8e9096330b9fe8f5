#include "smartmill_core/model/effect_catalogue.h"

namespace smartmill {

namespace {

EffectParameter number(const char* key, const char* unit, Range range = {}) {
  return {key, unit, EffectValue::number, range};
}

EffectParameter orZero(const char* key, const char* unit) {
  return {key, unit, EffectValue::number, {}, true};
}

EffectParameter oneOf(const char* key, std::vector<std::string> words) {
  return {key, "1", EffectValue::word, {}, false, std::move(words)};
}

std::vector<EffectKind> makeCatalogue() {
  const Range positive = Range::positive(), not_negative = Range::notNegative();
  const std::vector<std::string> axes{"x", "y", "z"};
  const std::vector<std::string> channels{"fx",     "fy",     "fz",           "load_meter",
                                          "tool_x", "tool_y", "displacement", "acceleration"};
  return {
      {"runout", {number("offset_um", "um", not_negative), number("angle_deg", "deg")}},
      {"edge_forces",
       {orZero("Kte_n_per_mm", "N/mm"), orZero("Kre_n_per_mm", "N/mm"), orZero("Kae_n_per_mm", "N/mm")}},
      {"size_effect", {number("exponent", "1"), number("reference_chip_um", "um", positive)}},
      {"tool_wear", {number("edge_growth_per_min", "1/min")}},
      {"cutting_speed", {number("exponent", "1"), number("reference_m_per_min", "m/min", positive)}},
      {"uneven_pitch", {{"pitch_deg", "deg", EffectValue::pitch, positive}}},
      {"helix", {number("helix_deg", "deg", {0.0, 80.0, false, true})}},
      {"tool_flexibility",
       {{"x", "modes", EffectValue::modes, {}, true}, {"y", "modes", EffectValue::modes, {}, true}}},
      {"process_damping", {number("coefficient_n_per_mm", "N/mm")}},
      {"extra_mode",
       {oneOf("axis", axes), number("frequency_hz", "Hz", positive),
        number("damping_ratio", "1", {0.0, 1.0, true, true}), number("gain", "1")}},
      {"mass_loading", {number("mass_ratio", "1", {-1.0, Range().high, true, false})}},
      {"speed_dependent_mode", {number("softening_per_krpm", "1/krpm")}},
      {"cross_talk",
       {orZero("xy", "1"), orZero("xz", "1"), orZero("yx", "1"), orZero("yz", "1"), orZero("zx", "1"),
        orZero("zy", "1")}},
      {"charge_drift", {number("rate_n_per_min", "N/min"), number("y_ratio", "1")}},
      {"mains_hum",
       {{"frequency_hz", "Hz", EffectValue::number, {}, false, {}, {50.0, 60.0}},
        number("amplitude_n", "N"),
        number("y_ratio", "1")}},
      {"unbalance", {number("mass_eccentricity_g_mm", "g mm", not_negative), number("angle_deg", "deg")}},
      {"channel_delay", {oneOf("channel", channels), number("delay_us", "us")}},
      {"gain_error", {oneOf("channel", channels), number("gain", "1")}},
      {"saturation", {number("limit_n", "N", positive)}},
      {"stribeck_friction", {number("breakaway_nm", "N m"), number("speed_rpm", "rpm", positive)}},
      {"friction_warmup", {number("cold_ratio", "1"), number("time_constant_s", "s", positive)}},
      {"load_meter_lag", {number("bandwidth_hz", "Hz", positive)}},
      {"depth_tilt", {number("slope_um_per_mm", "um/mm")}},
      {"feed_error", {number("ratio", "1", positive)}},
  };
}

}  // namespace

const std::vector<EffectKind>& effectCatalogue() {
  static const std::vector<EffectKind> CATALOGUE = makeCatalogue();
  return CATALOGUE;
}

const EffectKind* findEffect(const std::string& name) {
  for (const EffectKind& kind : effectCatalogue()) {
    if (kind.name == name) return &kind;
  }
  return nullptr;
}

}  // namespace smartmill
