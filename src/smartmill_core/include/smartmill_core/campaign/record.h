#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"

namespace smartmill {

/// One measured record: named columns over time. Column names as in formats.md without the unit; values as in
/// the file (tool_x, tool_y in um there become m here).
struct Record {
  std::vector<std::string> names;  ///< without time; e.g. spindle_angle fx fy fz load_meter hammer tool_x
  std::vector<std::vector<double>> columns;  ///< SI; columns[c][i]
  std::vector<double> time;                  ///< [s]

  std::size_t size() const { return time.size(); }
  bool has(const std::string& name) const;
  /// @throws Error "FILE: column NAME is missing".
  const std::vector<double>& column(const std::string& name) const;
  std::vector<double>& add(const std::string& name);
  std::string file;                ///< for messages
  std::vector<std::string> notes;  ///< columns not read, one line each
};

/// Reads a test's record in the campaign's folder, smartmill CSV or Kistler DynoWare export. Columns in any
/// order.
/// @throws Error naming file, line and column: missing column, wrong unit, NaN or text instead of a number,
/// uneven time, no samples.
Record readRecord(const Campaign& campaign, const CampaignTest& test);
/// The same, with the sign of the forces reversed where the model states that its sensor measures the
/// reaction on the workpiece.
Record readRecord(const Campaign& campaign, const CampaignTest& test, const MachineModel& model);
/// A record of a cut in axes whose x is along its feed: fx, fy and spindle_angle, where it has them.
Record inFeedAxes(Record record, const CampaignTest& test);
Record readCsv(const std::string& file);
Record readDynoware(const std::string& file, const std::map<std::string, std::string>& channels);

/// Writes name[unit] columns of formats.md; time with nine significant digits. @param digits significant
/// digits of the other columns, at most 9. @throws Error.
void writeCsv(const Record& record, const std::string& file, int digits = 6);

}  // namespace smartmill
