#pragma once

namespace smartmill::discrepancy {

/// Share of a coordinate's step in which tangents are taken: one that is a little curved would tell effects
/// apart from nominal values that do exactly the same.
constexpr double TANGENT = 0.02;

}  // namespace smartmill::discrepancy
