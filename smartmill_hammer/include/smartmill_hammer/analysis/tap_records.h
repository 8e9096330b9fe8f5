#pragma once

#include <string>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/modal/hit_check.h"
#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_core/modal/modal_estimate.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill {
namespace hammer {

/// Files that hold hammer tests.
enum class TapFormat {
  automatic,  ///< told by content
  bag,        ///< a recorded session
  csv,        ///< name[unit] columns: time[s], hammer[N], acceleration[m/s2] or displacement[m]
  text,       ///< three columns without header: time [s], force [N], acceleration [m/s2]
  frf,        ///< three columns without header, or frf.csv: frequency [Hz], Re, Im of the receptance
  dynoware,   ///< Kistler DynoWare export: hammer and response among its channels
  uff,        ///< universal file, dataset 58: hits over time, or FRFs
  sound       ///< WAV, FLAC, AIFF: hammer and response among its channels
};

/// @throws Error naming the file when it is none of these.
TapFormat detectFormat(const std::string& file);

/// What a response is, and so the unit of the FRF.
enum class ResponseKind { acceleration, velocity, displacement, force };

struct TapRecord {
  std::string file;
  Hit hit;  ///< response in m/s2, m/s, m or N
  ResponseKind kind = ResponseKind::displacement;
};

/// Channels of a DynoWare export or a sound file, or columns of a CSV; empty: told by name, unit and size.
struct ChannelNames {
  std::string force, response;
  std::string sound;  ///< of a sound file: NUMBER:NAME=SCALE,..., see soundChannels()
};

/// A measured FRF as a file holds it, made a receptance where it is none [m/N], or force over force [1].
struct NamedFrf {
  std::string name;
  FrequencyResponse frf;
};

/// What one file holds: hits, or FRFs.
struct TapFile {
  std::vector<TapRecord> taps;
  std::vector<NamedFrf> frfs;
};

/// @throws Error naming file and what is missing or wrong.
TapFile readTapFile(const std::string& file, TapFormat format, const ChannelNames& channels);
TapRecord readTapCsv(const std::string& file, const ChannelNames& channels = {});
TapRecord readTapText(const std::string& file);
/// A hit of a record's columns: hammer and, unless the names say otherwise, displacement, acceleration or the
/// largest force. @throws Error naming record.file and the missing column.
TapRecord tapOf(const Record& record, const ChannelNames& channels = {});
FrequencyResponse readFrfText(const std::string& file);

/// Whether a hit takes part, and why not.
struct TapVerdict {
  std::string file, reason;
  bool accepted() const { return reason.empty(); }
};

struct TapFrfOptions {
  HitCheckOptions judge;
  double exponential_time = 0.0;  ///< [s] window on both channels; 0: none
  FrfAverage average = FrfAverage::h1;
};

/// Average of several hits of one point.
struct TapFrf {
  FrequencyResponse measured;    ///< of the response as measured [m/s2/N], [m/s/N], [m/N] or [1]
  FrequencyResponse receptance;  ///< [m/N]; [1] of a force
  std::vector<TapVerdict> hits;  ///< one a record, in order
  /// [s] where the response rings on at the records' end: their length, which begins with the blow; at lines
  /// k / length the cut decay has the poles of the whole one. 0: it has died away.
  double ringing_length = 0.0;
};

/// Gains of modes found in an average that rings on, as they are without the cut: a record of length T holds
/// of a mode with pole s the share 1 - exp(s T). Their deviations hold what the pole's do to that share.
void removeCut(std::vector<EstimatedMode>& modes, double ringing_length);

/// Without a hit left the FRFs are empty. @throws Error when the records differ in length, rate or kind of
/// response.
TapFrf averageTaps(const std::vector<TapRecord>& taps, const TapFrfOptions& options);

}  // namespace hammer
}  // namespace smartmill
