#pragma once

#include <vector>

#include "smartmill_core/model/effect_catalogue.h"

namespace smartmill::effects {

/// The declaration of every file of src/effects/, in the order of the files' names.
std::vector<EffectKind> fromFiles();

}  // namespace smartmill::effects
