#pragma once

#include <string>

#include "smartmill_core/names.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_stability/chatter/sound_listener.h"

namespace smartmill::stability {

/// Parameters of sound_node.
struct SoundNodeParameters {
  std::string input = names::SOUND;
  SoundParameters sound;
  double input_timeout = 1.0;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of sound_node (package smartmill_stability): spindle speeds against chatter from the "
        "sound of the cuts.");
    table.section("Microphone.");
    table.text("input", input, "topic of its sample blocks");
    sound.declare(table);
    table.number("input_timeout", input_timeout, "s", Range::positive(),
                 "time without samples after which there is no sound");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    sound.validate();
  }
};

}  // namespace smartmill::stability
