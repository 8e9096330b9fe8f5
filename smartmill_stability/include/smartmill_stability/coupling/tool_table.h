#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_stability/coupling/spindle.h"
#include "smartmill_stability/coupling/tool_assembly.h"

namespace smartmill::stability {

/// Files of the FRFs of the gauge in one direction.
struct GaugeFiles {
  std::string direct, cross, second;  ///< second may be empty
};

/// One tool of the table with the FRF files of its taps, if any.
struct TableTool {
  ToolDescription tool;
  ToolGeometry geometry;           ///< of its teeth and edges
  std::string tapped_x, tapped_y;  ///< empty: not tapped in that direction
};

/// smartmill-tools/1: a spindle with its gauge and holder, and tools (docs/formats.md). File names are
/// relative to the folder of the table.
struct ToolTable {
  std::string file;
  double low = 0.0, high = 0.0;  ///< [Hz] band
  Gauge gauge;
  GaugeFiles x;
  std::optional<GaugeFiles> y;  ///< absent: as x
  std::vector<BeamSegment> holder;
  std::vector<TableTool> tools;

  /// @throws Error naming the known tools.
  const TableTool& tool(const std::string& name) const;
};

/// @throws Error of one line that names the file, the key and the value.
ToolTable readToolTable(const std::string& file);

/// A receptance [m/N] from a CSV file with the columns frequency_hz, real, imag (as `frf` writes), or from a
/// universal file with one FRF; an accelerance is divided by -(2 pi f)^2. @throws Error naming the file.
FrequencyResponse readReceptance(const std::string& file);

/// A machine in one direction: spindle, holder and the contact that the tapped tools of the table determine.
struct TableAssembly {
  ToolAssembly assembly;
  ContactEstimate contact;  ///< of the tapped tools; the prior without one
  std::vector<TappedTool> tapped;

  /// The contact of a tool: its own if it was tapped, else that of the others with the scatter from tool to
  /// tool.
  ContactEstimate contactOf(const std::string& tool, double scatter) const;
};

/// @param along_y direction y, else x
TableAssembly assemblyOf(const ToolTable& table, bool along_y, const AssemblyOptions& options = {});

}  // namespace smartmill::stability
