#include "smartmill_core/math/sine_cosine.h"

#include <cmath>
#include <vector>

namespace smartmill {

const SineCosine* turnTable() {
  static const std::vector<SineCosine> TABLE = [] {
    std::vector<SineCosine> table(TURN_NODES + 1);
    for (std::size_t n = 0; n <= TURN_NODES; ++n)
      table[n] = {std::sin(static_cast<double>(n) * TURN_NODE_ANGLE),
                  std::cos(static_cast<double>(n) * TURN_NODE_ANGLE)};
    return table;
  }();
  return TABLE.data();
}

}  // namespace smartmill
