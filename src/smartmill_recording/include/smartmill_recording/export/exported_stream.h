#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace smartmill::recording {

/// One column of a stream.
struct ExportedColumn {
  std::string name, unit;
  std::vector<double> values;
};

/// Samples of one topic of a recording, or one record of a campaign. Where samples were lost, the times of
/// the first column jump; nothing is filled in.
struct ExportedStream {
  std::string name;                     ///< topic relative to /smartmill, or name of the test
  double sample_rate = 0.0;             ///< [Hz] stated; 0: not evenly sampled
  double start = 0.0;                   ///< [s] since 1970, of time 0; 0 for a campaign
  std::vector<ExportedColumn> columns;  ///< the first is time [s]

  std::size_t size() const { return columns.empty() ? 0 : columns.front().values.size(); }
};

/// What of a recording or campaign is exported.
struct ExportSelection {
  std::vector<std::string> names;  ///< topics relative to /smartmill, or names of tests; empty: all
  double from = 0.0;               ///< [s] since the first sample
  double to = std::numeric_limits<double>::infinity();  ///< [s]
};

/// Streams of sampled topics (sample blocks, forces, spindle angle, load, positions) of a recording.
/// @param progress share done, 0..1
/// @throws Error naming the file: damaged, a selected topic is missing (with those present), nothing sampled,
/// more than MOST_VALUES values.
std::vector<ExportedStream> streamsOfRecording(const std::string& file, const ExportSelection& selection,
                                               const std::function<void(double)>& progress = {});
/// Records of a campaign's folder, columns in SI. @throws Error as above.
std::vector<ExportedStream> streamsOfCampaign(const std::string& folder, const ExportSelection& selection);

/// A struct for each stream (/ becomes _) with its columns, text FIELD_unit, sample_rate_hz, start. Version
/// 5, compressed. @throws Error "FILE: what".
void writeMatFile(const std::vector<ExportedStream>& streams, const std::string& file);
/// A group for each stream, a dataset for each column with attribute unit; attributes sample_rate_hz, start
/// of the group. @throws Error "FILE: what".
void writeHdf5File(const std::vector<ExportedStream>& streams, const std::string& file);
/// Functions over time of dataset 58b (binary). @throws Error "FILE: what".
void writeUffFile(const std::vector<ExportedStream>& streams, const std::string& file);
/// FOLDER/NAME.csv, columns name[unit]. @throws Error "FILE: what".
void writeCsvFolder(const std::vector<ExportedStream>& streams, const std::string& folder);

}  // namespace smartmill::recording
