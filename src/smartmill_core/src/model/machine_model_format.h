#pragma once

namespace smartmill {

/// First key of a model file.
constexpr const char* MODEL_FORMAT = "smartmill-model/1";

/// Key of a mode's static gain in the file.
enum class ModeKind { stiffness, gain };

}  // namespace smartmill
