#include "smartmill_core/version.h"

namespace smartmill {

const char* version() {
  return SMARTMILL_VERSION;
}

}  // namespace smartmill
