#include "smartmill_discrepancy/report/report_html.h"

#include <algorithm>
#include <map>
#include <ostream>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/report_page.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

std::string number(double value, const char* format = "%.4g") {
  return formatted(format, value);
}

void findings(std::ostream& out, const char* title, const std::vector<Finding>& list) {
  if (list.empty()) return;
  out << "<h2>" << title
      << "</h2>\n<table><tr><th>channel<th>domain<th>where<th>largest amplitude<th>share of the gap<th>false "
         "discovery rate<th>depends on<th>tests</tr>\n";
  for (const Finding& f : list) {
    out << "<tr><td>" << f.channel << "<td>" << f.domain << "<td>";
    for (const auto& [key, value] : f.location) out << key << " " << number(value, "%.5g") << " ";
    out << "<td>" << number(f.amplitude) << "<td>" << number(f.share_of_gap) << "<td>"
        << number(f.p_value, "%.1e") << "<td>" << joined(f.depends_on) << "<td>" << f.tests.size() << ": "
        << escapedHtml(joined(f.tests)) << "</tr>\n";
  }
  out << "</table>\n";
}

const char* sentenceOf(Verdict verdict) {
  static const std::map<Verdict, const char*> SENTENCES{
      {Verdict::no_disagreement, "Model and records agree within the noise."},
      {Verdict::recalibrated,
       "No effect is missing: with the values below in place of the stated ones, model and records agree."},
      {Verdict::explained, "The effects below explain the difference between model and records."},
      {Verdict::partly_explained,
       "The effects below explain a part of the difference; the rest is not in the catalogue."},
      {Verdict::unknown_effect,
       "Model and records differ, and no effect of the catalogue explains the difference."}};
  return SENTENCES.at(verdict);
}

const std::map<std::string, std::string> CAPTIONS{
    {"gaps.png", "Gap of every test and channel before and after"},
    {"candidates.png", "BIC gain of the candidates"},
    {"residual.png", "Gap after, test by test"}};

void verdict(std::ostream& out, const Explanation& e) {
  out << "<p class=\"verdict\"><b>" << nameOf(e.verdict) << "</b>. " << sentenceOf(e.verdict) << "</p>\n";
  if (!e.sentence.empty()) out << "<p><b>" << escapedHtml(e.sentence) << "</b></p>\n";
  if (e.interrupted) out << "<p>The search was interrupted: effects found until then.</p>\n";
  if (e.spent_budget)
    out << "<p>The search was ended by its budget of " << number(*e.spent_budget)
        << " s: effects found until then.</p>\n";
  if (!e.not_tried.empty()) out << "<p>Not tried: " << joined(e.not_tried) << ".</p>\n";
  out << "<table><tr><th>difference, as a multiple of the noise<th>before<th>after</tr><tr><td>tests used to "
         "find the cause<td>"
      << number(e.before.fit) << "<td>" << number(e.after.fit) << "</tr><tr><td>held-out tests<td>"
      << number(e.before.heldout) << "<td>" << number(e.after.heldout)
      << "</tr></table>\n<p>This gap is the RMS of measured minus simulated values over the noise; at 1 only "
         "noise is "
         "left.</p>\n";
}

void recalibrated(std::ostream& out, const std::vector<RecalibratedValue>& values) {
  if (values.empty()) return;
  out << "<h2>Values of the model</h2>\n<table><tr><th>value<th>stated<th>from the "
         "records<th>change<th>stated "
         "deviations</tr>\n";
  for (const RecalibratedValue& v : values)
    out << "<tr><td>" << v.name << "<td>" << number(v.before, "%.5g") << "<td>" << number(v.after, "%.5g")
        << " &plusmn; " << number(v.std_dev, "%.2g") << "<td>"
        << number(100.0 * (v.after / v.before - 1.0), "%+.2f %%") << "<td>" << number(v.deviations, "%+.1f")
        << "</tr>\n";
  out << "</table>\n";
}

// A key of an effect as a machinist reads it, with its unit.
std::string sizeOf(const FoundEffect& effect, const FoundParameter& p) {
  const EffectParameter& parameter = parameterOf(*findEffect(effect.name), p.key);
  const bool is_item = p.key.find('[') != std::string::npos;  // of a list: the key says which
  return (is_item ? p.key : parameter.quantity()) + " " + number(p.known(), "%.5g") + " &plusmn; " +
         number(p.std_dev, "%.2g") +
         (is_item || parameter.unit == "1" ? "" : " " + escapedHtml(parameter.unit)) +
         (p.modulo > 0.0 ? " (plus multiples of " + number(p.modulo) + ")" : "") + "<br>";
}

std::string titleOf(const std::string& effect) {
  std::string title = effect;
  std::replace(title.begin(), title.end(), '_', ' ');
  return title;
}

std::string certaintyOf(double confidence) {
  constexpr double NEARLY = 0.999;
  return confidence > NEARLY ? "above 99.9 %" : number(100.0 * confidence, "%.3g %%");
}

void effects(std::ostream& out, const Explanation& e) {
  if (!e.effects.empty()) {
    out << "<h2>What the machine has and the model lacks</h2>\n<table><tr><th>effect<th>what it does<th>how "
           "large<th>how "
           "sure<th>what else it may be</tr>\n";
    for (const FoundEffect& f : e.effects) {
      out << "<tr><td><b>" << titleOf(f.name) << "</b>";
      for (const auto& [key, word] : f.words) out << "<br>" << key << " " << escapedHtml(word);
      out << "<td>" << escapedHtml(findEffect(f.name)->description) << "<td>";
      for (const FoundParameter& p : f.parameters) out << sizeOf(f, p);
      std::string others;
      for (const auto& group : e.not_separable) {
        if (std::find(group.begin(), group.end(), f.name) == group.end()) continue;
        for (const std::string& other : group) {
          if (other != f.name) others += (others.empty() ? "" : ", ") + titleOf(other);
        }
      }
      out << "<td>" << certaintyOf(f.confidence)
          << (others.empty() ? "; removes " : ", this or what else it may be; removes ")
          << number(100.0 * f.heldout_gap_reduction, "%.0f %%")
          << " of the difference in cuts that were not used to find it<td>"
          << (others.empty() ? "nothing in the catalogue fits as well" : others + ": these records fit both")
          << "</tr>\n";
    }
    out << "</table>\n";
  }
  for (const Resemblance& r : e.resembles) {
    out << "<p>Not named: <b>" << titleOf(r.name) << "</b>"
        << (r.variant.empty() ? "" : " (" + escapedHtml(r.variant) + ")") << ", " << escapedHtml(r.reason)
        << ".</p>\n";
  }
}

// What to do now, the most useful first.
void nextSteps(std::ostream& out, const Explanation& e) {
  std::vector<std::string> steps;
  const auto add = [&steps](const std::string& step) {
    if (std::find(steps.begin(), steps.end(), step) == steps.end()) steps.push_back(step);
  };
  for (const FoundEffect& f : e.effects) {
    const std::string& advice = findEffect(f.name)->advice;
    if (!advice.empty()) add("<b>" + titleOf(f.name) + "</b>: " + escapedHtml(advice) + ".");
  }
  if (e.verdict == Verdict::recalibrated) {
    for (const auto& group : e.not_separable) {
      for (const std::string& name : group)
        add("Exclude <b>" + titleOf(name) +
            "</b>, which would do the same: " + escapedHtml(findEffect(name)->advice) + ".");
    }
    add("Check whether tool and material are those of the model. If they are, its values were off.");
  }
  if (e.suggested_test)
    add("Make this test, which decides what these records leave open: " + escapedHtml(*e.suggested_test) +
        ".");
  if (e.verdict != Verdict::no_disagreement)
    add("Use the improved model: <code>pipeline.launch model:=</code> or <code>machine.launch model:=</code> "
        "with "
        "<code>model.yaml</code> of this folder.");
  if (!e.unexplained.empty())
    add("The rest has no name. Where it is and what it depends on is listed under <i>Unexplained "
        "residual</i>.");
  if (steps.empty()) return;
  out << "<h2>What to do</h2>\n<ol>";
  for (const std::string& step : steps) out << "<li>" << step << "</li>";
  out << "</ol>\n";
}

void shares(std::ostream& out, const std::vector<ChannelShare>& channels) {
  if (channels.empty()) return;
  out << "<h2>Shares of the variance in all cuts</h2>\n<table><tr><th>channel<th>explained "
         "before<th>explained "
         "after<th>synchronous with the spindle<th>RMS of the asynchronous part<th>the same over the "
         "noise</tr>\n";
  const auto percent = [](double share) { return number(100.0 * share, "%.2f %%"); };
  for (const ChannelShare& c : channels) {
    out << "<tr><td>" << c.channel << "<td>" << percent(c.explained_before) << "<td>"
        << percent(c.explained_after);
    if (c.synchronous_share)
      out << "<td>" << percent(*c.synchronous_share) << "<td>" << number(c.floor) << "<td>"
          << number(c.floor_gap);
    out << "</tr>\n";
  }
  out << "</table>\n";
}

void chattering(std::ostream& out, const std::vector<ChatteringCut>& cuts) {
  if (cuts.empty()) return;
  out << "<h2>Cuts that chatter</h2>\n<p>Compared by one-step prediction, not by free simulation; "
         "not part of the gaps.</p>\n<table><tr><th>test<th>frequency [Hz]<th>amplitude [N]<th>prediction "
         "error before<th>after</tr>\n";
  for (const ChatteringCut& c : cuts) {
    out << "<tr><td>" << escapedHtml(c.test) << "<td>" << number(c.frequency) << "<td>" << number(c.amplitude)
        << "<td>" << number(100.0 * c.before, "%.1f %%") << "<td>" << number(100.0 * c.after, "%.1f %%")
        << "</tr>\n";
  }
  out << "</table>\n";
}

void images(ReportPage& page, const std::vector<std::string>& pictures, const std::string& folder) {
  for (const std::string& name : pictures) {
    // Revolutions and spectra are drawn from their data.
    if (const auto caption = CAPTIONS.find(name); caption != CAPTIONS.end())
      page.picture(folder + "/" + name, caption->second);
  }
}

std::string unitOf(const std::string& channel) {
  return channel == "load_meter"         ? "load meter [V]"
         : channel.rfind("tool", 0) == 0 ? "displacement [m]"
                                         : "force [N]";
}

void curves(ReportPage& page, const Explanation& e) {
  if (!e.revolutions.empty())
    page.html()
        << "<h2>Force over one revolution</h2>\n<p>The wheel zooms, dragging moves, a double click shows "
           "everything.</p>\n";
  std::string test;
  for (const RevolutionCurve& c : e.revolutions) {
    if (c.test != test) {
      if (!test.empty()) page.html() << "</div>\n", page.endChoice();
      page.beginChoice(c.test);
      page.html() << "<div class=\"plots\">\n";
      test = c.test;
    }
    page.plot({c.channel + ", " + c.test,
               "spindle angle [deg]",
               unitOf(c.channel),
               false,
               {{"measured", "#8d99a6", true, c.angle_deg, c.measured},
                {"model as stated", "#d95f02", false, c.angle_deg, c.nominal},
                {"improved model", "#1b9e77", false, c.angle_deg, c.improved}}});
  }
  if (!test.empty()) page.html() << "</div>\n", page.endChoice();
  if (e.spectra.empty()) return;
  page.html() << "<h2>Spectra of measured minus simulated</h2>\n<div class=\"plots\">\n";
  for (const SpectrumCurve& s : e.spectra) {
    const std::string order = s.order_hz > 0.0 ? formatted(", one order is %.4g Hz", s.order_hz) : "";
    page.plot({s.channel + ", " + s.test + order,
               "frequency [Hz]",
               unitOf(s.channel),
               true,
               {{"before", "#d95f02", false, s.frequency_hz, s.before},
                {"after", "#1b9e77", false, s.frequency_hz, s.after}}});
  }
  page.html() << "</div>\n";
}

void candidates(std::ostream& out, const std::vector<CandidateResult>& tried) {
  if (tried.empty()) return;
  out << "<h2>Candidates fitted</h2>\n<table><tr><th>round<th>effect<th>predicted "
         "gain<th>BIC gain<th>tests simulated<th>seconds</tr>\n";
  for (const CandidateResult& t : tried) {
    out << "<tr><td>" << t.round + 1 << "<td>" << (t.accepted ? "<b>" : "") << t.effect
        << (t.variant.empty() ? "" : " (" + t.variant + ")") << (t.accepted ? "</b>" : "") << "<td>"
        << number(t.predicted_gain) << "<td>" << number(t.delta_bic) << "<td>" << t.simulations << "<td>"
        << number(t.seconds, "%.1f") << "</tr>\n";
  }
  out << "</table>\n";
}

void inspection(std::ostream& out, const InspectionCheck& check) {
  if (check.dimensions.empty()) return;
  out << "<h2>Measured dimensions of the parts</h2>\n<p>" << check.text()
      << ". The search did not use them.</p>\n<table><tr><th>cut<th>dimension<th>measured minus nominal<th>"
         "stated model<th>improved model</tr>\n";
  const auto microns = [](double value) { return number(value / units::UM, "%.1f") + " &micro;m"; };
  for (const InspectedDimension& d : check.dimensions)
    out << "<tr><td>" << escapedHtml(d.test) << "<td>"
        << (d.kind == SLOT_WIDTH ? "width of the slot along " : "position of the face along ") << d.direction
        << "<td>" << microns(d.measured) << " &plusmn; " << microns(d.std_dev) << "<td>" << microns(d.before)
        << (d.agreesBefore() ? "" : ", differs") << "<td>" << microns(d.after)
        << (d.agreesAfter() ? "" : ", differs") << "</tr>\n";
  out << "</table>\n";
}

void notes(std::ostream& out, const std::vector<std::string>& lines) {
  if (lines.empty()) return;
  out << "<h2>Notes</h2>\n<ul>";
  for (const std::string& note : lines) out << "<li>" << escapedHtml(note) << "</li>";
  out << "</ul>\n";
}

}  // namespace

void writeHtml(const Explanation& e, const std::string& campaign, const std::vector<std::string>& pictures,
               const std::string& folder) {
  ReportPage page("Where simulation and measurement disagree: " + campaign);
  std::ostream& out = page.html();
  verdict(out, e);
  recalibrated(out, e.recalibrated);
  effects(out, e);
  inspection(out, e.inspection);
  nextSteps(out, e);
  shares(out, e.channels);
  chattering(out, e.chattering);
  curves(page, e);
  images(page, pictures, folder);
  findings(out, "Unexplained residual", e.unexplained);
  findings(out, "Disagreement of the nominal model", e.where);
  candidates(out, e.candidates);
  notes(out, e.notes);
  out << "<p>" << number(e.seconds, "%.0f") << " s.</p>\n";
  page.write(folder + "/report.html");
}

}  // namespace smartmill::discrepancy
