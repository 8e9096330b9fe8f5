#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace smartmill::recording {

/// One channel of a measurement file, as in the file.
struct FileChannel {
  std::string name;  ///< s.fx of a MATLAB struct, group/fx in HDF5, data:2 of a matrix, 2 without a header
  std::string unit;  ///< as in the file; empty: not stated
  std::vector<double> values;  ///< in that unit
};

/// Channels of one measurement file.
struct ChannelFile {
  std::string file;
  std::string kind;  ///< for people: "MATLAB 5", "HDF5", "text", ...
  std::vector<FileChannel> channels;
  std::map<std::string, double> numbers;     ///< single numbers by name
  std::map<std::string, std::string> words;  ///< texts by name
  std::optional<double> sample_rate;         ///< [Hz] that the file states
  std::string sample_rate_from;              ///< its name there
  std::vector<std::string> notes;            ///< contents that are not read, one line each

  const FileChannel* find(const std::string& name) const;
};

/// Values that one file may hold; a file that claims more is refused.
constexpr double MOST_VALUES = 2e8;

enum class FileKind { text, mat, hdf5, sound, uff, bag, mcap, campaign };

/// By content, of a folder by its campaign.yaml. @throws Error "FILE: what": unreadable, empty, TDMS, binary
/// data of no known kind.
FileKind fileKind(const std::string& path);

/// MATLAB (5, 7, 7.3), HDF5, WAV/FLAC, UFF58, DynoWare and other text files.
/// MATLAB and HDF5 files are read in a process of their own, since their libraries can crash on a damaged
/// file.
/// @throws Error of one line "FILE: what".
ChannelFile readChannelFile(const std::string& file);

/// Vectors and matrices of a MATLAB file, of structs one level deep; v7.3 too (libmatio). The unit of a
/// variable fx is the text variable fx_unit or fx_units, or the field fx of a struct units. @throws Error.
ChannelFile readMatFile(const std::string& file);

/// Numeric datasets of rank 1 and 2 in all groups; attributes unit or units, sample_rate, sample_rate_hz or
/// dt of the dataset, of the groups above it or of the root. @throws Error.
ChannelFile readHdf5File(const std::string& file);

/// Columns of numbers in a text file: separated by comma, semicolon, tab or blanks, decimal point or comma,
/// below any preamble. The row above the numbers holds the names with units in brackets, or the units below a
/// row of names; without such a row the channels are named 1, 2, .... @throws Error naming file and line.
ChannelFile readTextTable(const std::string& file);

/// Channels 1, 2, ... in shares of full scale. @throws Error.
ChannelFile readSoundChannels(const std::string& file);

/// Functions over time in dataset 58, named by kind of data and direction. @throws Error.
ChannelFile readUffChannels(const std::string& file);

/// Takes the rate from a single number of that name, where it is one: fs, sample_rate_hz, dt and so on.
void takeSampleRate(ChannelFile& file);

/// Moves a unit out of a channel's name: "Fx [N]", "Fx (N)", "Fx / N" and "Fx_N".
void takeUnit(FileChannel& channel);

}  // namespace smartmill::recording
