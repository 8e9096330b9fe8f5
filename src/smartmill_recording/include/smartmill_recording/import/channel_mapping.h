#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_recording/import/channel_file.h"

namespace smartmill::recording {

/// What is stated of the channel that becomes a column of a record.
struct ChannelChoice {
  std::optional<std::string> name;  ///< in the file; absent: found by name
  std::optional<std::string> unit;  ///< instead of the file's
  std::optional<double> scale;  ///< factor behind the conversion to SI; of V, mV and full scale: SI unit of
                                ///< the column per volt or per full scale
};

/// Columns of formats.md, and `time`.
using ChannelChoices = std::map<std::string, ChannelChoice>;

/// "fx=Fx[N],fy=Fy[V]*200,time=t[s]": COLUMN=NAME[UNIT]*SCALE, each of the three may be left out. @throws
/// Error
/// "--channels: ..." naming the part that is wrong.
ChannelChoices channelChoices(const std::string& text);

/// @throws Error "PLACE: what" for a name that is not a column or a scale that is 0 or not finite.
void checkChoice(const std::string& place, const std::string& column, const ChannelChoice& choice);

struct MappedRecord {
  Record record;                    ///< SI; time begins at 0
  double sample_rate = 0.0;         ///< [Hz]
  std::vector<std::string> report;  ///< which channel became which column, with which unit and factor
  std::vector<std::string> faults;  ///< what is missing or wrong, one line each, without the file's name
};

/// Channels of a file as columns of a record. A column takes the channel that is stated for it; without one,
/// a channel whose name and unit leave no doubt (fx in a unit of force). Nothing is guessed: no unit, two
/// candidates or an unknown unit make a fault.
/// @param kind that decides which columns are needed: a force of a cut or air cut; hammer and response of a
/// tap
/// @param sample_rate [Hz] that the user states
MappedRecord mapChannels(const ChannelFile& file, const ChannelChoices& choices, std::optional<TestKind> kind,
                         std::optional<double> sample_rate);

}  // namespace smartmill::recording
