#pragma once

#include "smartmill_core/command.h"

namespace smartmill::exchange {

smartmill::Command itemsCommand();

}  // namespace smartmill::exchange
