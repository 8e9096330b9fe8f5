#include "smartmill_discrepancy/report/report_html.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <ostream>
#include <set>
#include <utility>
#include <vector>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/report_page.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/hypotheses/hypothesis.h"
#include "smartmill_discrepancy/report/shop_quantity.h"
#include "smartmill_discrepancy/report/shop_text.h"

namespace smartmill::discrepancy {
namespace {

/// [1] of the remaining difference: smaller components are not listed.
constexpr double LEAST_SHARE = 0.01;
/// [1] Difference, times the noise, up to which only noise remains.
constexpr double ONLY_NOISE = 1.01;

std::string times(double difference) {
  return formatted(difference < 10.0 ? "%.2f" : difference < 100.0 ? "%.1f" : "%.0f", difference);
}

std::string counted(std::size_t count, const char* one, const char* several) {
  return std::to_string(count) + " " + (count == 1 ? one : several);
}

std::string percentText(double share) {
  const double percent = 100.0 * share;
  return percent > 99.9 && percent < 100.0 + 1e-9 ? "> 99.9 %" : formatted("%.3g %%", percent);
}

std::string unitHtml(const std::string& unit) {
  if (unit == "1") return "";
  if (unit == "deg") return "&deg;";
  std::string text = " " + escapedHtml(unit);
  for (std::size_t at = 0; (at = text.find("um", at)) != std::string::npos; at += 7)
    text.replace(at, 2, "&micro;m");
  return text;
}

std::string sizeText(const ShopQuantity& q) {
  return q.name + " <b>" + intervalText(q.value, q.std_dev) + unitHtml(q.unit) + "</b>" +
         (q.modulo > 0.0
              ? formatted(" (plus multiples of %.4g&deg;: no record has a spindle angle)", q.modulo)
              : "");
}

std::string namedCause(const std::string& effect) {
  const EffectKind& kind = *findEffect(effect);
  return "<b>" + escapedHtml(causeTitle(effect)) + "</b>" +
         (kind.empirical() ? "" : " <span class=\"dim\">(" + effect + ")</span>");
}

bool isRival(const Explanation& e, const std::string& effect, const std::string& other) {
  return effect != other && standsFor(e, effect, other);
}

bool hasRivals(const Explanation& e, const std::string& effect) {
  return std::any_of(e.not_separable.begin(), e.not_separable.end(), [&](const auto& group) {
    return std::find(group.begin(), group.end(), effect) != group.end();
  });
}

std::size_t heldoutTests(const Explanation& e) {
  return static_cast<std::size_t>(
      std::count_if(e.tests.begin(), e.tests.end(), [](const ReportedTest& t) { return t.heldout; }));
}

void list(std::ostream& out, const char* title, const std::vector<std::string>& items) {
  if (!items.empty())
    out << "<h2>" << title << "</h2>\n<ul><li>" << joined(items, "</li><li>") << "</li></ul>\n";
}

void head(std::ostream& out, const Explanation& e) {
  std::vector<std::string> facts;
  if (e.nominal.tool) {
    const ToolGeometry& tool = *e.nominal.tool;
    facts.push_back(formatted("Tool: %d %s, diameter %.4g mm, helix angle %.3g&deg;", tool.teeth,
                              tool.teeth == 1 ? "tooth" : "teeth", tool.diameter / units::MM,
                              units::degFromRad(tool.helix)));
  }
  const bool states_material = e.nominal.workpiece && !e.nominal.workpiece->material.empty();
  facts.push_back("Material: " + (states_material ? escapedHtml(e.nominal.workpiece->material)
                                                  : std::string("not stated in the model")));
  facts.push_back(formatted("%zu tests, %zu of them held out", e.tests.size(), heldoutTests(e)));
  out << "<p class=\"dim\">" << joined(facts, " &middot; ") << "</p>\n<p class=\"verdict\">" << verdictText(e)
      << "</p>\n";
  if (e.verdict == Verdict::recalibrated) out << "<p>" << escapedHtml(e.sentence) << "</p>\n";
}

// ---- causes

std::string sureText(const Explanation& e, const FoundEffect& f) {
  const bool rivals = hasRivals(e, f.name);
  std::string text = (rivals ? "one of them is present: " : "") + std::string("probability <b>") +
                     percentText(rivals ? f.presence : f.confidence) + "</b>";
  if (f.heldout_without > 0.0)
    text += ". Held-out tests: difference " + times(f.heldout_without) + " times the noise without it, " +
            times(e.after.heldout) + " with it";
  return text + ".";
}

// Of the causes that were compared in the round of an effect the one that explains most in its place.
std::string nearestText(const Explanation& e, const FoundEffect& f) {
  const CandidateResult *own = nullptr, *nearest = nullptr;
  for (const CandidateResult& t : e.candidates) {
    if (t.effect == f.name && t.accepted) own = &t;
  }
  for (const CandidateResult& t : e.candidates) {
    if (own && t.round == own->round && t.effect != f.name && !t.accepted && t.delta_bic > 0.0 &&
        (!nearest || t.delta_bic > nearest->delta_bic))
      nearest = &t;
  }
  if (!nearest) return "None of the other causes that were checked explains it. ";
  return "Nearest of the others that were checked: " + namedCause(nearest->effect) +
         formatted(", which explains %.2g %% of what this cause explains. ",
                   100.0 * nearest->delta_bic / own->delta_bic);
}

std::string rivalsText(const Explanation& e, const FoundEffect& f, const ShopConditions& conditions) {
  std::string text;
  for (const Rival& r : f.alternatives) {
    const bool equal = isRival(e, f.name, r.name);
    text += namedCause(r.name) + ", ";
    const std::vector<ShopQuantity> sizes = shopQuantities(r.name, r.parameters, conditions);
    if (!sizes.empty()) text += sizeText(sizes.front());
    text += equal ? ": <b>these tests fit both</b>" : ": fits less well";
    if (r.heldout_gap > 0.0)
      text += " (held-out tests: difference " + times(r.heldout_gap) + " times the noise)";
    text += ".<br>";
  }
  if (f.alternatives.empty()) text = nearestText(e, f);
  return text + (e.not_tried.empty()
                     ? ""
                     : counted(e.not_tried.size(), "cause was", "causes were") + " not checked (appendix).");
}

// The unit on the channel of an effect, of one that acts on forces or on the load meter: "N or V".
std::string unitOn(const FoundEffect& f, const std::string& unit) {
  const std::size_t between = unit.find(" or ");
  if (between == std::string::npos) return unit;
  const auto channel = f.words.find("channel");
  const bool is_force = channel == f.words.end() || channel->second != "load_meter";
  return is_force ? unit.substr(0, between) : unit.substr(between + 4);
}

void notNamed(std::ostream& out, const Explanation& e) {
  for (const Resemblance& r : e.resembles)
    out << "<p>Considered, but not accepted: " << namedCause(r.name)
        << (r.variant.empty() ? "" : " (" + escapedHtml(r.variant) + ")") << ", " << escapedHtml(r.reason)
        << ".</p>\n";
}

void causes(std::ostream& out, const Explanation& e) {
  if (e.effects.empty()) return;
  const ShopConditions conditions = conditionsOf(e.tests);
  out << "<h2>Causes: what the machine has and the supplied model lacks</h2>\n<table "
         "class=\"stack\"><tr><th>cause<th>how "
         "large<th>how sure<th>what else it can be</tr>\n";
  for (const FoundEffect& f : e.effects) {
    out << "<tr><td>" << namedCause(f.name);
    for (const auto& [key, word] : f.words) out << "<br>" << key << ": " << escapedHtml(word);
    out << "<td>";
    for (ShopQuantity& q : shopQuantities(f.name, f.parameters, conditions)) {
      q.unit = unitOn(f, q.unit);
      out << sizeText(q) << "<br>";
    }
    out << "<td>" << sureText(e, f) << "<td>" << rivalsText(e, f, conditions) << "</tr>\n";
  }
  out << "</table>\n<p class=\"dim\">&plusmn; is the 95 % interval of the fit; errors of calibration and "
         "clamping are not in it. Spindle angle 0: tooth 1 points to +y; the spindle turns clockwise, seen "
         "from above. Probability: that the cause also reduces the difference in further tests.</p>\n";
}

void values(std::ostream& out, const char* title, const std::vector<RecalibratedValue>& list) {
  if (list.empty()) return;
  out << "<h2>" << title
      << "</h2>\n<table><tr><th>value (key in model.yaml)<th>supplied model<th>corrected "
         "model<th>change<th>change over "
         "the stated uncertainty</tr>\n";
  for (const RecalibratedValue& v : list)
    out << "<tr><td>" << v.name << "<td>" << formatted("%.5g", v.before) << "<td>"
        << intervalText(v.after, v.std_dev) << "<td>"
        << formatted("%+.2f %%", 100.0 * (v.after / v.before - 1.0)) << "<td>"
        << formatted("%+.1f", v.deviations) << "</tr>\n";
  out << "</table>\n";
}

// ---- actions

std::string kindText(const CampaignTest& test) {
  if (test.kind == TestKind::tap) return "tap " + test.direction;
  if (!test.engagement) return test.kind == TestKind::air ? "air cut" : testKindName(test.kind);
  constexpr double NEAR = 1e-6;
  const bool from_zero = test.engagement->entry<NEAR, to_half_turn = test.engagement->exit> units::PI - NEAR;
  return from_zero && to_half_turn ? "slot"
         : from_zero               ? "up-milling"
         : to_half_turn            ? "down-milling"
                                   : "cut";
}

std::string cutText(const CampaignTest& test) {
  const std::string text =
      kindText(test) + formatted(", %.0f rpm", units::rpmFromRadPerSec(test.spindle_speed));
  if (!test.engagement) return text;
  const Engagement& c = *test.engagement;
  return text + formatted(", feed %.3g mm per tooth, depth %.3g mm, immersion %.0f&deg; to %.0f&deg;",
                          c.feed_per_tooth / units::MM, c.axial_depth / units::MM, units::degFromRad(c.entry),
                          units::degFromRad(c.exit));
}

std::string outcomeText(const TestOutcome& o) {
  constexpr double DISTINCT = 0.02;  // of the peak, to be read off a display
  const std::string first = o.first.empty() ? "wrong values of the model" : causeTitle(o.first);
  const ChannelWords words = channelWords(o.channel);
  std::string text;
  if (std::abs(o.peak - o.other_peak) > DISTINCT * std::max(o.peak, o.other_peak))
    text = "Peak of " + words.title + " near <b>" + words.text(o.peak) + "</b>: " + first + "; near <b>" +
           words.text(o.other_peak) + "</b>: " + causeTitle(o.second) + ". ";
  else
    text =
        "Both causes give nearly the same peak; only the shape of the signals differs, so that the next "
        "search "
        "decides. ";
  return text + (o.chatters ? "<b>The model predicts chatter in this cut: approach it with less depth.</b> "
                            : "The model predicts no chatter. ");
}

// What decides without a cut: the sizes that a shop measures, of a cause and its rival.
std::string measuredInstead(const Explanation& e) {
  const ShopConditions conditions = conditionsOf(e.tests);
  std::vector<std::string> parts;
  for (const FoundEffect& f : e.effects) {
    for (const Rival& r : f.alternatives) {
      if (!isRival(e, f.name, r.name)) continue;
      for (const auto& [name, parameters] :
           {std::pair(f.name, f.parameters), std::pair(r.name, r.parameters)}) {
        const std::vector<ShopQuantity> sizes = shopQuantities(name, parameters, conditions);
        if (!sizes.empty()) parts.push_back(causeTitle(name) + ": " + sizeText(sizes.front()));
      }
    }
  }
  return parts.empty() ? ""
                       : "<p>Or measure at the machine. If it is " + joined(parts, "; if it is ") + ".</p>\n";
}

std::string command(const std::string& line) {
  return "<pre>" + escapedHtml(line) + "</pre>";
}

std::string searchCommand(const std::string& campaign, const std::string& folder, bool is_whole) {
  return command("smartmill explain " + campaign + " -o " + folder + (is_whole ? " --budget 0" : ""));
}

void nextTest(std::ostream& out, const Explanation& e, const std::string& campaign,
              const std::string& folder) {
  out << "<h2>Next test</h2>\n<p>";
  if (e.suggested_test && e.suggested_cut) {
    out << "Make this test: <b>" << cutText(*e.suggested_cut) << "</b>";
    if (e.outcome) out << formatted("; %.2g s in the cut are enough", e.outcome->duration);
    out << ". ";
    if (e.outcome) out << outcomeText(*e.outcome);
    out << "Add the record to campaign.yaml and search again:</p>" << searchCommand(campaign, folder, false);
  } else if (e.suggested_test) {
    out << "Make " << escapedHtml(*e.suggested_test) << ".</p>";
  } else if (!e.not_tried.empty()) {
    out << "First complete the search (see What to do now); then the report states whether a test is "
           "needed.</p>";
  } else if (e.unexplained.empty() || e.named_only) {
    out << (e.named_only ? "No cut is known that shows the source of what has no name.</p>"
            : e.effects.empty()
                ? "No further test is needed: no difference beyond the noise remains.</p>"
                : "No further test is needed: no difference beyond the noise remains, and no other "
                  "cause that was checked does the same.</p>");
  } else {
    out << "No single cut decides what the remainder is. Its signal, place and dependence are listed "
           "below.</p>";
  }
  out << "\n" << measuredInstead(e);
}

std::string contentOfModel(const Explanation& e) {
  if (e.effects.empty()) return "";
  std::vector<std::string> titles;
  for (const FoundEffect& f : e.effects) titles.push_back(causeTitle(f.name) + " (" + f.name + ")");
  return "It contains " + joined(titles) +
         " as they were in these tests: remove an entry of its section <code>effects</code> when its cause "
         "is removed.";
}

void actions(std::ostream& out, const Explanation& e, const std::string& campaign,
             const std::string& folder) {
  std::vector<std::string> steps;
  for (const FoundEffect& f : e.effects) {
    const std::string& advice = findEffect(f.name)->advice;
    if (!advice.empty()) steps.push_back("<b>" + causeTitle(f.name) + "</b>: " + escapedHtml(advice) + ".");
    for (const Rival& r : f.alternatives) {
      if (isRival(e, f.name, r.name))
        steps.push_back("or <b>" + causeTitle(r.name) + "</b>: " + escapedHtml(findEffect(r.name)->advice) +
                        ".");
    }
  }
  if (e.verdict == Verdict::recalibrated) {
    for (const auto& group : e.not_separable) {
      for (const std::string& name : group)
        steps.push_back("Exclude <b>" + causeTitle(name) +
                        "</b>, which would do the same: " + escapedHtml(findEffect(name)->advice) + ".");
    }
    steps.push_back(
        "Check whether tool and material are those of the model. If they are, its values were wrong.");
  }
  if (!e.not_tried.empty()) {
    const std::string whole = searchCommand(campaign, folder, true);
    steps.push_back("Complete the search, without a limit of its time:" + whole);
  }
  if (!e.sentence.empty() && e.verdict != Verdict::recalibrated)
    steps.push_back("Look at the machine for the source of what has no name: " + escapedHtml(e.sentence));
  if (e.verdict == Verdict::no_disagreement)
    steps.push_back("Nothing: use the supplied model.");
  else
    steps.push_back((e.verdict == Verdict::recalibrated ? "Use the corrected model:"
                     : e.effects.empty()
                         ? "The cause is not known. Until it is, the corrected model predicts better than "
                           "the supplied one:"
                         : "Until the cause is removed, use the corrected model:") +
                    command("roslaunch smartmill_launch pipeline.launch model:=" + folder + "/model.yaml") +
                    contentOfModel(e));
  out << "<h2>What to do now</h2>\n<ol>";
  for (const std::string& step : steps) out << "<li>" << step << "</li>";
  out << "</ol>\n";
}

// ---- difference

// Of what a corrected model does not predict over what the channel does in the cuts.
std::string unpredictedText(const Explanation& e, const std::string& channel) {
  for (const ChannelShare& c : e.channels) {
    if (c.channel != channel) continue;
    if (c.explained_after < 0.0) return "worse than a constant";
    return formatted("%.2g %%", 100.0 * std::sqrt(1.0 - c.explained_after));
  }
  return "";
}

void difference(std::ostream& out, const Explanation& e) {
  out << "<h2>How well the models predict the measurement</h2>\n<table><tr><th>difference "
         "(RMS)<th>noise<th>fitted "
         "tests, supplied model<th>corrected model<th>held-out tests, supplied model<th>corrected "
         "model<th>corrected "
         "model, noise included, of the variation in the cuts</tr>\n<tr><td><b>all signals, times the "
         "noise</b><td>1<td><b>"
      << times(e.before.fit) << "</b><td><b>" << times(e.after.fit) << "</b><td><b>"
      << times(e.before.heldout) << "</b><td><b>" << times(e.after.heldout) << "</b><td></tr>\n";
  for (const auto& [channel, noise] : e.noise) {
    const ChannelWords words = channelWords(channel);
    const auto cell = [&, &name = channel, &rms = noise](bool heldout, bool corrected) {
      const double value = differenceOf(
          e.gaps, corrected, [&](const TestGap& g) { return g.channel == name && g.heldout == heldout; });
      return "<td>" + (value > 0.0 ? words.text(value * rms) : "");
    };
    out << "<tr><td>" << words.title << " <span class=\"dim\">(" << channel << ")</span><td>"
        << words.text(noise) << cell(false, false) << cell(false, true) << cell(true, false)
        << cell(true, true) << "<td>" << unpredictedText(e, channel) << "</tr>\n";
  }
  out << "</table>\n";
  std::vector<std::string> names;
  for (const ReportedTest& t : e.tests) {
    if (t.heldout) names.push_back(t.test.name);
  }
  out << "<p class=\"dim\">At 1 times the noise only noise remains. "
      << (names.empty() ? "No test was held out."
                        : "Held-out tests took no part in the search: " + escapedHtml(joined(names)) + ".")
      << "</p>\n";
}

// ---- remainder

// Squares above the noise of the fitted tests, of the model to whose residual the findings belong.
double remainingSquares(const Explanation& e) {
  double samples = 0.0;
  for (const TestGap& g : e.gaps) {
    if (!g.heldout && g.std_dev > 0.0) samples += 0.5 / (g.std_dev * g.std_dev);
  }
  const double gap = e.named_only ? e.named_only->fit : e.after.fit;
  return samples * std::max(gap * gap - 1.0, 0.0);
}

// Those with a share worth listing, the largest first.
std::vector<std::pair<double, const Finding*>> largestOf(const std::vector<Finding>& list, double squares) {
  std::vector<std::pair<double, const Finding*>> largest;
  for (const Finding& f : list) {
    const double share = squares > 0.0 ? std::min(f.squares / squares, 1.0) : 0.0;
    if (share >= LEAST_SHARE) largest.emplace_back(share, &f);
  }
  std::stable_sort(largest.begin(), largest.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  return largest;
}

std::string placeText(const Finding& f, int teeth) {
  if (f.domain == "order") {
    const double order = f.location.at("order");
    const bool at_teeth = teeth > 1 && std::abs(std::remainder(order, teeth)) < 1e-6;
    return (order == 1.0 ? std::string("once per revolution")
                         : formatted("%.4g times per revolution", order)) +
           (!at_teeth        ? ""
            : order == teeth ? " (the tooth passing)"
                             : formatted(" (%.0f times the tooth passing)", order / teeth));
  }
  if (f.domain == "frequency")
    return formatted("at %.4g Hz, not locked to the spindle", f.location.at("frequency_hz"));
  if (f.domain == "time")
    return formatted("changes %.3g s after the start of the record", f.location.at("time_s"));
  return f.domain == "level" ? "constant during a record" : f.domain;
}

std::string findingText(const Finding& f, int teeth) {
  const ChannelWords words = channelWords(f.channel);
  return words.title + ", " + words.text(f.amplitude) + ", " + placeText(f, teeth);
}

void findings(std::ostream& out, const std::vector<std::pair<double, const Finding*>>& list,
              const Explanation& e) {
  if (list.empty()) return;
  out << "<table><tr><th>signal<th>largest amplitude<th>where<th>share<th>changes with<th>tests</tr>\n";
  const int teeth = e.nominal.tool ? e.nominal.tool->teeth : 0;
  for (const auto& [share, f] : list) {
    const ChannelWords words = channelWords(f->channel);
    out << "<tr><td>" << words.title << "<td>" << words.text(f->amplitude) << "<td>" << placeText(*f, teeth)
        << "<td>" << percentText(share) << "<td>" << joined(f->depends_on) << "<td>" << f->tests.size()
        << " of " << e.tests.size() << "</tr>\n";
  }
  out << "</table>\n";
}

void remainder(std::ostream& out, const Explanation& e) {
  if (e.verdict == Verdict::no_disagreement) return;
  out << "<h2>What is not explained</h2>\n<p>";
  const bool only_noise = e.after.fit < ONLY_NOISE;
  const auto largest = largestOf(e.unexplained, remainingSquares(e));
  const Finding* const first = !largest.empty()         ? largest.front().second
                               : !e.unexplained.empty() ? &e.unexplained.front()
                                                        : nullptr;
  if (only_noise)
    out << "With the corrected model only noise remains (difference " << times(e.after.fit)
        << " times the noise): nothing that matters. ";
  else
    out << "With the corrected model a difference of " << times(e.after.fit) << " times the noise remains. ";
  if (first)
    out << (e.named_only ? "It contains the effect without a name, which was: " : "Its largest part: ")
        << findingText(*first, e.nominal.tool ? e.nominal.tool->teeth : 0) << ". ";
  if (!only_noise) {
    std::vector<std::string> shares;
    for (const ChannelShare& c : e.channels) {
      if (c.explained_after >= 0.0)
        shares.push_back(channelWords(c.channel).title + " " + unpredictedText(e, c.channel));
    }
    if (!shares.empty())
      out << "It limits the predictions of the corrected model; the difference is, of the variation in the "
             "cuts: "
          << joined(shares) << ".";
  }
  out << "</p>\n";
  findings(out, largest, e);
}

void inspection(std::ostream& out, const InspectionCheck& check) {
  if (check.dimensions.empty()) return;
  out << "<h2>Measured dimensions of the parts</h2>\n<p>" << check.text()
      << ". The search did not use them.</p>\n<table><tr><th>cut<th>dimension<th>measured minus "
         "nominal<th>supplied "
         "model<th>corrected model</tr>\n";
  const auto microns = [](double value) { return formatted("%.1f &micro;m", value / units::UM); };
  for (const InspectedDimension& d : check.dimensions)
    out << "<tr><td>" << escapedHtml(d.test) << "<td>"
        << (d.kind == SLOT_WIDTH ? "width of the slot along " : "position of the face along ") << d.direction
        << "<td>" << microns(d.measured) << " &plusmn; " << microns(1.96 * d.std_dev) << "<td>"
        << microns(d.before) << (d.agreesBefore() ? "" : ", differs") << "<td>" << microns(d.after)
        << (d.agreesAfter() ? "" : ", differs") << "</tr>\n";
  out << "</table>\n";
}

// ---- tests

std::string worseText(const Explanation& e, const std::string& test) {
  std::string text;
  for (const TestGap& g : e.gaps) {
    if (g.test == test && gotWorse(g))
      text += "<span class=\"bad\">worse</span> " + channelWords(g.channel).title + " " + times(g.before) +
              " &rarr; " + times(g.after) + "<br>";
  }
  return text;
}

void tests(std::ostream& out, const Explanation& e) {
  const bool remarks = std::any_of(e.gaps.begin(), e.gaps.end(), gotWorse) ||
                       std::any_of(e.tests.begin(), e.tests.end(), [&](const ReportedTest& t) {
                         return std::none_of(e.gaps.begin(), e.gaps.end(), [&](const TestGap& g) {
                           return g.test == t.test.name && g.before > 0.0;
                         });
                       });
  out << "<h2>Tests</h2>\n<table><tr><th>test<th>kind<th>speed [rpm]<th>feed per tooth [mm]<th>depth "
         "[mm]<th>immersion [&deg;]<th>held out<th>supplied model<th>corrected model"
      << (remarks ? "<th>worse signals" : "") << "</tr>\n";
  for (const ReportedTest& t : e.tests) {
    const auto of_test = [&](const TestGap& g) { return g.test == t.test.name; };
    out << "<tr><td>" << escapedHtml(t.test.name) << "<td>" << kindText(t.test) << "<td>"
        << formatted("%.0f", units::rpmFromRadPerSec(t.test.spindle_speed));
    if (const std::optional<Engagement>& c = t.test.engagement)
      out << "<td>" << formatted("%.3g", c->feed_per_tooth / units::MM) << "<td>"
          << formatted("%.3g", c->axial_depth / units::MM) << "<td>"
          << formatted("%.0f to %.0f", units::degFromRad(c->entry), units::degFromRad(c->exit));
    else
      out << "<td><td><td>";
    const double before = differenceOf(e.gaps, false, of_test), after = differenceOf(e.gaps, true, of_test);
    out << "<td>" << (t.heldout ? "yes" : "");
    if (before > 0.0)
      out << "<td>" << times(before) << "<td>" << times(after) << "<td>" << worseText(e, t.test.name)
          << "</tr>\n";
    else
      out << "<td><td><td>" << (t.left_out ? "left out: it chatters" : "chatters, compared step by step")
          << "</tr>\n";
  }
  out << "</table>\n<p class=\"dim\">Difference of all signals of a test, times the noise.</p>\n";
}

// ---- quality of data and search

std::string vibrationText(const Explanation& e) {
  std::vector<std::string> parts;
  for (const ChannelShare& c : e.channels) {
    if (c.synchronous_share)
      parts.push_back(channelWords(c.channel).title + " " + channelWords(c.channel).text(c.floor));
  }
  return parts.empty() ? ""
                       : " Part of the signals that is not locked to the spindle, noise included (RMS): " +
                             joined(parts) + ".";
}

void quality(std::ostream& out, const Explanation& e) {
  std::vector<std::string> lines;
  lines.push_back(searchText(e) + formatted(" It took %.0f s", e.seconds) +
                  (e.spent_budget
                       ? formatted("; its stages were ended by the budget of %.0f s.", *e.spent_budget)
                       : std::string(".")) +
                  (e.interrupted ? " It was interrupted by the user." : ""));
  std::vector<std::string> left_out;
  for (const ReportedTest& t : e.tests) {
    if (t.left_out) left_out.push_back(t.test.name);
  }
  const bool chatter = !left_out.empty() || !e.chattering.empty();
  lines.push_back("Tests: " +
                  (left_out.empty()
                       ? "none was left out. "
                       : "left out, since they chatter: " + escapedHtml(joined(left_out)) + ". ") +
                  (chatter ? "" : "No test chatters.") + vibrationText(e));
  std::string shifts;
  for (const std::string& shift : e.stream_shifts) shifts += " " + escapedHtml(shift) + ".";
  lines.push_back(
      "Signals: no force and no displacement is clipped by the recorder (such records are refused)." +
      (shifts.empty() ? std::string(" No shift in time between force sensor and controller was corrected.")
                      : shifts));
  std::size_t beyond = 0;
  for (const RecalibratedValue& v : e.calibrated) beyond += std::abs(v.deviations) > 2.0;
  if (!e.calibrated.empty()) {
    const RecalibratedValue& most = e.calibrated.front();
    lines.push_back(
        formatted("Values of the supplied model: %zu were refined, %zu of them beyond twice their stated "
                  "uncertainty. Most: %s %.4g &rarr; %.4g (%+.2f %%). All are in the appendix.",
                  e.calibrated.size(), beyond, most.name.c_str(), most.before, most.after,
                  100.0 * (most.after / most.before - 1.0)));
  }
  const auto worse = static_cast<std::size_t>(std::count_if(e.gaps.begin(), e.gaps.end(), gotWorse));
  lines.push_back(worse == 0
                      ? "No signal of any test is predicted worse by the corrected model."
                      : formatted("%zu of %zu signals (tests times channels) are predicted worse by the "
                                  "corrected model; they are marked in the table of the tests.",
                                  worse, e.gaps.size()));
  list(out, "Data and search", lines);
}

// ---- plots

std::string axisText(const std::string& channel) {
  const ChannelWords words = channelWords(channel);
  std::string unit = words.unit;
  if (unit == "&micro;m") unit = "\u00b5m";
  if (unit == "m/s&sup2;") unit = "m/s\u00b2";
  return words.title + " [" + unit + "]";
}

std::vector<double> scaled(std::vector<double> values, const std::string& channel) {
  for (double& v : values) v *= channelWords(channel).scale;
  return values;
}

constexpr const char* SUPPLIED_COLOUR = "#d95f02";
constexpr const char* CORRECTED_COLOUR = "#1b9e77";

void revolutions(ReportPage& page, const Explanation& e) {
  if (e.revolutions.empty()) return;
  page.html()
      << "<h2 class=\"page\">Signal over one revolution</h2>\n<p class=\"dim\">The wheel zooms, dragging "
         "moves, a "
         "double click shows everything. Mean of all revolutions; the test with the largest difference is "
         "first.</p>\n";
  std::string test;
  for (const RevolutionCurve& c : e.revolutions) {
    if (c.test != test) {
      if (!test.empty()) page.html() << "</div>\n", page.endChoice();
      page.beginChoice(c.test);
      page.html() << "<div class=\"plots\">\n";
      test = c.test;
    }
    page.plot({channelWords(c.channel).title + ", " + c.test,
               "spindle angle [deg]",
               axisText(c.channel),
               false,
               {{"supplied model", SUPPLIED_COLOUR, false, c.angle_deg, scaled(c.nominal, c.channel)},
                {"corrected model", CORRECTED_COLOUR, false, c.angle_deg, scaled(c.improved, c.channel)},
                {"measured", "var(--text)", true, c.angle_deg, scaled(c.measured, c.channel)}}});
  }
  page.html() << "</div>\n";
  page.endChoice();
}

std::vector<PagePlot::Mark> orderMarks(const SpectrumCurve& s, int teeth) {
  std::vector<PagePlot::Mark> marks;
  if (s.order_hz <= 0.0) return marks;
  std::set<int> orders{1};
  for (int k = 1; k <= 3 && teeth > 0; ++k) orders.insert(k * teeth);
  for (const int order : orders) marks.push_back({order * s.order_hz, formatted("%dx", order)});
  return marks;
}

// The largest line before, and the same after.
std::string largestLine(const SpectrumCurve& s) {
  const auto largest = std::max_element(s.before.begin(), s.before.end());
  if (largest == s.before.end()) return "";
  const auto k = static_cast<std::size_t>(largest - s.before.begin());
  const ChannelWords words = channelWords(s.channel);
  const double order = s.order_hz > 0.0 ? s.frequency_hz[k] / s.order_hz : 0.0;
  return words.title + " in " + escapedHtml(s.test) + ": " + words.text(s.before[k]) + " at " +
         formatted("%.4g Hz", s.frequency_hz[k]) +
         (order == 0.0  ? ""
          : order < 0.5 ? ", slower than the spindle"
                        : formatted(", %.3g times per revolution", order)) +
         "; with the corrected model " + words.text(s.after[k]);
}

// What the models lack in the forces of each cut, over the cutting time of the edge.
void wear(ReportPage& page, const Explanation& e) {
  if (std::none_of(e.effects.begin(), e.effects.end(),
                   [](const FoundEffect& f) { return f.name == "tool_wear"; }))
    return;
  PagePlot::Curve before{"supplied model", SUPPLIED_COLOUR, true, {}, {}},
      after{"corrected model", CORRECTED_COLOUR, true, {}, {}};
  for (const ReportedTest& t : e.tests) {
    if (t.test.kind != TestKind::cut || !t.test.cut_time_before) continue;
    double supplied = 0.0, corrected = 0.0;  // [N2]
    for (const TestGap& g : e.gaps) {
      const auto& forces = FORCE_CHANNELS;
      if (g.test != t.test.name || std::find(forces.begin(), forces.end(), g.channel) == forces.end())
        continue;
      supplied += std::pow(g.before * e.noise.at(g.channel), 2);
      corrected += std::pow(g.after * e.noise.at(g.channel), 2);
    }
    for (PagePlot::Curve* curve : {&before, &after}) curve->x.push_back(*t.test.cut_time_before / 60.0);
    before.y.push_back(std::sqrt(supplied));
    after.y.push_back(std::sqrt(corrected));
  }
  page.html()
      << "<h2>Wear over the cutting time</h2>\n<p>Force that a model lacks in each cut, RMS of fx, fy and fz "
         "together. With wear it grows with the cutting time of the edge and with the depth of the "
         "cut.</p>\n<div class=\"plots\">\n";
  page.plot({"difference of the forces",
             "cutting time of the edge before the cut [min]",
             "difference [N]",
             false,
             {before, after}});
  page.html() << "</div>\n";
}

void spectra(ReportPage& page, const Explanation& e) {
  if (e.spectra.empty()) return;
  std::vector<std::string> lines;
  for (const SpectrumCurve& s : e.spectra) lines.push_back(largestLine(s));
  page.html()
      << "<h2>Spectra of the difference</h2>\n<p>Largest lines:</p>\n<ul><li>" << joined(lines, "</li><li>")
      << "</li></ul>\n<p class=\"dim\">Dashed: once per revolution (1x) and the tooth passing with its "
         "multiples.</p>\n"
         "<div class=\"plots\">\n";
  for (const SpectrumCurve& s : e.spectra)
    page.plot({channelWords(s.channel).title + ", " + s.test,
               "frequency [Hz]",
               axisText(s.channel),
               true,
               {{"supplied model", SUPPLIED_COLOUR, false, s.frequency_hz, scaled(s.before, s.channel)},
                {"corrected model", CORRECTED_COLOUR, false, s.frequency_hz, scaled(s.after, s.channel)}},
               orderMarks(s, e.nominal.tool ? e.nominal.tool->teeth : 0)});
  page.html() << "</div>\n";
}

// ---- appendix

// Levels of colour of a difference, times the noise.
std::string cellText(const TestGap& g) {
  int level = 0;
  for (const double limit : {1.2, 2.0, 5.0, 20.0}) level += g.after > limit;
  return "<td" + (level ? formatted(" class=\"level%d\"", level) : "") + ">" + times(g.before) + " &rarr; " +
         times(g.after) + (gotWorse(g) ? " (worse)" : "");
}

void cells(std::ostream& out, const Explanation& e) {
  out << "<h2>Difference of every signal of every test</h2>\n<p class=\"dim\">Times the noise, supplied "
         "&rarr; corrected "
         "model; coloured by the corrected one above 1.2, 2, 5 and 20. Empty: the signal is not recorded or "
         "not "
         "compared in this test.</p>\n<table><tr><th>test";
  for (const auto& [channel, noise] : e.noise) out << "<th>" << channel;
  out << "</tr>\n";
  for (const ReportedTest& t : e.tests) {
    out << "<tr><td>" << escapedHtml(t.test.name) << (t.heldout ? " (held out)" : "");
    for (const auto& [channel, noise] : e.noise) {
      const auto cell = std::find_if(e.gaps.begin(), e.gaps.end(), [&, &c = channel](const TestGap& g) {
        return g.test == t.test.name && g.channel == c;
      });
      out << (cell == e.gaps.end() ? "<td>" : cellText(*cell));
    }
    out << "</tr>\n";
  }
  out << "</table>\n";
}

void candidates(std::ostream& out, const Explanation& e) {
  if (!e.candidates.empty()) {
    out << "<h2>Causes that were compared by a fit</h2>\n<table><tr><th>round<th>cause<th>explains, of the "
           "best "
           "of its round<th>accepted</tr>\n";
    for (const CandidateResult& t : e.candidates) {
      double best = 0.0;
      for (const CandidateResult& other : e.candidates) {
        if (other.round == t.round) best = std::max(best, other.delta_bic);
      }
      out << "<tr><td>" << t.round + 1 << "<td>" << namedCause(t.effect)
          << (t.variant.empty() ? "" : ", " + escapedHtml(t.variant)) << "<td>"
          << (best > 0.0 && t.delta_bic > 0.0 ? formatted("%.3g %%", 100.0 * t.delta_bic / best) : "none")
          << "<td>" << (t.accepted ? "accepted" : "") << "</tr>\n";
    }
    out << "</table>\n";
  }
  std::vector<std::string> unchecked;
  for (const std::string& name : e.not_tried) unchecked.push_back(namedCause(name));
  for (const Untestable& one : e.untestable)
    unchecked.push_back(namedCause(one.effect) + ": these tests cannot show it, " + escapedHtml(one.reason));
  list(out, "Causes that were not checked", unchecked);
}

void chattering(std::ostream& out, const std::vector<ChatteringCut>& cuts) {
  if (cuts.empty()) return;
  out << "<h2>Cuts that chatter</h2>\n<p>Compared by one-step prediction, not by free simulation; not part "
         "of the "
         "difference above.</p>\n<table><tr><th>test<th>frequency [Hz]<th>amplitude [N]<th>error of the "
         "prediction, "
         "supplied model<th>corrected model</tr>\n";
  for (const ChatteringCut& c : cuts)
    out << "<tr><td>" << escapedHtml(c.test) << formatted("<td>%.4g<td>%.3g", c.frequency, c.amplitude)
        << formatted("<td>%.1f %%<td>%.1f %%", 100.0 * c.before, 100.0 * c.after) << "</tr>\n";
  out << "</table>\n";
}

void appendix(std::ostream& out, const Explanation& e) {
  out << "<details class=\"page\"><summary>Appendix: every signal, causes compared and not checked, values, "
         "notes</summary>\n";
  cells(out, e);
  candidates(out, e);
  if (const auto largest = largestOf(e.where,
                                     [&] {
                                       double squares = 0.0;
                                       for (const Finding& f : e.where) squares += f.squares;
                                       return squares;
                                     }());
      !largest.empty()) {
    out << "<h2>Where the supplied model differs</h2>\n";
    findings(out, largest, e);
  }
  values(out, "Values of the model", e.calibrated);
  chattering(out, e.chattering);
  std::vector<std::string> notes;
  for (const std::string& note : e.notes) notes.push_back(escapedHtml(note));
  list(out, "Notes", notes);
  out << "<p class=\"dim\">Verdict in report.json: " << nameOf(e.verdict) << ".</p>\n</details>\n";
}

}  // namespace

void writeHtml(const Explanation& e, const std::string& campaign, const std::string& folder) {
  namespace fs = std::filesystem;
  const auto whole = [](const std::string& path) {
    std::string text = fs::absolute(path).lexically_normal().string();
    while (text.size() > 1 && text.back() == '/') text.pop_back();
    return text;
  };
  const std::string from = whole(campaign), to = whole(folder);
  ReportPage page("Measurement and simulation: " + fs::path(from).filename().string());
  std::ostream& out = page.html();
  head(out, e);
  causes(out, e);
  notNamed(out, e);
  values(out, "Values of the supplied model that are wrong", e.recalibrated);
  actions(out, e, from, to);
  nextTest(out, e, from, to);
  difference(out, e);
  remainder(out, e);
  inspection(out, e.inspection);
  tests(out, e);
  quality(out, e);
  revolutions(page, e);
  wear(page, e);
  spectra(page, e);
  appendix(out, e);
  page.write(folder + "/report.html");
}

}  // namespace smartmill::discrepancy
