#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/results/finding.h"
#include "smartmill_discrepancy/results/tried_effect.h"

namespace smartmill::discrepancy {

enum class Verdict { no_disagreement, explained, partly_explained, unknown_effect };

/// As in report.json.
const char* nameOf(Verdict verdict);

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
  /// [1] share of the held-out squares above the noise that it takes away
  double heldout_gap_reduction = 0.0;
  double confidence = 0.0;  ///< [1] that it shrinks the gap of tests it was not fitted to, against none and
                            ///< against its rivals (Standing)
  std::vector<std::pair<std::string, double>> alternatives;  ///< other effects in its place: name, delta_bic
};

/// An effect of the catalogue that comes nearest to what is left and does not hold.
struct Resemblance {
  std::string name, variant, reason;
  std::optional<double> confidence = {};  ///< as FoundEffect::confidence, where the tests were asked
};

/// Gap of one channel of one test before and after.
struct BlockGap {
  std::string test, channel;
  bool heldout = false;
  double before = 0.0, after = 0.0;
  double std_dev = 0.0;  ///< of a gap at the noise floor, by chance alone
};

/// One channel over all cuts: how much of it the models explain, and how much of it comes again with the
/// revolution.
struct ChannelShare {
  std::string channel;
  double explained_before = 0.0,
         explained_after = 0.0;             ///< [1] of the variance; below 0: worse than the mean
  std::optional<double> explained_heldout;  ///< [1] after, of the held-out cuts alone
  std::optional<double> repeats;            ///< [1] of the variance; unknown in short cuts
  double floor = 0.0;                       ///< [unit of the channel] RMS of what does not come again
  double floor_gap = 0.0;  ///< [1] the same over the noise: the gap of the best model of steady cuts
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

/// A cut that chatters, as it is predicted from one step to the next.
struct ChatteringCut {
  std::string test;
  double frequency = 0.0, amplitude = 0.0;  ///< [Hz], [N] of the chatter
  /// [1] RMS of what the prediction leaves over that of the channel about its mean, the largest of fx, fy,
  /// tool_x and tool_y
  double before = 0.0, after = 0.0;
};

struct GapPair {
  double fit = 0.0, heldout = 0.0;
};

/// What explain found (formats.md section 3).
struct Explanation {
  Verdict verdict = Verdict::no_disagreement;
  std::vector<Finding> where, unexplained;
  std::vector<FoundEffect> effects;
  std::vector<Resemblance> resembles;
  std::vector<std::vector<std::string>> not_separable;
  std::optional<std::string> suggested_test;
  std::optional<CampaignTest> suggested_cut;  ///< the same, for who makes it
  GapPair before, after;
  std::optional<GapPair> named_only;  ///< gap without the effects that have no name, where there are any
  std::string sentence;               ///< what a machinist should know; may be empty
  std::vector<BlockGap> gaps;
  std::vector<ChannelShare> channels;
  std::vector<TriedEffect> ladder;
  std::vector<std::string> notes;
  std::vector<ChatteringCut> chattering;  ///< that took part in the fit
  std::vector<RevolutionCurve> revolutions;
  std::vector<SpectrumCurve> spectra;
  MachineModel model;        ///< the improved one, as written
  bool interrupted = false;  ///< the search was ended from outside; this is what was found until then
  double seconds = 0.0;
};

}  // namespace smartmill::discrepancy
