#pragma once

#include <string>

namespace smartmill::recording {

/// The last part of a name (fx of s.fx and of forces/fx) in lower case, letters and digits only.
std::string plainName(const std::string& name);

/// The last part of a name as it is.
std::string lastPart(const std::string& name);

/// Without blanks and tabs at its ends.
std::string trimmed(const std::string& text);

}  // namespace smartmill::recording
