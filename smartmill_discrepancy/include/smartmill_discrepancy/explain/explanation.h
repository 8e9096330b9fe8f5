#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_discrepancy/gap/structure.h"
#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

/// A number of an effect with what is known of it.
struct FoundParameter {
  std::string key;  ///< as in the model file
  double value = 0.0;
  double std_dev = 0.0;
};

struct FoundEffect {
  std::string name, variant;
  std::map<std::string, std::string> words;
  std::vector<FoundParameter> parameters;
  double delta_bic = 0.0;  ///< BIC that is lost without it
  double heldout_gap_reduction =
      0.0;  ///< [1] share of the held-out squares above the noise that it takes away
  double evenness =
      0.0;  ///< [1] variance over the tests of the size in which each test shows it; 0 where all agree
  /// [1] that the tests as a body prefer this effect to its best rival (or to none), were they drawn anew:
  /// Vuong's comparison of two models over tests.
  double confidence = 0.0;
  std::vector<std::pair<std::string, double>> alternatives;  ///< other effects in its place: name, delta_bic
};

/// Gap of one channel of one test before and after.
struct BlockGap {
  std::string test, channel;
  bool heldout = false;
  double before = 0.0, after = 0.0;
  double std_dev = 0.0;  ///< of a gap at the noise floor, by chance alone
};

/// One channel of one test over the spindle angle: the mean of the record's revolutions in bins.
struct RevolutionCurve {
  std::string test, channel;
  std::vector<double> angle_deg, measured, nominal, improved;  ///< [deg], [unit of the channel]
};

/// Amplitude spectrum of what measurement and model differ by.
struct SpectrumCurve {
  std::string test, channel;
  double order_hz = 0.0;                            ///< one order of the spindle; 0 while it stands
  std::vector<double> frequency_hz, before, after;  ///< [Hz], [unit of the channel]
};

struct GapPair {
  double fit = 0.0, heldout = 0.0;
};

/// Draws a gnuplot program into a PNG file. @throws Error when gnuplot is missing or fails.
void drawWithGnuplot(const std::string& png, int width, int height, const std::string& commands);

/// What explain found (formats.md section 3).
struct Explanation {
  std::string verdict;
  std::vector<Finding> where, unexplained;
  std::vector<FoundEffect> effects;
  std::vector<std::vector<std::string>> not_separable;
  std::optional<std::string> suggested_test;
  GapPair before, after;
  std::vector<BlockGap> gaps;
  std::vector<Rung> ladder;
  std::vector<std::string> notes;
  std::vector<RevolutionCurve> revolutions;
  std::vector<SpectrumCurve> spectra;
  MachineModel model;  ///< the improved one, as written
  double seconds = 0.0;
};

struct ExplainOptions {
  SearchOptions search;
  StructureOptions structure;
  double least_heldout_reduction = 0.1;  ///< [1] of the held-out squares above the noise
  double least_evenness =
      0.04;  ///< an effect whose size differs more from test to test stands for another cause
};

/// The whole workflow. Writes FOLDER/model.yaml and measures the gap after from that file.
/// @throws Error on a campaign or model that cannot be worked with.
Explanation explain(const Dataset& data, const ExplainOptions& options, const std::string& folder);

/// Curves of the test and channels in which nominal model and records differ most.
void addCurves(const TwinRunner& runner, const std::vector<double>& before, const std::vector<double>& after,
               Explanation* explanation);

/// Writes FOLDER/gaps.png, revolution.png, spectra.png, ladder.png, remains.png with gnuplot; returns the
/// files' names.
/// @throws Error.
std::vector<std::string> drawPictures(const Explanation& explanation, const std::string& folder);

/// Writes FOLDER/report.html, which holds the pictures of the folder.
void writeHtml(const Explanation& explanation, const std::string& campaign,
               const std::vector<std::string>& pictures, const std::string& folder);

/// Writes FOLDER/report.json (smartmill-report/1).
void writeReport(const Explanation& explanation, const std::string& folder);

}  // namespace smartmill::discrepancy
