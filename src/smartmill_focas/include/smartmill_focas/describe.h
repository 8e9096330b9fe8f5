#pragma once

#include <string>

#include "smartmill_focas/codec.h"

namespace smartmill::focas {

/// A frame in one line for people: what is asked with its arguments, or what came back with its values.
std::string describe(const Frame& frame);

}  // namespace smartmill::focas
