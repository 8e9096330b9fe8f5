#pragma once

#include <string>
#include <vector>

#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

/// What sizes in the words of a shop need of a campaign.
struct ShopConditions {
  double highest_speed = 0.0;  ///< [rad/s] of its tests
  double cutting_time = 0.0;   ///< [s] of the edge at the end of the last cut; 0: not stated
};
ShopConditions conditionsOf(const std::vector<ReportedTest>& tests);

/// A size as a shop measures it.
struct ShopQuantity {
  std::string name;
  double value = 0.0, std_dev = 0.0;  ///< [unit]
  std::string unit;                   ///< "1" without one
  double modulo = 0.0;                ///< as in FoundParameter
};

/// Sizes of an effect: what can be measured or felt on the machine first, e.g. the reading of a dial
/// indicator (twice the offset of a tool axis), then the values of its keys in words.
std::vector<ShopQuantity> shopQuantities(const std::string& effect,
                                         const std::vector<FoundParameter>& parameters,
                                         const ShopConditions& conditions);

}  // namespace smartmill::discrepancy
