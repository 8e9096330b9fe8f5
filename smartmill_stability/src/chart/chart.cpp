#include "smartmill_stability/chart/chart.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "chart/recommendation.h"
#include "chart/spindle_load.h"
#include "smartmill_core/error.h"
#include "smartmill_stability/solvers/model_system.h"

namespace smartmill::stability {

ChartMaker::ChartMaker(const ChartParameters& parameters, const MachineModel& model)
    : cut_{parameters, model.needTool("predict stability"), model.spindle.value_or(Spindle{}),
           processDamping(model), model.workpieceModes()} {
  ChartParameters& own = cut_.parameters;
  if (own.speed_high == 0.0 && cut_.spindle.max_speed) own.speed_high = *cut_.spindle.max_speed;
  own.validate();
  if (own.speed_high == 0.0) {
    throw Error("speed_high: 0 selects the highest spindle speed, which is missing in " + model.file +
                "; expected a value above speed_low");
  }
}

StabilityChart ChartMaker::chart() const {
  const ChartSolver given = machine_.solver(cut_);
  const SpindleLoad load(cut_, machine_.coefficients());
  StabilityChart chart;
  chart.stamp = machine_.stamp();
  chart.tool = machine_.tool();
  chart.material = machine_.coefficients().material;
  chart.entry = cut_.parameters.entry;
  chart.exit = cut_.parameters.exit;
  chart.feed_per_tooth = cut_.parameters.feed_per_tooth;
  const StabilityLimit wide = given.limits(Recommendation::wideSpeeds(cut_.parameters));
  const auto inner = [extra = Recommendation::extraSpeeds(cut_.parameters)](const std::vector<double>& all) {
    return std::vector<double>(all.begin() + extra, all.end() - extra);
  };
  chart.limit = {inner(wide.spindle_speed), inner(wide.depth), inner(wide.chatter_frequency)};
  chart.method = nameOf(given.method);
  chart.absolute_depth_limit = given.absoluteDepthLimit(chart.limit);
  for (const double speed : chart.limit.spindle_speed) {
    const auto [torque, power] = load.limits(speed);
    chart.torque_depth_limit.push_back(torque);
    chart.power_depth_limit.push_back(power);
  }
  Recommendation(cut_, machine_, wide).addTo(chart);
  return chart;
}

std::string ChartMaker::solver() const {
  const bool exact = machine_.byCollocation(cut_.parameters);
  const std::string reason = machine_.fallbackReason(cut_.parameters);
  return nameOf(exact ? Method::collocation : Method::zero_order) +
         (reason.empty() ? "" : " (" + reason + ")");
}

Prediction ChartMaker::predict(double spindle_speed, double axial_depth) const {
  if (!(spindle_speed > 0.0) || !std::isfinite(spindle_speed)) {
    throw Error("spindle_speed: " + std::to_string(spindle_speed) + " rad/s: expected a value above 0");
  }
  if (!(axial_depth > 0.0) || !std::isfinite(axial_depth)) {
    throw Error("axial_depth: " + std::to_string(axial_depth) + " m: expected a value above 0");
  }
  const ChartSolver given = machine_.solver(cut_);
  const StabilityLimit limit = given.limits({spindle_speed});
  const SpindleLoad load(cut_, machine_.coefficients());
  const auto [torque, power] = load.limits(spindle_speed);
  Prediction prediction;
  prediction.point = load.point(spindle_speed, axial_depth, limit.depth[0], limit.chatter_frequency[0]);
  prediction.stable = axial_depth < limit.depth[0];
  prediction.within_spindle_limits = axial_depth <= std::min(torque, power) &&
                                     (!cut_.spindle.max_speed || spindle_speed <= *cut_.spindle.max_speed);
  return prediction;
}

}  // namespace smartmill::stability
