#pragma once

namespace smartmill {

/// [s] Stamps of samples and states are rounded to nanoseconds; equal times must compare equal however a
/// stream is cut into blocks.
constexpr double SAME_TIME = 1e-6;

}  // namespace smartmill
