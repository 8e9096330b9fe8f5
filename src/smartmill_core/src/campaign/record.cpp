#include "smartmill_core/campaign/record.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string_view>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/campaign/record_columns.h"
#include "smartmill_core/campaign/sound_record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/signal/force_channels.h"

namespace smartmill {

namespace {

constexpr double POWERS[] = {1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12};

/// Like printf's %.*g with at most 9 digits. Numbers of usual magnitude are rounded as integers where the
/// rounding of the product cannot change a digit; std::to_chars formats the others.
void appendGeneral(std::string& text, double value, int digits) {
  constexpr double CERTAIN = 1e-4;  // distance from a half; 1e9 is exact to 1e-7
  char written[40];
  char* const end = written + sizeof written;
  const double size = std::abs(value);
  if (size >= 1e-4 && size < 1e6) {
    int decimals = digits + 3;  // for numbers from 1e-4 to 1e-3
    for (double above = 1e-3; size >= above && decimals > digits; above *= 10.0) --decimals;
    for (double above = 1.0; size >= above; above *= 10.0) --decimals;
    const double scaled = size * POWERS[decimals], whole = std::floor(scaled), part = scaled - whole;
    auto number = static_cast<std::uint64_t>(whole) + (part > 0.5 ? 1 : 0);
    if (std::abs(part - 0.5) > CERTAIN && static_cast<double>(number) < POWERS[digits]) {
      for (; decimals > 0 && number % 10 == 0; --decimals) number /= 10;
      char* at = end;
      for (int left = decimals; left > 0; --left, number /= 10) *--at = static_cast<char>('0' + number % 10);
      if (decimals > 0) *--at = '.';
      do {
        *--at = static_cast<char>('0' + number % 10);
        number /= 10;
      } while (number > 0);
      if (value < 0.0) *--at = '-';
      text.append(at, end);
      return;
    }
  }
  text.append(written, std::to_chars(written, end, value, std::chars_format::general, digits).ptr);
}

/// Destination of a column of the file; nullptr: skipped.
struct Target {
  std::string name;
  std::vector<double>* values;
  double si;
};

// The rows below the header.
void readRows(CsvReader& reader, const std::vector<Target>& targets) {
  std::vector<std::string_view> cells;
  while (reader.next(&cells)) {
    if (isBlank(cells)) {
      if (reader.restIsBlank()) break;
      reader.fail("is empty");
    }
    if (cells.size() != targets.size())
      reader.fail(std::to_string(cells.size()) + " values, expected " + std::to_string(targets.size()) +
                  " (one per column)");
    for (std::size_t c = 0; c < targets.size(); ++c) {
      const Target& t = targets[c];
      if (t.values) t.values->push_back(reader.number(cells[c], t.name) * t.si);
    }
  }
}

void checkTime(const Record& record, int first_line, double sample_rate) {
  const std::vector<double>& t = record.time;
  if (t.empty()) throw Error(record.file + ": no samples");
  if (t.size() < 2) return;
  if (const std::optional<UnevenStep> worst = unevenStep(t)) {
    throw Error(record.file + formatted(": line %d: column time: a step of %g s, expected %g s",
                                        first_line + 1 + static_cast<int>(worst->sample), worst->step,
                                        worst->usual));
  }
  const double step = (t.back() - t.front()) / static_cast<double>(t.size() - 1);
  if (sample_rate > 0.0 && std::abs(step * sample_rate - 1.0) > 1e-3) {
    throw Error(record.file +
                formatted(": the sample rate is %.6g Hz, but the campaign's sample_rate_hz is %.6g",
                          1.0 / step, sample_rate));
  }
}

// The column of each header cell; nullptr for one that is not used, which adds a note.
std::vector<const RecordColumn*> readHeader(const CsvReader& reader,
                                            const std::vector<std::string_view>& cells,
                                            std::vector<std::string>* notes) {
  std::vector<const RecordColumn*> kinds;
  for (const std::string_view cell : cells) {
    const std::size_t open = cell.find('[');
    if (open == std::string_view::npos || cell.back() != ']') {
      reader.fail("column '" + std::string(cell) + "': expected name[unit]");
    }
    const std::string_view name = cell.substr(0, cell.find_last_not_of(" \t", open - 1) + 1);
    const std::string_view unit = cell.substr(open + 1, cell.size() - open - 2);
    const RecordColumn* kind = recordColumn(name);
    if (!kind) {
      notes->push_back(reader.file() + ": column " + std::string(cell) + " is not used");
    } else if (unit != kind->unit) {
      reader.fail("column " + std::string(name) + ": the unit is '" + std::string(unit) + "', expected " +
                  kind->unit);
    } else if (std::find(kinds.begin(), kinds.end(), kind) != kinds.end()) {
      reader.fail("column " + std::string(name) + " occurs twice");
    }
    kinds.push_back(kind);
  }
  return kinds;
}

Record readCsvAt(const std::string& file, double sample_rate) {
  CsvReader reader(file);
  std::vector<std::string_view> header;
  if (!reader.next(&header)) throw Error(file + ": is empty");
  Record record;
  record.file = file;
  const std::vector<const RecordColumn*> kinds = readHeader(reader, header, &record.notes);
  if (std::none_of(kinds.begin(), kinds.end(),
                   [](const RecordColumn* k) { return k && k == &RECORD_COLUMNS[0]; })) {
    throw Error(file + ": column time is missing");
  }
  std::size_t used = 0;
  for (const RecordColumn* kind : kinds) used += kind && kind != &RECORD_COLUMNS[0] ? 1 : 0;
  record.columns.resize(used);
  std::vector<Target> targets;
  for (const RecordColumn* kind : kinds) {
    if (!kind) {
      targets.push_back({"", nullptr, 1.0});
    } else if (kind == &RECORD_COLUMNS[0]) {
      targets.push_back({"time", &record.time, 1.0});
    } else {
      targets.push_back({kind->name, &record.columns[record.names.size()], kind->si});
      record.names.push_back(kind->name);
    }
  }
  readRows(reader, targets);
  checkTime(record, 2, sample_rate);
  return record;
}

Record readDynowareAt(const std::string& file, const std::map<std::string, std::string>& channels,
                      double sample_rate) {
  CsvReader reader(file);
  std::string_view line;
  if (!reader.nextLine(&line) || line.substr(0, 8) != "DynoWare") {
    throw Error(file + ": line 1: not a DynoWare export");
  }
  do {
    if (!reader.nextLine(&line)) throw Error(file + ": the row of channel names (Time, ...) is missing");
  } while (line.substr(0, 4) != "Time" || line.size() < 5 || line[4] == ':');
  const char separator = line[4];
  std::vector<std::string> names;
  for (std::size_t begin = 0, end = 0; end < line.size(); begin = end + 1) {
    end = std::min(line.find(separator, begin), line.size());
    names.emplace_back(line.substr(begin, end - begin));
  }
  reader.setSeparator(separator);
  std::vector<std::string_view> units_row;
  if (!reader.next(&units_row)) throw Error(file + ": the row of units is missing");
  const int header_lines = reader.line();
  if (units_row.size() != names.size()) reader.fail("expected a unit for every channel");

  Record record;
  record.file = file;
  record.columns.resize(channels.size());
  std::vector<Target> targets(names.size(), {"", nullptr, 1.0});
  const auto check = [&](std::size_t c, const char* unit) {
    if (units_row[c] != unit) {
      reader.fail("column " + names[c] + ": the unit is '" + std::string(units_row[c]) + "', expected " +
                  unit);
    }
  };
  check(0, "s");
  targets[0] = {"Time", &record.time, 1.0};
  for (const auto& [name, channel] : channels) {
    const auto at = std::find(names.begin(), names.end(), channel);
    if (at == names.end()) throw Error(file + ": column " + channel + " is missing");
    const RecordColumn* kind = recordColumn(name);
    if (!kind) throw Error(file + ": channels: '" + name + "' is not a column name");
    const std::size_t c = static_cast<std::size_t>(at - names.begin());
    check(c, kind->unit);
    if (targets[c].values) throw Error(file + ": channels: " + channel + " occurs twice");
    targets[c] = {channel, &record.columns[record.names.size()], kind->si};
    record.names.push_back(name);
  }
  readRows(reader, targets);
  checkTime(record, header_lines + 1, sample_rate);
  return record;
}

}  // namespace

const RecordColumn* recordColumn(std::string_view name) {
  const auto at = std::find_if(RECORD_COLUMNS.begin(), RECORD_COLUMNS.end(),
                               [&](const RecordColumn& column) { return name == column.name; });
  return at == RECORD_COLUMNS.end() ? nullptr : &*at;
}

std::optional<std::size_t> motionAxis(std::string_view name) {
  constexpr std::string_view PREFIX = "axis_";
  if (name.substr(0, PREFIX.size()) != PREFIX) return {};
  return axisIndex(name.substr(name.size() - 1));
}

std::optional<UnevenStep> unevenStep(const std::vector<double>& t) {
  const std::size_t n = t.size();
  if (n < 2) return std::nullopt;
  const double step = (t.back() - t.front()) / static_cast<double>(n - 1);
  bool even = step > 0.0;
  for (std::size_t i = 0; i < n && even; ++i) {
    even = std::abs(t[i] - t.front() - static_cast<double>(i) * step) <= 0.25 * step;
  }
  if (even) return std::nullopt;
  std::vector<double> steps(n - 1);
  for (std::size_t i = 0; i + 1 < n; ++i) steps[i] = t[i + 1] - t[i];
  std::vector<double> sorted = steps;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                   sorted.end());
  const double usual = sorted[sorted.size() / 2];
  const auto worst = std::max_element(steps.begin(), steps.end(), [usual](double l, double r) {
    return std::abs(l - usual) < std::abs(r - usual);
  });
  // Two rates in one record: times have few digits, so that all steps of the second rate count as equal.
  const double alike = 0.99 * std::abs(*worst - usual);
  const auto first = std::find_if(steps.begin(), steps.end(),
                                  [&](double candidate) { return std::abs(candidate - usual) >= alike; });
  return UnevenStep{static_cast<std::size_t>(first - steps.begin()), *first, usual};
}

bool Record::has(const std::string& name) const {
  return std::find(names.begin(), names.end(), name) != names.end();
}

const std::vector<double>& Record::column(const std::string& name) const {
  const auto at = std::find(names.begin(), names.end(), name);
  if (at == names.end()) throw Error(file + ": column " + name + " is missing");
  return columns[static_cast<std::size_t>(at - names.begin())];
}

std::vector<double>& Record::add(const std::string& name) {
  const auto at = std::find(names.begin(), names.end(), name);
  if (at != names.end()) return columns[static_cast<std::size_t>(at - names.begin())];
  names.push_back(name);
  return columns.emplace_back();
}

namespace {

/// Makes spindle_angle of the pulses of a tachometer, whose column is removed.
void replaceTachometer(const CampaignTest& test, Record* record) {
  const auto at = std::find(record->names.begin(), record->names.end(), TACHOMETER_CHANNEL);
  if (at == record->names.end()) {
    if (test.tachometer)
      throw Error(record->file + ": column tachometer is missing (test " + test.name +
                  " has key tachometer)");
    return;
  }
  const auto column = record->columns.begin() + (at - record->names.begin());
  const std::vector<double> volts = std::move(*column);
  record->columns.erase(column);
  record->names.erase(at);
  const std::string where = record->file + ": column tachometer";
  if (!test.tachometer) {
    record->notes.push_back(where + " is not used: its test has no key tachometer");
  } else if (record->has("spindle_angle")) {
    record->notes.push_back(where + " is not used: the record has spindle_angle");
  } else {
    record->add("spindle_angle") =
        angleOfPulses(record->time, volts, *test.tachometer, where, &record->notes);
  }
}

Record readColumns(const Campaign& campaign, const CampaignTest& test) {
  const std::string path = campaign.pathOf(test);
  if (test.file_format == "dynoware") return readDynowareAt(path, test.channels, test.sample_rate);
  if (test.file_format != "sound") {
    Record record = readCsvAt(path, test.sample_rate);
    if (test.kind == TestKind::move && std::none_of(record.names.begin(), record.names.end(), motionAxis))
      throw Error(path + ": a move needs a column axis_x[mm], axis_vx[mm/min] or those of y or z");
    if (test.kind == TestKind::path) {
      for (const char* position : {"axis_x", "axis_y", "axis_z"}) record.column(position);
    }
    return record;
  }
  std::string channels;
  for (const auto& [name, number] : test.channels) {
    const std::size_t scale = std::min(number.find('='), number.size());
    channels += (channels.empty() ? "" : ",") + number.substr(0, scale) + ":" + name + number.substr(scale);
  }
  const Record record = readSoundRecord(path, soundChannels(channels));
  checkTime(record, 1, test.sample_rate);
  return record;
}

}  // namespace

Record readRecord(const Campaign& campaign, const CampaignTest& test) {
  Record record = readColumns(campaign, test);
  replaceTachometer(test, &record);
  return record;
}

Record readRecord(const Campaign& campaign, const CampaignTest& test, const MachineModel& model) {
  Record record = readRecord(campaign, test);
  if (!model.force_sensor.measures_workpiece) return record;
  for (const char* name : FORCE_CHANNELS) {
    if (!record.has(name)) continue;
    for (double& value : record.add(name)) value = -value;
  }
  return record;
}

Record inFeedAxes(Record record, const CampaignTest& test) {
  if (test.feed_direction == 0.0) return record;
  const double c = std::cos(test.feed_direction), s = std::sin(test.feed_direction);
  if (record.has("fx") && record.has("fy")) {
    const std::vector<double> fx = record.column("fx"), fy = record.column("fy");
    std::vector<double>&along = record.add("fx"), &across = record.add("fy");
    for (std::size_t i = 0; i < fx.size(); ++i) {
      along[i] = c * fx[i] + s * fy[i];
      across[i] = c * fy[i] - s * fx[i];
    }
  }
  if (record.has("spindle_angle")) {
    for (double& angle : record.add("spindle_angle")) angle = wrapped(angle + test.feed_direction);
  }
  return record;
}

Record readSoundRecord(const std::string& file, const std::vector<SoundChannel>& channels) {
  SoundFile sound = readSoundFile(file);
  Record record;
  record.file = file;
  for (const SoundChannel& channel : channels) {
    if (!recordColumn(channel.name) || channel.name == "time")
      throw Error(file + ": channel '" + channel.name + "' is not a column of a record");
    if (record.has(channel.name)) throw Error(file + ": channel '" + channel.name + "' occurs twice");
    if (channel.number > sound.channels.size())
      throw Error(file + ": channel " + std::to_string(channel.number) + " (" + channel.name +
                  "): the file has " + std::to_string(sound.channels.size()));
    std::vector<double> values = sound.channels[channel.number - 1];
    for (double& v : values) v *= channel.scale;
    record.add(channel.name) = std::move(values);
  }
  for (std::size_t i = 0; i < sound.channels[0].size(); ++i)
    record.time.push_back(static_cast<double>(i) / sound.sample_rate);
  return record;
}

Record readCsv(const std::string& file) {
  return readCsvAt(file, 0.0);
}

Record readDynoware(const std::string& file, const std::map<std::string, std::string>& channels) {
  return readDynowareAt(file, channels, 0.0);
}

void writeCsv(const Record& record, const std::string& file, int digits) {
  std::string text = "time[s]";
  std::vector<double> si;
  for (std::size_t c = 0; c < record.names.size(); ++c) {
    const RecordColumn* kind = recordColumn(record.names[c]);
    if (!kind) throw Error(file + ": '" + record.names[c] + "' is not a column name");
    if (record.columns[c].size() != record.size())
      throw Error(file + ": column " + record.names[c] + " has too few samples");
    text += "," + record.names[c] + "[" + kind->unit + "]";
    si.push_back(kind->si);
  }
  text += "\n";
  text.reserve(text.size() + record.size() * (12 + (static_cast<std::size_t>(digits) + 3) * si.size()));
  for (std::size_t i = 0; i < record.size(); ++i) {
    appendGeneral(text, record.time[i], 9);
    for (std::size_t c = 0; c < si.size(); ++c) {
      text += ',';
      appendGeneral(text, record.columns[c][i] / si[c], digits);
    }
    text += '\n';
  }
  writeText(file, text);
}

}  // namespace smartmill
