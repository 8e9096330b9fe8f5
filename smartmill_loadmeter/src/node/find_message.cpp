#include "node/find_message.h"

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

}  // namespace smartmill::loadmeter
