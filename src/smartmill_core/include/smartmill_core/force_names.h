#pragma once

namespace smartmill::names {

/// Force of each cut by all that was measured of it; as names.h.
constexpr const char* FORCE_ESTIMATE = "force/estimate";

}  // namespace smartmill::names
