#pragma once

#include <string>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/io/sound_file.h"

namespace smartmill {

/// Channels of a sound file as a record: names as in formats.md, scaled to SI units. @throws Error naming the
/// file: a missing channel, a name that is not a column of a record, a repeated name.
Record readSoundRecord(const std::string& file, const std::vector<SoundChannel>& channels);

}  // namespace smartmill
