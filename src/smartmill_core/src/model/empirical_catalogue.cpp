#include <algorithm>
#include <cmath>

#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/units.h"

// Causes without a name: one entry a form. What is fitted has few numbers, each bounded so that force grows
// with the chip and a factor stays positive.

namespace smartmill {

namespace {

using Forms = std::vector<EffectForm>;
using Need = EffectNeed;
using Scope = EffectScope;
using Stage = EffectStage;
using Values = std::vector<double>;

const std::vector<std::string> CHANNELS{"fx", "fy", "fz", "load_meter"};
const std::vector<std::string> FORCES(FORCE_CHANNELS.begin(), FORCE_CHANNELS.end());
const std::vector<std::string> TIMES{"always", "turning"};   // of the spindle
const std::vector<std::string> CLOCKS{"record", "machine"};  // that began with it, or when it was cold
const std::vector<std::string> SHARES{"chip", "edge"};       // of the force
const FitRange LOGARITHM{-1.6, 1.6, 1e-4, 0.5};              // of a factor

EffectParameter key(const char* name, const char* unit, const Range& range = {},
                    EffectValue value = EffectValue::number) {
  EffectParameter p;
  p.key = name;
  p.unit = unit;
  p.range = range;
  p.value = value;
  return p;
}

EffectParameter orZero(const char* name, const char* unit, const Range& range = {}) {
  EffectParameter p = key(name, unit, range);
  p.optional = true;
  return p;
}

EffectParameter orNothing(const char* name, const char* unit, const Range& range = {}) {
  EffectParameter p = key(name, unit, range, EffectValue::table);
  p.optional = true;
  return p;
}

EffectParameter oneOf(const char* name, const std::vector<std::string>& words) {
  EffectParameter p = key(name, "1", {}, EffectValue::word);
  p.words = words;
  return p;
}

EffectKind empirical(const char* stage_word, const char* form, Stage stage, const char* says,
                     const char* source, std::vector<EffectParameter> parameters, std::vector<Need> needs,
                     std::function<Forms(const Scope&)> forms) {
  EffectKind kind{std::string(EMPIRICAL) + ":" + form,
                  stage,
                  says,
                  source,
                  std::move(parameters),
                  std::move(needs),
                  std::move(forms)};
  kind.form_stage = stage_word;
  kind.form = form;
  return kind;
}

// ---- chip thickness

// The slope of the effective chip in each piece between nodes, over that of nothing changed. The last piece
// goes on behind its node.
void writeCourse(const Values& nodes, const Values& slopes, EffectEntry& e) {
  Values &h = e.lists["h_um"], &factor = e.lists["factor"];
  double effective = 0.0, before = 0.0;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    effective += slopes[k] * (nodes[k] - before);
    before = nodes[k];
    h.push_back(nodes[k]);
    factor.push_back(effective / nodes[k]);
  }
}

Values slopesOf(const EffectEntry& e) {
  const Values &h = e.lists.at("h_um"), &factor = e.lists.at("factor");
  Values slopes;
  for (std::size_t k = 0; k < h.size(); ++k)
    slopes.push_back(k == 0 ? factor[0] : (h[k] * factor[k] - h[k - 1] * factor[k - 1]) / (h[k] - h[k - 1]));
  return slopes;
}

// Straight with one kink: below it nothing is changed.
EffectCoordinates kink(double largest) {
  constexpr double BEYOND = 4.0;  // second node over the first
  const double low = 0.03 * largest, high = 0.9 * largest;
  return {{{"ln h_um of the kink", std::log(0.4 * largest), std::log(low), std::log(high), 1e-3, 0.7},
           {"ln slope behind it", 0.0, LOGARITHM.low, LOGARITHM.high, LOGARITHM.step, LOGARITHM.prior_std}},
          [](const double* v, EffectEntry& e) {
            const double at = std::exp(v[0]);
            writeCourse({at, BEYOND * at}, {1.0, std::exp(v[1])}, e);
          },
          [](const EffectEntry& e, double* v) {
            v[0] = std::log(e.lists.at("h_um").at(0));
            v[1] = std::log(slopesOf(e).at(1));
          }};
}

// Any course that rises: slopes between fixed nodes.
EffectCoordinates course(const Values& nodes) {
  EffectCoordinates c;
  for (const double node : nodes)
    c.coordinates.push_back({"ln slope to " + std::to_string(std::lround(node)) + " um", 0.0, LOGARITHM.low,
                             LOGARITHM.high, LOGARITHM.step, LOGARITHM.prior_std});
  c.write = [nodes](const double* v, EffectEntry& e) {
    Values slopes;
    for (std::size_t k = 0; k < nodes.size(); ++k) slopes.push_back(std::exp(v[k]));
    writeCourse(nodes, slopes, e);
  };
  c.read = [](const EffectEntry& e, double* v) {
    for (const double slope : slopesOf(e)) *v++ = std::log(slope);
  };
  return c;
}

Forms chipForms(const Scope& scope) {
  const double largest = scope.largest_chip / units::UM;
  EffectForm one({kink(largest)});
  for (const double share : {0.2, 0.35, 0.5, 0.7}) {
    const double at = std::log(share * largest);
    one.probe({at, 0.0}, {{at, -0.05}});
  }
  Values nodes;
  for (const double share : {0.12, 0.25, 0.4, 0.6, 1.0}) nodes.push_back(share * largest);
  return {one.named("kink"), EffectForm({course(nodes)}).straight({0.02}).named("course")};
}

// ---- time and height

Forms timeForms(const Scope&) {
  return {EffectForm(
              {amplitude("amplitude", {-0.9, 3.0, 1e-4, 0.3}),
               logarithm("time_constant_s", {std::log(2e-3), std::log(5.0), 1e-3, 1.0}, 1.0, std::log(0.05))})
              .scaled(0.05, {0.01, 0.03, 0.07, 0.2})};
}

Forms profileForms(const Scope& scope) {
  const double depth = scope.largest_depth / units::MM;
  Forms forms;
  for (const char* from : {"tip", "surface"}) {
    EffectForm form({amplitude("factor", {0.0, 5.0, 1e-4, 0.5}, 1.0),
                     logarithm("height_mm", {std::log(0.02 * depth), std::log(0.95 * depth), 1e-3, 0.7}, 1.0,
                               std::log(0.2 * depth))});
    form.scaled(0.05, {0.1 * depth, 0.2 * depth, 0.35 * depth});
    forms.push_back(form.word("from", from).named(from));
  }
  return forms;
}

Forms lostEdges(const Scope& scope) {
  const double depth = scope.largest_depth / units::MM;
  Forms forms;
  for (int tooth = 1; tooth <= scope.nominal.tool->teeth; ++tooth) {
    EffectForm form({amplitude("height_mm", {0.0, 0.95 * depth, 1e-3, 0.3 * depth})});
    form.straight({0.05 * depth, 0.15 * depth, 0.3 * depth});
    forms.push_back(form.number("tooth", tooth).named("tooth " + std::to_string(tooth)));
  }
  return forms;
}

// ---- teeth and the life of the edge

// Factors as logarithms from this tooth on; those of the others are 1.
EffectCoordinates factors(std::size_t teeth, std::size_t first, std::size_t count) {
  EffectCoordinates c;
  for (std::size_t k = 0; k < count; ++k)
    c.coordinates.push_back({"ln factor of tooth " + std::to_string(first + k + 1), 0.0, -5.0, LOGARITHM.high,
                             LOGARITHM.step, LOGARITHM.prior_std});
  c.write = [=](const double* v, EffectEntry& e) {
    Values& list = e.lists["factor"];
    list.assign(teeth, 1.0);
    for (std::size_t k = 0; k < count; ++k) list[first + k] = std::exp(v[k]);
  };
  c.read = [=](const EffectEntry& e, double* v) {
    for (std::size_t k = 0; k < count; ++k) v[k] = std::log(e.lists.at("factor").at(first + k));
  };
  return c;
}

// One tooth that is not as the others; then any table, against the first tooth.
Forms toothTables(const Scope& scope) {
  const auto teeth = static_cast<std::size_t>(scope.nominal.tool->teeth);
  Forms forms;
  for (const std::string& of : SHARES) {
    const auto add = [&](std::size_t first, std::size_t count, const std::string& name) {
      EffectForm form({factors(teeth, first, count)});
      forms.push_back(form.straight({0.02}).word("of", of).named(of + ", " + name));
    };
    for (std::size_t k = 0; k < teeth; ++k) add(k, 1, "tooth " + std::to_string(k + 1));
    if (teeth > 2) add(1, teeth - 1, "all teeth");
  }
  return forms;
}

// A size and a time constant that a campaign sees from this time on.
EffectForm comingOn(const FitRange& size, double reach, double time) {
  EffectForm form({saturating("amplitude", "time_constant_s", time, size)});
  for (const double constants : {0.2, 0.6, 2.0, 10.0}) {
    const double share = std::exp(-1.0 / constants);
    form.probe({0.0, share}, {{reach, share}});
  }
  return form;
}

Forms edgeLives(const Scope&) {
  constexpr double SEEN = 60.0;  // [s] of cutting
  Forms forms;
  for (const std::string& of : SHARES)
    forms.push_back(comingOn({-0.9, 3.0, 1e-4, 0.3}, 0.02, SEEN).word("of", of).named(of));
  return forms;
}

// ---- channels

Forms onChannels(const Scope& scope, const std::function<EffectForm(const std::string&)>& form) {
  Forms forms;
  for (const std::string& channel : CHANNELS) {
    if (scope.channels.count(channel)) forms.push_back(form(channel).word("channel", channel).named(channel));
  }
  return forms;
}

// Steps and usual sizes of a force [N], of the load meter [V].
double unitOf(const std::string& channel) {
  return channel == "load_meter" ? 1e-3 : 1.0;
}

Forms curves(const Scope& scope) {
  Forms forms;
  for (EffectForm& form : onChannels(scope, [](const std::string&) {
         return EffectForm({amplitude("odd_per_kn", {-3.0, 3.0, 1e-4, 0.3}),
                            amplitude("even_per_kn", {-3.0, 3.0, 1e-4, 0.3}),
                            amplitude("cubic_per_kn2", {-20.0, 20.0, 1e-4, 0.5})})
             .straight({0.01});
       })) {
    if (form.variant != "load_meter") forms.push_back(std::move(form));
  }
  return forms;
}

// Where the line lies only the residual tells.
Forms tones(const Scope& scope) {
  Forms forms;
  for (const std::string& when : TIMES) {
    for (EffectForm& form : onChannels(scope, [](const std::string& channel) {
           const double unit = unitOf(channel);
           return EffectForm({amplitude("frequency_hz", {1.0, 6000.0, 2e-3, 1000.0}, 100.0),
                              amplitude("amplitude", {0.0, 1e3 * unit, 5e-4 * unit, 10.0 * unit})});
         })) {
      if (when != TIMES.front()) form.named(form.variant + ", " + when);
      forms.push_back(form.word("while", when).foundInEachRecord(1));
    }
  }
  return forms;
}

Forms orders(const Scope& scope) {
  return onChannels(scope, [](const std::string& channel) {
    const double unit = unitOf(channel);
    return EffectForm({amplitude("amplitude", {0.0, 1e3 * unit, 5e-4 * unit, 10.0 * unit})})
        .foundInEachRecord(1);
  });
}

Forms settlings(const Scope& scope) {
  return onChannels(scope, [](const std::string& channel) {
    const double unit = unitOf(channel);
    return EffectForm({amplitude("amplitude", {-1e3 * unit, 1e3 * unit, 1e-3 * unit, 10.0 * unit}),
                       logarithm("time_constant_s", {std::log(2e-3), std::log(2.0), 1e-3, 0.7}, 1.0,
                                 std::log(0.05))})
        .scaled(unit, {0.01, 0.03, 0.06, 0.15});
  });
}

// Each clock that the campaign tells.
Forms onClocks(const Scope& scope, const std::function<EffectForm(const std::string&)>& form) {
  Forms forms;
  for (const std::string& clock : CLOCKS) {
    if (clock != CLOCKS.front() && !scope.start_times) continue;
    for (EffectForm& one : onChannels(scope, form))
      forms.push_back(one.word("clock", clock).named(one.variant + ", " + clock));
  }
  return forms;
}

// Where the step lies only the residual tells.
Forms steps(const Scope& scope) {
  return onClocks(scope, [](const std::string& channel) {
    const double unit = unitOf(channel);
    return EffectForm({amplitude("amplitude", {-1e3 * unit, 1e3 * unit, 1e-3 * unit, 10.0 * unit})})
        .number("at_s", 0.0);
  });
}

Forms ramps(const Scope& scope) {
  return onClocks(scope, [](const std::string& channel) {
    const double unit = unitOf(channel);
    return EffectForm({amplitude("per_min", {-1e5 * unit, 1e5 * unit, 1e-2 * unit, 1e4 * unit})})
        .straight({unit});
  });
}

Forms approaches(const Scope& scope) {
  return onChannels(scope, [&](const std::string& channel) {
    const double unit = unitOf(channel);
    return comingOn({-1e3 * unit, 1e3 * unit, 1e-3 * unit, 10.0 * unit}, unit, scope.first_cut);
  });
}

// Where bursts come and how fast they ring only the residual tells.
Forms burstTrains(const Scope& scope) {
  return onChannels(scope, [](const std::string& channel) {
    const double unit = unitOf(channel);
    return EffectForm(
               {logarithm("period_s", {std::log(2e-3), std::log(1.0), 1e-6, 1.0}, 1.0, std::log(0.03)),
                logarithm("frequency_hz", {std::log(20.0), std::log(1e4), 1e-5, 1.0}, 1.0, std::log(1e3)),
                logarithm("decay_s", {std::log(1e-4), std::log(0.1), 1e-3, 1.0}, 1.0, std::log(2e-3)),
                amplitude("amplitude", {0.0, 1e3 * unit, 1e-3 * unit, 10.0 * unit})})
        .foundInEachRecord(1);
  });
}

// A gain below and one above a corner, of which the other is 1.
Forms transfers(const Scope& scope) {
  Forms forms;
  for (const bool above : {true, false}) {
    for (EffectForm& form : onChannels(scope, [&](const std::string&) {
           const Values corners = above ? Values{50.0, 200.0, 800.0, 2500.0} : Values{0.3, 2.0, 10.0, 50.0};
           return EffectForm({amplitude(above ? "above" : "below", {-0.5, 3.0, 1e-4, 0.3}, 1.0),
                              logarithm("corner_hz", {std::log(0.05), std::log(1e4), 1e-3, 1.0}, 1.0,
                                        std::log(corners[1]))})
               .scaled(0.02, corners)
               .number(above ? "below" : "above", 1.0);
         })) {
      if (form.variant != "load_meter")
        forms.push_back(form.named(form.variant + (above ? ", above" : ", below")));
    }
  }
  return forms;
}

// A mode between two force channels, or within one. Where it lies only the residual tells.
Forms resonances(const Scope& scope) {
  Forms forms;
  for (const std::string& to : FORCES) {
    for (const std::string& from : FORCES) {
      if (!scope.channels.count(to) || !scope.channels.count(from)) continue;
      EffectForm form(
          {logarithm("frequency_hz", {std::log(20.0), std::log(1e4), 1e-5, 1.0}, 1.0, std::log(800.0)),
           logarithm("damping_ratio", {std::log(1e-3), std::log(0.5), 1e-3, 1.0}, 1.0, std::log(0.04)),
           amplitude("gain", {-3.0, 3.0, 1e-5, 0.5})});
      form.word("channel", to).word("from", from);
      forms.push_back(form.named(to + " from " + from));
    }
  }
  return forms;
}

// What comes again with the revolution beside everything else: only the residual tells its shape, a fit how
// much of it the tests ask for.
Forms revolutions(const Scope& scope) {
  EffectForm form({amplitude("share", {0.0, 1.0, 1e-4, 1.0})});
  form.number("speed_rpm", 6000.0)
      .number("depth_mm", scope.largest_depth / units::MM)
      .number("chip_um", scope.largest_chip / units::UM)
      .list("order", {1.0});
  for (const std::string& channel : FORCES) form.list(channel + "_n", {0.0, 0.0, 0.0, 0.0});
  return {form};
}

// Of teeth, chips and the law.
std::vector<EffectKind> cuttingForms() {
  const Range positive = Range::positive(), not_negative = Range::notNegative();
  return {
      empirical("geometry", "tooth_path", Stage::geometry,
                "an earlier surface on a ray is what that tooth left when it stood beside the ray, with the "
                "displacement that it then had; share of the way there from the rule of the surface",
                "the surface of trochoidal paths", {key("share", "1")}, {Need::cuts},
                [](const EffectScope&) { return std::vector<EffectForm>{}; }),
      empirical("geometry", "lost_edge", Stage::geometry,
                "below this height one tooth does not cut, and the next one takes its chip",
                "chip rule of formats.md with that edge far inside",
                {key("tooth", "1", Range::closed(1.0, 20.0)), key("height_mm", "mm", not_negative)},
                {Need::cuts, Need::several_teeth}, lostEdges),
      empirical(
          "chip", "chip_thickness", Stage::cutting_law,
          "chip coefficients times a factor of chip thickness: chip times factor is straight between the "
          "nodes, and rises",
          "any course of the specific force",
          {key("h_um", "um", positive, EffectValue::series),
           key("factor", "1", positive, EffectValue::series)},
          {Need::cuts}, chipForms),
      empirical("law", "cutting_time", Stage::cutting_law,
                "chip coefficients times 1 + amplitude exp(-t / constant), t since this cut began",
                "exponential approach",
                {key("amplitude", "1", Range::above(-1.0)), key("time_constant_s", "s", positive)},
                {Need::cuts}, timeForms),
      empirical(
          "law", "depth_profile", Stage::cutting_law,
          "chip coefficients times factor over this height from the tip up, or below the work's surface",
          "a step over the height",
          {oneOf("from", {"tip", "surface"}), key("height_mm", "mm", not_negative),
           key("factor", "1", not_negative)},
          {Need::cuts}, profileForms),
      empirical("law", "tooth_factor", Stage::cutting_law,
                "chip or edge coefficients of each tooth times its factor", "a table over the teeth",
                {oneOf("of", SHARES), key("factor", "1", not_negative, EffectValue::list)},
                {Need::cuts, Need::several_teeth}, toothTables),
      empirical("law", "edge_life", Stage::cutting_law,
                "chip or edge coefficients times 1 + amplitude (1 - exp(-t / constant)), t the time that the "
                "edge has cut",
                "exponential approach",
                {oneOf("of", SHARES), key("amplitude", "1", Range::above(-1.0)),
                 key("time_constant_s", "s", positive)},
                {Need::cuts, Need::cut_time}, edgeLives),
  };
}

// Of what channels make of a signal, and lines in them.
std::vector<EffectKind> channelForms() {
  const Range positive = Range::positive(), not_negative = Range::notNegative();
  return {
      empirical(
          "channel", "resonance", Stage::sensor_output,
          "gain times what a mode makes of another force channel is added to a channel; from itself, of "
          "what the mode changes",
          "one mode of a transfer matrix",
          {oneOf("channel", FORCES), oneOf("from", FORCES), key("frequency_hz", "Hz", positive),
           key("damping_ratio", "1", Range::open(0.0, 1.0)), key("gain", "1")},
          {Need::forces}, resonances),
      empirical("channel", "transfer", Stage::sensor_output,
                "a channel shows above x + (below - above) L(x), L a low pass of first order at the corner",
                "first-order shelf; below 0: high pass, above 0: low pass",
                {oneOf("channel", CHANNELS), key("corner_hz", "Hz", positive), key("below", "1"),
                 key("above", "1")},
                {Need::forces}, transfers),
      empirical(
          "channel", "revolution", Stage::sensor_output,
          "share times a sum over orders of the spindle is added to each force channel while the tool "
          "cuts at this speed and depth: of each order the cosine and the sine of what is always "
          "there, then of what grows with feed per tooth / chip_um; besides of each order cosine and sine "
          "at each feed per tooth bend_um, straight between them, nothing beyond",
          "Fourier series over a revolution, straight over the feed or bent",
          {key("share", "1", not_negative), key("speed_rpm", "rpm", positive),
           key("depth_mm", "mm", positive), key("chip_um", "um", positive),
           key("order", "1", not_negative, EffectValue::table), key("fx_n", "N", {}, EffectValue::table),
           key("fy_n", "N", {}, EffectValue::table), key("fz_n", "N", {}, EffectValue::table),
           orNothing("bend_um", "um", positive), orNothing("fx_bend_n", "N"), orNothing("fy_bend_n", "N"),
           orNothing("fz_bend_n", "N")},
          {Need::cuts, Need::forces}, revolutions),
      empirical("channel", "curve", Stage::signal,
                "a channel that should show f shows f + odd f|f| + even f^2 + cubic f^3, f in kN",
                "static characteristic to third order",
                {oneOf("channel", CHANNELS), orZero("odd_per_kn", "1/kN"), orZero("even_per_kn", "1/kN"),
                 orZero("cubic_per_kn2", "1/kN2")},
                {Need::forces}, curves),
      empirical("channel", "tone", Stage::signal,
                "a sine at a fixed frequency on one channel, always or while the spindle turns; its phase is "
                "found in each record",
                "line that is not locked to the spindle",
                {oneOf("channel", CHANNELS), oneOf("while", TIMES), key("frequency_hz", "Hz", positive),
                 key("amplitude", "N or V", not_negative)},
                {}, tones),
      empirical(
          "channel", "order", Stage::signal,
          "a sine at a multiple of the spindle's turning on one channel; its phase is found in each record",
          "line at a spindle order that keeps no phase",
          {oneOf("channel", CHANNELS), key("order", "1", positive), key("amplitude", "N or V", not_negative)},
          {}, orders),
  };
}

// Of courses over time in them.
std::vector<EffectKind> courseForms() {
  const Range positive = Range::positive(), not_negative = Range::notNegative();
  return {
      empirical(
          "channel", "settling", Stage::signal,
          "a channel begins each record off by amplitude and comes back with exp(-t / constant)",
          "exponential approach",
          {oneOf("channel", CHANNELS), key("amplitude", "N or V"), key("time_constant_s", "s", positive)}, {},
          settlings),
      empirical("channel", "step", Stage::signal,
                "a channel is off by amplitude from this time on, since the record began or since the "
                "machine was cold",
                "a step",
                {oneOf("channel", CHANNELS), oneOf("clock", CLOCKS), key("at_s", "s", not_negative),
                 key("amplitude", "N or V")},
                {}, steps),
      empirical("channel", "ramp", Stage::signal,
                "a channel is off by per_min times the time since the record began, or since the machine "
                "was cold",
                "a straight line",
                {oneOf("channel", CHANNELS), oneOf("clock", CLOCKS), key("per_min", "N/min or V/min")}, {},
                ramps),
      empirical(
          "channel", "approach", Stage::signal,
          "a channel comes to be off by amplitude with 1 - exp(-t / constant), t since the machine was "
          "cold",
          "exponential approach",
          {oneOf("channel", CHANNELS), key("amplitude", "N or V"), key("time_constant_s", "s", positive)},
          {Need::start_time}, approaches),
      empirical(
          "channel", "bursts", Stage::signal,
          "every period a channel rings with amplitude exp(-t / decay) sin(2 pi frequency t); when, is "
          "found in each record",
          "decaying oscillation that comes again",
          {oneOf("channel", CHANNELS), key("period_s", "s", positive), key("frequency_hz", "Hz", positive),
           key("decay_s", "s", positive), key("amplitude", "N or V", not_negative)},
          {}, burstTrains),
  };
}

std::vector<EffectKind> makeCatalogue() {
  std::vector<EffectKind> all;
  for (const auto& group : {cuttingForms(), channelForms(), courseForms()})
    all.insert(all.end(), group.begin(), group.end());
  return all;
}

}  // namespace

const std::vector<EffectKind>& empiricalCatalogue() {
  static const std::vector<EffectKind> CATALOGUE = makeCatalogue();
  return CATALOGUE;
}

}  // namespace smartmill
