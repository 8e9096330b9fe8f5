#pragma once

namespace smartmill::hammer {

/// Direct receptance at the tip over that of a hit `offset` [m] above it, for a tool of stick-out L [m]
/// (Dunwoody eq. 4.44): 2 L^3 / (l^2 (3 L - l)), l = L - offset. @throws Error unless 0 <= offset < L.
double offsetFactor(double stickout, double offset);

}  // namespace smartmill::hammer
