#pragma once

#include <string>

#include "smartmill_focas/codec.h"

namespace smartmill::focas {

/// A frame as one line of text: request with arguments, or reply with values.
std::string describe(const Frame& frame);

}  // namespace smartmill::focas
