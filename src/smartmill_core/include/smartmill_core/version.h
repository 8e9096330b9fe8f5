#pragma once

namespace smartmill {

/// The version of all packages, as in package.xml of smartmill_core.
const char* version();

}  // namespace smartmill
