#include "smartmill_stability/learning/machine_prior.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr std::size_t PER_MODE = 3;  // coordinates: frequency, damping, stiffness
constexpr double LARGEST_DAMPING = 0.3;

void validateQuantity(const char* name, const LogNormal& quantity) {
  require(name, quantity.median, Range::positive());
  require(name, quantity.log_std, Range::closed(0.0, 3.0));
}

LogNormal known(double value, double std_dev, double percent) {
  const double share = std::isfinite(std_dev) ? std::abs(std_dev / value) : 0.01 * percent;
  return {value, std::sqrt(std::log1p(share * share))};
}

const LogNormal WIDE_KT{1.2e9, 0.45}, WIDE_RATIO{0.35, 0.4};

}  // namespace

double LogNormal::at(double normal) const {
  return median * std::exp(log_std * normal);
}

MachinePrior MachinePrior::wide(const RegenerativeSystem& cut) {
  MachinePrior prior;
  prior.cut = cut;
  const ModePrior first{{1200.0, 0.65}, {0.03, 0.45}, {2e7, 0.8}, -1};
  const ModePrior second{{1.8, 0.4}, {0.03, 0.45}, {2.0, 0.8}, 0};
  prior.modes = {{{first, second}, {first, second}}};
  prior.alike_frequency = 0.99;
  prior.alike_damping = 0.7;
  prior.alike_stiffness = 0.93;
  prior.kt = WIDE_KT;
  prior.radial_ratio = WIDE_RATIO;
  return prior;
}

MachinePrior MachinePrior::about(const MachineModel& model, const RegenerativeSystem& cut) {
  MachinePrior prior;
  prior.cut = cut;
  const Uncertainty& u = model.uncertainty;
  const std::array<const ModalModel*, 2> axes{{&model.tool_tip.x, &model.tool_tip.y}};
  for (std::size_t axis = 0; axis < 2; ++axis)
    for (const Mode& mode : axes[axis]->modes) {
      if (!(mode.gain > 0.0)) continue;
      const LogNormal compliance = known(mode.gain, mode.gain_std, u.stiffness);
      prior.modes[axis].push_back({known(mode.frequency, mode.frequency_std, u.frequency),
                                   known(mode.damping_ratio, mode.damping_ratio_std, u.damping),
                                   {1.0 / compliance.median, compliance.log_std},
                                   -1});
    }
  if (prior.modes[0].empty() || prior.modes[1].empty())
    throw Error(model.file + ": tool_tip: expected modes of x and y to start from");
  prior.kt = WIDE_KT;
  prior.radial_ratio = WIDE_RATIO;
  if (model.cutting) {
    const CuttingCoefficients& value = *model.cutting;
    const double none = std::nan("");
    const double kt_std = model.cutting_std ? model.cutting_std->ktc : none,
                 kr_std = model.cutting_std ? model.cutting_std->krc : none;
    if (value.ktc > 0.0) prior.kt = known(value.ktc, kt_std, u.cutting);
    if (value.ktc > 0.0 && value.krc > 0.0) {
      prior.radial_ratio = known(value.krc, kr_std, u.cutting);
      prior.radial_ratio.median /= value.ktc;
    }
  }
  return prior;
}

std::size_t MachinePrior::coordinates() const {
  return PER_MODE * (modes[0].size() + modes[1].size()) + 2;
}

RegenerativeSystem MachinePrior::machine(const std::vector<double>& at) const {
  RegenerativeSystem machine = cut;
  machine.modes.clear();
  machine.response.reset();
  const bool alike = modes[0].size() == modes[1].size();
  const std::array<double, PER_MODE> likeness{{alike_frequency, alike_damping, alike_stiffness}};
  std::size_t next = 0;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    std::vector<std::array<double, 2>> values;  // frequency, stiffness
    for (std::size_t k = 0; k < modes[axis].size(); ++k) {
      std::array<double, PER_MODE> z{};
      for (std::size_t i = 0; i < PER_MODE; ++i, ++next) {
        z[i] = at[next];
        if (axis == 1 && alike) {
          const double in_x = at[next - PER_MODE * modes[0].size()], share = likeness[i];
          z[i] = share * in_x + std::sqrt(1.0 - share * share) * at[next];
        }
      }
      const ModePrior& prior = modes[axis][k];
      SystemMode mode;
      mode.frequency = prior.frequency.at(z[0]);
      mode.damping_ratio = std::min(LARGEST_DAMPING, prior.damping.at(z[1]));
      double stiffness = prior.stiffness.at(z[2]);
      if (prior.relative_to >= 0) {
        const auto& base = values[static_cast<std::size_t>(prior.relative_to)];
        mode.frequency *= base[0];
        stiffness *= base[1];
      }
      values.push_back({{mode.frequency, stiffness}});
      mode.input[axis] = mode.output[axis] = units::TWO_PI * mode.frequency / std::sqrt(stiffness);
      machine.modes.push_back(mode);
    }
  }
  machine.kt = kt.at(at[next]);
  machine.kr = machine.kt * radial_ratio.at(at[next + 1]);
  return machine;
}

void MachinePrior::validate() const {
  if (modes[0].empty() && modes[1].empty()) throw Error("prior: expected at least one mode");
  for (const auto& axis : modes)
    for (std::size_t k = 0; k < axis.size(); ++k) {
      validateQuantity("prior: natural frequency", axis[k].frequency);
      validateQuantity("prior: damping ratio", axis[k].damping);
      validateQuantity("prior: stiffness", axis[k].stiffness);
      if (axis[k].relative_to >= static_cast<int>(k))
        throw Error("prior: a mode is relative to one that does not precede it");
    }
  for (const double share : {alike_frequency, alike_damping, alike_stiffness})
    require("prior: correlation of x and y", share, Range::closed(0.0, 1.0));
  validateQuantity("prior: tangential coefficient", kt);
  validateQuantity("prior: radial over tangential coefficient", radial_ratio);
  std::vector<double> middle(coordinates(), 0.0);
  machine(middle).validate();
}

}  // namespace smartmill::stability
