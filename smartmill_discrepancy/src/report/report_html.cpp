#include "smartmill_discrepancy/report/report_html.h"

#include <map>
#include <ostream>

#include "smartmill_core/formatted.h"
#include "smartmill_core/io/report_page.h"

namespace smartmill::discrepancy {
namespace {

std::string number(double value, const char* format = "%.4g") {
  return formatted(format, value);
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& w : words) text += (text.empty() ? "" : ", ") + w;
  return text;
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
    {"revolution.png", "One revolution of the cut with the largest residual: measured, nominal, improved"},
    {"spectra.png",
     "Spectra of the residual before and after; arrows: lines found (orange) and unexplained (violet)"},
    {"candidates.png", "BIC gain of the candidates"},
    {"residual.png", "Gap after, test by test"}};

void verdict(std::ostream& out, const Explanation& e) {
  out << "<p class=\"verdict\"><b>" << nameOf(e.verdict) << "</b>. " << sentenceOf(e.verdict) << "</p>\n";
  if (!e.sentence.empty()) out << "<p><b>" << escapedHtml(e.sentence) << "</b></p>\n";
  if (e.interrupted) out << "<p>The search was interrupted: effects found until then.</p>\n";
  out << "<table><tr><th>gap<th>before<th>after</tr><tr><td>fit tests<td>" << number(e.before.fit) << "<td>"
      << number(e.after.fit) << "</tr><tr><td>held-out tests<td>" << number(e.before.heldout) << "<td>"
      << number(e.after.heldout)
      << "</tr></table>\n<p>The gap is the RMS of (measured - simulated) over the noise; 1 is the noise "
         "floor.</p>\n";
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

void effects(std::ostream& out, const Explanation& e) {
  if (!e.effects.empty()) {
    out << "<h2>Effects found</h2>\n<table><tr><th>effect<th>parameters<th>BIC gain<th>share "
           "of the held-out gap<th>alternatives (BIC gain)</tr>\n";
    for (const FoundEffect& f : e.effects) {
      out << "<tr><td><b>" << f.name << "</b><td>";
      for (const auto& [key, word] : f.words) out << key << " " << escapedHtml(word) << "<br>";
      for (const FoundParameter& p : f.parameters)
        out << p.key << " = " << number(p.value, "%.5g") << " &plusmn; " << number(p.std_dev, "%.2g")
            << "<br>";
      out << "<td>" << number(f.delta_bic) << "<td>" << number(f.heldout_gap_reduction) << "<td>";
      for (const auto& [name, delta] : f.alternatives) out << name << " (" << number(delta) << ")<br>";
      out << "</tr>\n";
    }
    out << "</table>\n";
  }
  for (const Resemblance& r : e.resembles) {
    out << "<p>Not named: <b>" << r.name << "</b>"
        << (r.variant.empty() ? "" : " (" + escapedHtml(r.variant) + ")") << ", " << escapedHtml(r.reason)
        << ".</p>\n";
  }
  for (const auto& group : e.not_separable)
    out << "<p>Unidentifiable with this campaign: " << joined(group) << ".</p>\n";
  if (e.suggested_test)
    out << "<p>A test that separates them: " << escapedHtml(*e.suggested_test) << ".</p>\n";
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
    const auto caption = CAPTIONS.find(name);
    page.picture(folder + "/" + name, caption != CAPTIONS.end() ? caption->second : name);
  }
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
  shares(out, e.channels);
  chattering(out, e.chattering);
  images(page, pictures, folder);
  findings(out, "Unexplained residual", e.unexplained);
  findings(out, "Disagreement of the nominal model", e.where);
  candidates(out, e.candidates);
  notes(out, e.notes);
  out << "<p>" << number(e.seconds, "%.0f") << " s.</p>\n";
  page.write(folder + "/report.html");
}

}  // namespace smartmill::discrepancy
