#include "smartmill_ros/force_curve_message.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_ros/conversions.h"

namespace smartmill {
namespace {

ForceCurve curveOf(const std::vector<double>& chip, const std::vector<double>& value,
                   const std::vector<double>& std_dev, const char* field) {
  if (value.size() != chip.size() + 2 || std_dev.size() != chip.size())
    throw Error(std::string("force curve: ") + field + ": " + std::to_string(chip.size() + 2) +
                " coefficients and " + std::to_string(chip.size()) + " deviations are due");
  // NaN falls, too.
  const auto rises = [](double before, double after) { return after >= before; };
  for (std::size_t k = 1; k < value.size(); ++k) {
    if (!rises(value[k - 1], value[k]))
      throw Error(std::string("force curve: ") + field + ": the coefficients must not fall");
  }
  return {chip, value, std_dev};
}

}  // namespace

smartmill_msgs::ForceCurve toMsg(const FoundCurves& found) {
  smartmill_msgs::ForceCurve message;
  message.header.stamp = fromSec(found.stamp);
  message.tool = found.tool;
  message.material = found.material;
  message.teeth = static_cast<std::uint32_t>(found.teeth);
  message.cuts = found.cuts;
  message.chip = found.curves.tangential.knots;
  message.tangential = found.curves.tangential.value;
  message.radial = found.curves.radial.value;
  message.tangential_std = found.curves.tangential.std_dev;
  message.radial_std = found.curves.radial.std_dev;
  message.rms = found.curves.rms;
  message.scatter = found.curves.scatter;
  return message;
}

FoundCurves fromMsg(const smartmill_msgs::ForceCurve& message) {
  FoundCurves found;
  found.stamp = toSec(message.header.stamp);
  found.tool = message.tool;
  found.material = message.material;
  found.teeth = static_cast<int>(std::min<std::uint32_t>(message.teeth, 1000));
  found.cuts = message.cuts;
  if (message.chip.size() < 3 || message.chip.front() != 0.0 || !(message.chip.back() > 0.0))
    throw Error("force curve: chip: three breaks or more from 0 are due");
  found.curves.tangential = curveOf(message.chip, message.tangential, message.tangential_std, "tangential");
  found.curves.radial = curveOf(message.chip, message.radial, message.radial_std, "radial");
  found.curves.rms = message.rms;
  found.curves.scatter = message.scatter;
  return found;
}

}  // namespace smartmill
