#pragma once

namespace smartmill {
namespace hammer {

/// Receptance factor of Dunwoody eq. 4.44: direct FRF at the tip from a hit offset [m] above it, tool of
/// stickout L [m]: 2 L^3 / (l^2 (3 L - l)), l = L - offset. @throws Error when 0 <= offset < L does not hold.
double offsetFactor(double stickout, double offset);

}  // namespace hammer
}  // namespace smartmill
