#pragma once

#include <functional>
#include <string>
#include <vector>

#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

/// Three significant digits without exponent.
std::string shortText(double value);

/// A value with its 95 % interval, to the digits that the interval determines: "21.42 +- 0.12" with a
/// plus-minus sign in HTML.
std::string intervalText(double value, double std_dev);

/// Name and unit of a channel in pictures and tables: fx is "force x" in N, the load meter is in mV, a
/// displacement in um.
struct ChannelWords {
  std::string title, unit;
  double scale = 1.0;  ///< [unit / SI unit]

  std::string text(double value) const { return shortText(scale * value) + " " + unit; }  ///< @param value SI
};
ChannelWords channelWords(const std::string& channel);

/// The cause in words: title of the effect in the catalogue.
std::string causeTitle(const std::string& effect);

/// An effect with the effects that the records do not distinguish from it: "tool axis off centre or teeth of
/// unequal radius".
std::string causeWithRivals(const Explanation& explanation, const std::string& effect);

/// [1] Difference of measurement and simulation over the noise, of the chosen cells together.
double differenceOf(const std::vector<TestGap>& cells, bool corrected,
                    const std::function<bool(const TestGap&)>& chosen);

/// Whether the corrected model is worse in this cell by more than the noise.
bool gotWorse(const TestGap& cell);

/// The verdict in one paragraph: causes, difference before and after, and whether the search was complete.
std::string verdictText(const Explanation& explanation);

/// "All 31 causes that these tests can show were checked." or how many were not.
std::string searchText(const Explanation& explanation);

}  // namespace smartmill::discrepancy
