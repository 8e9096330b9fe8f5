#include "smartmill_core/math/sine_cosine.h"

#include <cmath>
#include <vector>

namespace smartmill {

const SineCosine* sineCosineTable() {
  static const std::vector<SineCosine> TABLE = [] {
    std::vector<SineCosine> table(REVOLUTION_NODES + 1);
    for (std::size_t n = 0; n <= REVOLUTION_NODES; ++n)
      table[n] = {std::sin(static_cast<double>(n) * REVOLUTION_NODE_ANGLE),
                  std::cos(static_cast<double>(n) * REVOLUTION_NODE_ANGLE)};
    return table;
  }();
  return TABLE.data();
}

}  // namespace smartmill
