#include "smartmill_hammer/analysis/tap_records.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <sstream>
#include <utility>

#include "response_kind.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/campaign/sound_record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/io/uff.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::hammer {
namespace {

/// Largest step of the first column of a record; frequencies of an FRF have larger steps.
constexpr double LARGEST_TIME_STEP = 2e-3;  // [s]
/// Share of the peak force at the beginning of a hit.
constexpr double ONSET_SHARE = 0.02;
struct ThreeColumns {
  std::vector<double> a, b, c;
};

/// Numbers of a line separated by blanks or commas, up to the first word.
std::vector<double> numbersOf(std::string line) {
  std::replace(line.begin(), line.end(), ',', ' ');
  std::istringstream cells(line);
  std::vector<double> numbers;
  for (std::string cell; cells >> cell;) {
    char* end = nullptr;
    numbers.push_back(std::strtod(cell.c_str(), &end));
    if (*end) {
      numbers.pop_back();
      break;
    }
  }
  return numbers;
}

/// Three numbers per line; the first line may be a header, or have words after its numbers (CutPro).
ThreeColumns readThreeColumns(const std::string& file) {
  std::ifstream stream(file);
  if (!stream) throw Error(file + ": cannot be read");
  ThreeColumns columns;
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    const std::vector<double> values = numbersOf(line);
    if (number == 1 && values.empty()) continue;
    if (values.size() < 3)
      throw Error(file + ": line " + std::to_string(number) + ": expected three numbers");
    if (!std::isfinite(values[0]) || !std::isfinite(values[1]) || !std::isfinite(values[2]))
      throw Error(file + ": line " + std::to_string(number) + ": not a finite number");
    columns.a.push_back(values[0]);
    columns.b.push_back(values[1]);
    columns.c.push_back(values[2]);
  }
  if (columns.a.size() < 4) throw Error(file + ": expected at least four lines of three numbers");
  return columns;
}

// Times are printed with few digits; rates are integers in Hz.
double sampleRate(const std::vector<double>& time, const std::string& file) {
  const double rate = static_cast<double>(time.size() - 1) / (time.back() - time.front());
  if (!(rate > 0.0) || !std::isfinite(rate)) throw Error(file + ": time: expected a rising column");
  const double whole = std::round(rate);
  return std::abs(rate - whole) < 1e-5 * rate ? whole : rate;
}

void checkEvenTime(const std::vector<double>& time, const std::string& file) {
  const double step = (time.back() - time.front()) / static_cast<double>(time.size() - 1);
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (!(std::abs(time[i] - time.front() - static_cast<double>(i) * step) <= 0.25 * step)) {
      throw Error(file + ": line " + std::to_string(i + 1) + ": time is not evenly spaced");
    }
  }
}

std::size_t onsetIndex(const std::vector<double>& force) {
  const double level = ONSET_SHARE * *std::max_element(force.begin(), force.end());
  const auto peak = std::max_element(force.begin(), force.end()) - force.begin();
  auto i = peak;
  while (i > 0 && force[static_cast<std::size_t>(i)] > level) --i;
  return static_cast<std::size_t>(i);
}

double range(const std::vector<double>& values) {
  const auto ends = std::minmax_element(values.begin(), values.end());
  return *ends.second - *ends.first;
}

/// The response among a record's columns: a motion rather than a force, and of the forces the largest.
std::string responseColumn(const Record& record) {
  for (const char* name : {"displacement", "acceleration", "tool_x", "tool_y"}) {
    if (record.has(name)) return name;
  }
  std::string found;
  for (const char* name : FORCE_CHANNELS) {
    if (record.has(name) && (found.empty() || range(record.column(name)) > range(record.column(found))))
      found = name;
  }
  if (found.empty())
    throw Error(record.file + ": column acceleration or displacement is missing, and no force fx, fy or fz");
  return found;
}

}  // namespace

TapRecord tapOf(const Record& record, const ChannelNames& channels) {
  const std::string response = channels.response.empty() ? responseColumn(record) : channels.response;
  TapRecord tap;
  tap.file = record.file;
  tap.hit.force = record.column(channels.force.empty() ? "hammer" : channels.force);
  tap.hit.response = record.column(response);
  tap.kind = response == "acceleration"    ? ResponseKind::acceleration
             : response == "velocity"      ? ResponseKind::velocity
             : response.rfind('f', 0) == 0 ? ResponseKind::force
                                           : ResponseKind::displacement;
  tap.hit.sample_rate = sampleRate(record.time, record.file);
  tap.hit.pre_trigger = onsetIndex(tap.hit.force);
  return tap;
}

namespace {

/// Channels as named; otherwise the hammer's by its name, and as the response the first other channel with a
/// known unit.
TapRecord readTapDynoware(const std::string& file, const ChannelNames& channels) {
  std::ifstream stream(file);
  std::string line;
  while (std::getline(stream, line) && (line.rfind("Time", 0) != 0 || line.size() < 5 || line[4] == ':')) {
  }
  if (line.size() < 5) throw Error(file + ": the row of channel names (Time, ...) is missing");
  const char separator = line[4];
  std::string units_line;
  std::getline(stream, units_line);
  const auto cellsOf = [separator](std::string text) {
    if (!text.empty() && text.back() == '\r') text.pop_back();
    std::vector<std::string> cells;
    std::istringstream from(text);
    for (std::string cell; std::getline(from, cell, separator);) cells.push_back(cell);
    return cells;
  };
  const std::vector<std::string> names = cellsOf(line), unit = cellsOf(units_line);
  std::string force = channels.force, response = channels.response, kind;
  for (std::size_t i = 1; i < names.size() && i < unit.size(); ++i) {
    std::string low = names[i];
    for (char& c : low) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (force.empty() && low.find("hammer") != std::string::npos) force = names[i];
    if (names[i] == force || (!response.empty() && names[i] != response)) continue;
    if (!kind.empty()) continue;
    kind = unit[i] == "m/s2" ? "acceleration" : unit[i] == "m" ? "displacement" : unit[i] == "N" ? "fx" : "";
    if (!kind.empty()) response = names[i];
  }
  if (force.empty()) throw Error(file + ": no channel is named hammer; name it with --force-channel");
  if (kind.empty()) throw Error(file + ": no response in m/s2, m or N; name it with --response-channel");
  return tapOf(readDynoware(file, {{"hammer", force}, {kind, response}}), {"", kind, ""});
}

/// By the function's kind of data; where that is unknown, by its unit.
ResponseKind responseKind(const UffFunction& f, const std::string& file) {
  switch (f.numerator) {
    case uff::ACCELERATION:
      return ResponseKind::acceleration;
    case uff::VELOCITY:
      return ResponseKind::velocity;
    case uff::DISPLACEMENT:
      return ResponseKind::displacement;
    case uff::REACTION_FORCE:
    case uff::EXCITATION_FORCE:
      return ResponseKind::force;
    case 0:
    case 1:
      break;
    default:
      throw Error(file + ": " + f.name + ": kind of data " + std::to_string(f.numerator) +
                  " is not a response");
  }
  const std::string& u = f.unit;
  if (u == "g" || u == "G" || u == "g/N" || (u.rfind("m/s", 0) == 0 && u.find('2') != std::string::npos))
    return ResponseKind::acceleration;
  if (u.rfind("m/s", 0) == 0) return ResponseKind::velocity;
  return u.rfind('N', 0) == 0 || u.rfind("kN", 0) == 0 ? ResponseKind::force : ResponseKind::displacement;
}

/// SI value of one unit of the file; other units are taken for SI.
double siFactor(const std::string& unit) {
  if (unit == "g" || unit == "G" || unit == "g/N") return 9.80665;
  if (unit.rfind("mm", 0) == 0) return units::MM;
  if (unit.rfind("um", 0) == 0) return units::UM;
  return unit.rfind("kN", 0) == 0 ? 1e3 : 1.0;
}

std::vector<double> realParts(const UffFunction& f) {
  std::vector<double> values;
  for (const std::complex<double>& v : f.value) values.push_back(v.real() * siFactor(f.unit));
  return values;
}

NamedFrf frfOf(const UffFunction& f, const std::string& name, const std::string& file) {
  const ResponseKind kind = responseKind(f, file);
  NamedFrf result{name, {}};
  result.frf.unit = frfUnit(kind);
  for (std::size_t i = 0; i < f.value.size(); ++i) {
    if (!(f.abscissa[i] > 0.0)) continue;
    result.frf.frequency.push_back(f.abscissa[i]);
    result.frf.value.push_back(f.value[i] * siFactor(f.unit));
  }
  result.frf = receptanceOf(result.frf, kind);
  return result;
}

void addCoherence(const UffFunction& f, FrequencyResponse& frf) {
  std::vector<double> coherence;
  for (std::size_t i = 0; i < f.value.size(); ++i) {
    if (f.abscissa[i] > 0.0) coherence.push_back(f.value[i].real());
  }
  if (coherence.size() == frf.size()) frf.coherence = std::move(coherence);
}

/// Hits from forces and responses over time: equal numbers are paired in order, otherwise a response belongs
/// to the last force before it.
std::vector<TapRecord> hitsOf(const std::vector<const UffFunction*>& functions, const std::string& file) {
  const bool named = std::any_of(functions.begin(), functions.end(),
                                 [](const UffFunction* f) { return f->numerator == uff::EXCITATION_FORCE; });
  const auto isHammer = [&](const UffFunction& f) {
    return named ? f.numerator == uff::EXCITATION_FORCE : responseKind(f, file) == ResponseKind::force;
  };
  std::vector<const UffFunction*> forces, responses, before;
  for (const UffFunction* f : functions) {
    if (isHammer(*f)) {
      forces.push_back(f);
      continue;
    }
    responses.push_back(f);
    before.push_back(forces.empty() ? nullptr : forces.back());
  }
  std::vector<TapRecord> taps;
  for (std::size_t r = 0; r < responses.size() && !forces.empty(); ++r) {
    const UffFunction& force = responses.size() == forces.size() ? *forces[r]
                               : before[r]                       ? *before[r]
                                                                 : *forces.front();
    TapRecord tap;
    tap.file = responses.size() > 1 ? file + ":" + std::to_string(r + 1) : file;
    tap.kind = responseKind(*responses[r], file);
    tap.hit.force = realParts(force);
    tap.hit.response = realParts(*responses[r]);
    tap.hit.sample_rate = sampleRate(force.abscissa, file);
    tap.hit.pre_trigger = onsetIndex(tap.hit.force);
    taps.push_back(std::move(tap));
  }
  return taps;
}

TapFile readTapUff(const std::string& file) {
  TapFile result;
  const std::vector<UffFunction> functions = readUff(file);
  std::vector<const UffFunction*> over_time;
  int number = 0;
  for (const UffFunction& f : functions) {
    const std::string name = file + (functions.size() > 1 ? ":" + std::to_string(++number) : "");
    if (f.type == uff::FREQUENCY_RESPONSE) result.frfs.push_back(frfOf(f, name, file));
    if (f.type == uff::COHERENCE && !result.frfs.empty()) addCoherence(f, result.frfs.back().frf);
    if (f.type == uff::TIME_RESPONSE) over_time.push_back(&f);
  }
  result.taps = hitsOf(over_time, file);
  if (result.taps.empty() && result.frfs.empty())
    throw Error(file + ": neither FRFs nor a force and its response over time");
  return result;
}

/// Coherence and standard deviations of frf.csv.
void readCoherenceAndStd(const std::string& file, FrequencyResponse& frf) {
  const NumberTable table = readNumberTable(file);
  for (const auto& [name, values] :
       {std::pair("coherence", &frf.coherence), std::pair("std", &frf.std_dev)}) {
    if (!table.has(name)) continue;
    const std::vector<double>& column = table.column(name);
    const std::size_t unused = column.size() - frf.size();  // the line at zero
    values->assign(column.begin() + static_cast<std::ptrdiff_t>(unused), column.end());
  }
}

}  // namespace

TapFormat detectFormat(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw Error(file + ": cannot be read");
  std::string first;
  std::getline(stream, first);
  if (first.rfind("#ROSBAG ", 0) == 0 || first.rfind("\x89MCAP", 0) == 0) return TapFormat::bag;
  if (first.rfind("DynoWare", 0) == 0) return TapFormat::dynoware;
  if (isUff(file)) return TapFormat::uff;
  if (isSoundFile(file)) return TapFormat::sound;
  if (first.find('[') != std::string::npos && first.find("time") != std::string::npos) return TapFormat::csv;
  if (first.rfind("frequency", 0) == 0) return TapFormat::frf;
  std::string second;
  std::getline(stream, second);
  const std::vector<double> one = numbersOf(first), two = numbersOf(second);
  if (one.size() >= 3 && two.size() >= 3 && two[0] > one[0])
    return two[0] - one[0] < LARGEST_TIME_STEP ? TapFormat::text : TapFormat::frf;
  throw Error(file +
              ": neither a bag, a DynoWare export, a universal file, a sound file, nor CSV with "
              "time[s],hammer[N],acceleration[m/s2] "
              "(or displacement[m], or a force), nor three columns of numbers");
}

TapRecord readTapCsv(const std::string& file, const ChannelNames& channels) {
  return tapOf(readCsv(file), channels);
}

/// The hammer by its name; the response is the first other channel.
TapRecord readTapSound(const std::string& file, const ChannelNames& channels) {
  if (channels.sound.empty())
    throw Error(file + ": a sound file does not name its channels; name them with --sound-channels");
  const std::vector<SoundChannel> named = soundChannels(channels.sound);
  ChannelNames names{"hammer", "", ""};
  for (const SoundChannel& channel : named)
    if (names.response.empty() && channel.name != names.force) names.response = channel.name;
  if (names.response.empty()) throw Error(file + ": --sound-channels names no response");
  return tapOf(readSoundRecord(file, named), names);
}

TapRecord readTapText(const std::string& file) {
  const ThreeColumns columns = readThreeColumns(file);
  checkEvenTime(columns.a, file);
  TapRecord tap;
  tap.file = file;
  tap.hit.force = columns.b;
  tap.hit.response = columns.c;
  tap.kind = ResponseKind::acceleration;
  tap.hit.sample_rate = sampleRate(columns.a, file);
  tap.hit.pre_trigger = onsetIndex(tap.hit.force);
  return tap;
}

TapFile readTapFile(const std::string& file, TapFormat format, const ChannelNames& channels) {
  switch (format) {
    case TapFormat::csv:
      return {{readTapCsv(file, channels)}, {}};
    case TapFormat::text:
      return {{readTapText(file)}, {}};
    case TapFormat::dynoware:
      return {{readTapDynoware(file, channels)}, {}};
    case TapFormat::sound:
      return {{readTapSound(file, channels)}, {}};
    case TapFormat::uff:
      return readTapUff(file);
    case TapFormat::frf:
      return {{}, {{file, readFrfText(file)}}};
    default:
      throw Error(file + ": not a hammer record");
  }
}

FrequencyResponse readFrfText(const std::string& file) {
  const ThreeColumns columns = readThreeColumns(file);
  FrequencyResponse frf;
  frf.unit = "m/N";
  for (std::size_t i = 0; i < columns.a.size(); ++i) {
    if (i > 0 && !(columns.a[i] > columns.a[i - 1])) {
      throw Error(file + ": line " + std::to_string(i + 1) + ": expected rising frequencies");
    }
    if (columns.a[i] <= 0.0) continue;  // an accelerometer gives no static receptance
    frf.frequency.push_back(columns.a[i]);
    frf.value.emplace_back(columns.b[i], columns.c[i]);
  }
  if (readText(file).rfind("frequency_hz", 0) == 0) readCoherenceAndStd(file, frf);
  return frf;
}

}  // namespace smartmill::hammer
