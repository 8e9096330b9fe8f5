#pragma once

#include <string>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/modal/hit_check.h"
#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_core/modal/modal_estimate.h"
#include "smartmill_core/signal/frequency_response.h"

namespace smartmill::hammer {

/// Formats of files with hammer tests.
enum class TapFormat {
  automatic,  ///< detected from the content
  bag,        ///< a recorded session
  csv,        ///< name[unit] columns: time[s], hammer[N], acceleration[m/s2] or displacement[m]
  text,       ///< three columns without header: time [s], force [N], acceleration [m/s2]
  frf,        ///< three columns without header, or frf.csv: frequency [Hz], Re, Im of the receptance
  dynoware,   ///< Kistler DynoWare export: hammer and response among its channels
  uff,        ///< universal file, dataset 58: hits over time, or FRFs
  sound       ///< WAV, FLAC, AIFF: hammer and response among its channels
};

/// @throws Error naming the file when its format is unknown.
TapFormat detectFormat(const std::string& file);

/// Quantity of a response; it determines the unit of the FRF.
enum class ResponseKind { acceleration, velocity, displacement, force };

struct TapRecord {
  std::string file;
  Hit hit;  ///< response in m/s2, m/s, m or N
  ResponseKind kind = ResponseKind::displacement;
};

/// Channels of a DynoWare export or a sound file, or columns of a CSV; empty: chosen by name, unit and size.
struct ChannelNames {
  std::string force, response;
  std::string sound;  ///< of a sound file: NUMBER:NAME=SCALE,..., see soundChannels()
};

/// A measured FRF, converted to a receptance [m/N], or force over force [1].
struct NamedFrf {
  std::string name;
  FrequencyResponse frf;
};

/// Content of a file: hits, or FRFs.
struct TapFile {
  std::vector<TapRecord> taps;
  std::vector<NamedFrf> frfs;
};

/// @throws Error naming the file and the fault.
TapFile readTapFile(const std::string& file, TapFormat format, const ChannelNames& channels);
TapRecord readTapCsv(const std::string& file, const ChannelNames& channels = {});
TapRecord readTapText(const std::string& file);
/// A hit from a record's columns: hammer and, unless named otherwise, displacement, acceleration or the
/// largest force. @throws Error naming record.file and the missing column.
TapRecord tapOf(const Record& record, const ChannelNames& channels = {});
FrequencyResponse readFrfText(const std::string& file);

/// Whether a hit is averaged, and why not.
struct TapVerdict {
  std::string file, reason;
  bool accepted() const { return reason.empty(); }
};

struct TapFrfOptions {
  HitCheckOptions check;
  double exponential_time = 0.0;  ///< [s] window on both channels; 0: none
  FrfAverage average = FrfAverage::h1;
  /// [1] A record is truncated when its end exceeds this share of its beginning, which changes the gains by
  /// as much, and this multiple of the noise.
  double ringing_share = 0.02, clear_of_noise = 2.0;
  std::size_t lead_samples =
      8;  ///< kept before a hit begins, since the force rises before its onset is detected
};

/// Average of several hits of one point.
struct TapFrf {
  FrequencyResponse measured;    ///< of the measured response [m/s2/N], [m/s/N], [m/N] or [1]
  FrequencyResponse receptance;  ///< [m/N]; [1] of a force
  std::vector<TapVerdict> hits;  ///< one per record, in order
  /// [s] length of the records from the hit on, where the response has not decayed at their end: on lines
  /// k / length the truncated decay has the poles of the complete one. 0: it has decayed.
  double truncated_length = 0.0;
};

/// Corrects the gains of modes for truncated records: a record of length T contains the share 1 - exp(s T) of
/// a mode with pole s. The standard deviation of the pole enters that of the gain.
void correctTruncation(std::vector<EstimatedMode>& modes, double truncated_length);

/// The FRFs are empty if no hit is accepted. @throws Error when the records differ in length, rate or kind of
/// response.
TapFrf averageTaps(const std::vector<TapRecord>& taps, const TapFrfOptions& options);

}  // namespace smartmill::hammer
