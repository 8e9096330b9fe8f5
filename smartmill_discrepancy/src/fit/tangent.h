#pragma once

namespace smartmill::discrepancy {

/// Share of a coordinate's step for numerical derivatives: curvature would distinguish effects from nominal
/// values with exactly the same response.
constexpr double TANGENT = 0.02;

}  // namespace smartmill::discrepancy
