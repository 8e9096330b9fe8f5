#include "smartmill_stability/coupling/tool_table.h"

#include <algorithm>
#include <filesystem>

#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/io/uff.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

std::string besides(const std::string& table, const std::string& file) {
  return (std::filesystem::path(table).parent_path() / file).string();
}

BeamSegment segmentOf(const StrictYaml& yaml) {
  BeamSegment segment;
  segment.length = yaml.number("length_mm", Range::positive()) * units::MM;
  segment.diameter = yaml.number("diameter_mm", Range::positive()) * units::MM;
  segment.bore = yaml.optionalNumber("bore_mm", Range::notNegative()).value_or(0.0) * units::MM;
  segment.material = beamMaterial(yaml.has("material") ? yaml.word("material") : "steel");
  if (yaml.has("core")) segment.core = beamMaterial(yaml.word("core"));
  if (segment.bore >= segment.diameter) yaml.fail("bore_mm", "expected less than diameter_mm");
  return segment;
}

std::vector<BeamSegment> segmentsOf(const StrictYaml& yaml, const std::string& key) {
  std::vector<BeamSegment> segments;
  for (const StrictYaml& entry : yaml.maps(key)) segments.push_back(segmentOf(entry));
  return segments;
}

GaugeFiles filesOf(const StrictYaml& yaml, const std::string& table) {
  GaugeFiles files{besides(table, yaml.word("direct")), besides(table, yaml.word("cross")), ""};
  if (yaml.has("second")) files.second = besides(table, yaml.word("second"));
  return files;
}

TableTool toolOf(const StrictYaml& yaml, const std::string& table) {
  TableTool entry;
  ToolDescription& tool = entry.tool;
  tool.name = yaml.word("name");
  tool.stickout = yaml.number("stickout_mm", Range::positive()) * units::MM;
  tool.diameter = yaml.number("diameter_mm", Range::positive()) * units::MM;
  tool.fluted_length = yaml.number("fluted_length_mm", Range::notNegative()) * units::MM;
  tool.teeth = yaml.integer("teeth", 1, 20);
  entry.geometry.teeth = tool.teeth;
  entry.geometry.diameter = tool.diameter;
  readEdges(yaml, entry.geometry);
  tool.helix = entry.geometry.helix;
  if (const auto ratio = yaml.optionalNumber("flute_ratio", Range::openLow(0.3, 1.0)))
    tool.flute_ratio = *ratio;
  tool.material = beamMaterial(yaml.has("material") ? yaml.word("material") : "carbide");
  if (const auto tapped = yaml.optionalMap("tapped")) {
    if (tapped->has("x")) entry.tapped_x = besides(table, tapped->word("x"));
    if (tapped->has("y")) entry.tapped_y = besides(table, tapped->word("y"));
  }
  tool.validate();
  return entry;
}

}  // namespace

const TableTool& ToolTable::tool(const std::string& name) const {
  std::string known;
  for (const TableTool& entry : tools) {
    if (entry.tool.name == name) return entry;
    known += (known.empty() ? "" : ", ") + entry.tool.name;
  }
  throw Error(file + ": tool " + name + ": expected one of " + known);
}

ToolTable readToolTable(const std::string& file) {
  const StrictYaml yaml = StrictYaml::fromFile(file);
  yaml.oneOf("format", {"smartmill-tools/1"});
  ToolTable table;
  table.file = file;
  const std::vector<double> band = yaml.numbers("band_hz", 2, Range::positive());
  table.low = band[0];
  table.high = band[1];
  if (!(table.high > table.low)) yaml.fail("band_hz", "expected [low, high] with low < high");
  const StrictYaml gauge = yaml.map("gauge");
  table.gauge.segments = segmentsOf(gauge, "segments");
  table.gauge.second_point = gauge.number("second_point_mm", Range::positive()) * units::MM;
  table.x = filesOf(gauge.map("x"), file);
  if (const auto y = gauge.optionalMap("y")) table.y = filesOf(*y, file);
  try {
    table.gauge.validate();
  } catch (const Error& error) {
    throw Error(file + ": gauge: " + error.what());
  }
  if (yaml.has("holder")) table.holder = segmentsOf(yaml, "holder");
  for (const StrictYaml& entry : yaml.maps("tools")) {
    table.tools.push_back(toolOf(entry, file));
    const std::string& name = table.tools.back().tool.name;
    if (std::count_if(table.tools.begin(), table.tools.end(),
                      [&](const TableTool& t) { return t.tool.name == name; }) > 1)
      entry.fail("name", name + ": expected each tool once");
  }
  yaml.finish();
  return table;
}

FrequencyResponse readReceptance(const std::string& file) {
  FrequencyResponse frf;
  frf.unit = "m/N";
  if (!isUff(file)) {
    const auto columns = readColumns(file, {"frequency_hz", "real", "imag"});
    frf.frequency = columns[0];
    for (std::size_t i = 0; i < frf.frequency.size(); ++i)
      frf.value.emplace_back(columns[1][i], columns[2][i]);
  } else {
    const UffFunction* found = nullptr;
    const std::vector<UffFunction> functions = readUff(file);
    for (const UffFunction& f : functions) {
      if (f.type != uff::FREQUENCY_RESPONSE) continue;
      if (found != nullptr) throw Error(file + ": several FRFs: expected one");
      found = &f;
    }
    if (found == nullptr) throw Error(file + ": no FRF: expected a function of type 4");
    frf.frequency = found->abscissa;
    frf.value = found->value;
    if (found->numerator == uff::ACCELERATION) {
      frf.unit = "m/s2/N";
      frf = receptanceFromAccelerance(frf);
      frf.unit = "m/N";
    } else if (found->numerator != uff::DISPLACEMENT) {
      throw Error(file + ": FRF of data type " + std::to_string(found->numerator) +
                  ": expected displacement (8) or acceleration (12) over force");
    }
  }
  if (frf.frequency.empty()) throw Error(file + ": no lines");
  for (std::size_t i = 1; i < frf.frequency.size(); ++i)
    if (!(frf.frequency[i] > frf.frequency[i - 1])) throw Error(file + ": expected rising frequencies");
  return frf;
}

ContactEstimate TableAssembly::contactOf(const std::string& tool, double scatter) const {
  std::vector<TappedTool> own, others;
  for (const TappedTool& t : tapped) (t.tool.name == tool ? own : others).push_back(t);
  if (own.empty()) return tapped.empty() ? contact : contact.forAnotherTool(scatter);
  const ContactEstimate prior = others.empty()
                                    ? ContactEstimate::prior()
                                    : assembly.fit(others, ContactEstimate::prior()).forAnotherTool(scatter);
  return assembly.fit(own, prior);
}

TableAssembly assemblyOf(const ToolTable& table, bool along_y, const AssemblyOptions& options) {
  const GaugeFiles& files = along_y && table.y ? *table.y : table.x;
  GaugeTaps taps{readReceptance(files.direct), readReceptance(files.cross), {}};
  if (!files.second.empty()) taps.second = readReceptance(files.second);
  TableAssembly machine{
      ToolAssembly(spindleReceptances(table.gauge, taps, table.low, table.high), table.holder, options),
      ContactEstimate::prior(),
      {}};
  for (const TableTool& entry : table.tools) {
    const std::string& tapped = along_y && !entry.tapped_y.empty() ? entry.tapped_y : entry.tapped_x;
    if (!tapped.empty()) machine.tapped.push_back({entry.tool, readReceptance(tapped)});
  }
  if (!machine.tapped.empty()) machine.contact = machine.assembly.fit(machine.tapped, machine.contact);
  return machine;
}

}  // namespace smartmill::stability
