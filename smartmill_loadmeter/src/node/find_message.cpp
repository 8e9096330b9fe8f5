#include "node/find_message.h"

#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::loadmeter {

smartmill_msgs::FindCoefficients::Response toMsg(const FoundCoefficients& found) {
  using Response = smartmill_msgs::FindCoefficients::Response;
  Response response;
  CoefficientSet set;
  set.value = set.std_dev = NOT_IDENTIFIED;
  if (found.known) set = found.known->combined.set;
  if (found.predicted) set = *found.predicted;
  response.code = found.known || found.predicted ? Response::OK : Response::NOT_FOUND;
  response.message = found.message;
  response.coefficients = toMsg(set);
  const CoefficientKnowledge known = found.known.value_or(CoefficientKnowledge());
  response.of_pair = found.known.has_value();
  response.ktc_kte_covariance = known.combined.covariance[CoefficientRecord::covarianceIndex(0, 3)];
  response.identifications = static_cast<std::uint32_t>(known.identifications);
  response.production_cuts = static_cast<std::uint32_t>(known.production_cuts);
  response.superseded = static_cast<std::uint32_t>(known.superseded);
  const auto fill = [](const CoveredRange& range, auto& message) {
    message[0] = range.low;
    message[1] = range.high;
  };
  fill(known.cutting_speed, response.cutting_speed);
  fill(known.feed_per_tooth, response.feed_per_tooth);
  fill(known.axial_depth, response.axial_depth);
  fill(known.edge_age, response.edge_age);
  response.needed.assign(found.needed.begin(), found.needed.end());
  response.next_test = toMsg(found.next_condition);
  response.next_std[0] = found.next ? found.next->ktc_std : NOT_A_NUMBER;
  response.next_std[1] = found.next ? found.next->kte_std : NOT_A_NUMBER;
  return response;
}

CutChoiceRequest choiceOf(const smartmill_msgs::FindCoefficients::Request& request,
                          std::vector<CuttingCondition> tests) {
  CutChoiceRequest choice;
  choice.made = std::move(tests);
  const std::size_t n = request.candidates.size();
  if (request.cutting_time.size() != n || request.stock.size() != n || request.depth_limit.size() != n)
    throw Error(
        formatted("candidates: %zu cuts, %zu cutting_time, %zu stock, %zu depth_limit, expected equal "
                  "numbers",
                  n, request.cutting_time.size(), request.stock.size(), request.depth_limit.size()));
  for (std::size_t i = 0; i < n; ++i) {
    if (!(request.cutting_time[i] > 0.0))
      throw Error(formatted("cutting_time: %g s of candidate %zu, expected > 0", request.cutting_time[i], i));
    choice.candidates.push_back(
        {fromMsg(request.candidates[i]), request.cutting_time[i], request.stock[i], request.depth_limit[i]});
  }
  choice.ktc_std = request.target_std[0];
  choice.kte_std = request.target_std[1];
  choice.stock = request.stock_available;
  choice.without_stored = request.without_stored != 0;
  return choice;
}

void fill(const CutChoice& choice, smartmill_msgs::FindCoefficients::Response* response) {
  for (const ChosenCut& cut : choice.cuts) {
    response->chosen.push_back(static_cast<std::uint32_t>(cut.candidate));
    response->chosen_gain.push_back(cut.gain_per_second);
    response->chosen_ktc_std.push_back(cut.ktc_std);
    response->chosen_kte_std.push_back(cut.kte_std);
  }
  response->target_reached = choice.reached;
  response->excluded = choice.excluded;
}

}  // namespace smartmill::loadmeter
