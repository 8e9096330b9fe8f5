#pragma once

#include "search/search_state.h"

namespace smartmill::discrepancy {

/// Makes the best fit of a round the current fit: refits everything until a pass gains less than an effect
/// must; a remaining gain would imitate another effect. Separately found pieces of one effect are merged into
/// one member.
void adopt(SearchState& state, FitResult best);

}  // namespace smartmill::discrepancy
