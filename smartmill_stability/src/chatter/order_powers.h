#pragma once

namespace smartmill::stability {

/// [tooth passing frequencies] that distinguish the harmonics of teeth from those of the spindle.
inline constexpr int COMPARED_PASSINGS = 3;

/// Power of a vibration at the harmonics of the teeth and at the other harmonics of the spindle. Those of the
/// teeth are stronger in a cut; an idle spindle has all of them.
struct OrderPowers {
  double teeth = 0.0, others = 0.0;
};

/// @param power_of power at an order from 1 [1/revolution]
template <class PowerOf>
OrderPowers orderPowers(int teeth, const PowerOf& power_of) {
  OrderPowers powers;
  for (int order = 1; order <= COMPARED_PASSINGS * teeth; ++order)
    (order % teeth == 0 ? powers.teeth : powers.others) += power_of(order);
  return powers;
}

}  // namespace smartmill::stability
