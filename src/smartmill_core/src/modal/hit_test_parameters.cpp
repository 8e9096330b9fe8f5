#include "smartmill_core/modal/hit_test_parameters.h"

#include "smartmill_core/error.h"

namespace smartmill {

void HitTestParameters::declareHits(ParameterTable& table) {
  table.number("trigger_force", trigger_force, "N", Range::positive(),
               "of the hammer above the level before");
  table.number("weak_force", weak_force, "N", Range::positive(),
               "a hit with a lower peak is not used; at least trigger_force");
  table.number("second_hit_share", second_hit_share, "1", Range::open(0.0, 1.0),
               "of the peak: above it a second peak makes a double hit");
  table.number("pre_trigger", pre_trigger, "s", Range::positive(), "kept before the trigger");
  table.number(
      "record_length", record_length, "s", Range::positive(),
      "of a hit, pre_trigger included, until all has come to rest (longer only adds noise); lines lie "
      "1 / record_length apart; above 2 x pre_trigger");
  table.number("rest_time", rest_time, "s", Range::notNegative(), "between a record's end and the next hit");
  table.number("strike_timeout", strike_timeout, "s", Range::positive(),
               "from the request of a hit to the hit");
  table.number("max_bad_hits", max_bad_hits, "1", Range::notNegative(),
               "more rejected hits in a row end the measurement");
}

void HitTestParameters::declareFit(ParameterTable& table) {
  table.number("frf_high", frf_high, "Hz", Range::positive(), "lines above are not published");
  table.number("fit_low", fit_low, "Hz", Range::notNegative(), "band of the modal fit");
  table.number("fit_high", fit_high, "Hz", Range::positive(), "above fit_low");
  table.number("max_modes", max_modes, "1", Range::closed(1, 20), "when the number is chosen by evidence");
}

void HitTestParameters::validateHitTest() const {
  const auto need = [](bool good, const char* key, double value, const char* expected) {
    if (!good) throw Error(std::string(key) + ": " + shortNumber(value) + ", expected " + expected);
  };
  need(weak_force >= trigger_force, "weak_force", weak_force, "at least trigger_force");
  need(record_length > 2.0 * pre_trigger, "record_length", record_length, "above 2 x pre_trigger");
  need(fit_high > fit_low, "fit_high", fit_high, "above fit_low");
}

}  // namespace smartmill
