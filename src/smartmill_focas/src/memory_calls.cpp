#include "memory_calls.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <vector>

namespace smartmill::focas {
namespace {

constexpr std::size_t MAX_AXIS = 32;              // slots of a parameter or diagnosis number
constexpr std::size_t MAX_NUMBERED = 200;         // in one reply: they must fit a frame
constexpr std::size_t PATH_WIDTH = 256;           // [byte]
constexpr std::size_t COMMENT_WIDTH = 64;         // [byte] in a program list
constexpr std::size_t NAME_WIDTH = 36;            // [byte] in a folder's list
constexpr std::size_t FOLDER_COMMENT_WIDTH = 52;  // [byte]
constexpr int MAX_LISTED = 400;
constexpr int ALL_AXES = -1;
constexpr int MAX_PMC_BYTES = 60000;

/// The type codes of diagnosis numbers differ from those of parameters: 0 byte, 1 word, 2 double word, 3
/// bits.
int diagnosisType(NumberedType type) {
  switch (type) {
    case NumberedType::bits:
      return 3;
    case NumberedType::byte:
      return 0;
    case NumberedType::word:
      return 1;
    default:
      return 2;
  }
}

std::string upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return text;
}

/// Path of a folder in upper case, with one slash at the end.
std::string folderPath(const Bytes& extra) {
  Reader reader(extra);
  std::string path = upper(reader.text(extra.size()));
  while (!path.empty() && (path.back() == '/' || path.back() == ' ')) {
    path.pop_back();
  }
  return path + "/";
}

/// Names of the subfolders of a folder; empty: no such folder.
std::optional<std::vector<std::string>> foldersIn(const std::string& path, const std::string& programs) {
  const std::string whole = upper(programs);
  if (path == whole) {
    return std::vector<std::string>{};
  }
  if (path.size() < 3 || whole.compare(0, path.size(), path) != 0) {
    return std::nullopt;
  }
  return std::vector<std::string>{whole.substr(path.size(), whole.find('/', path.size()) - path.size())};
}

void putDateTime(const DateTime& at, Writer& out) {
  for (const int part : {at.year, at.month, at.day, at.hour, at.minute, at.second}) {
    out.u16(static_cast<std::uint16_t>(part));
  }
}

}  // namespace

std::optional<int> programNumber(const std::string& name) {
  const std::size_t slash = name.find_last_of("/:");
  std::string digits = upper(slash == std::string::npos ? name : name.substr(slash + 1));
  if (!digits.empty() && digits[0] == 'O') {
    digits.erase(0, 1);
  }
  if (digits.empty() || digits.size() > 8 ||
      !std::all_of(digits.begin(), digits.end(), [](unsigned char c) { return std::isdigit(c) != 0; })) {
    return std::nullopt;
  }
  return std::stoi(digits);
}

std::optional<int> MemoryCalls::call(const SubRequest& request, Writer& out) {
  if (request.c1 == 2) {
    return request.c3 == OP_PMC_READ    ? readPmc(request, out)
           : request.c3 == OP_PMC_WRITE ? writePmc(request)
                                        : int{EW_FUNC};
  }
  switch (request.c3) {
    case OP_PARAMETER:
      return numbered(request, true, false, out);
    case OP_PARAMETER_LEGACY:
      // A 31i-B refuses the legacy opcode; clients for the 16i use it on the 30i.
      return info_.cnc_type == "31" ? int{EW_FUNC} : numbered(request, true, true, out);
    case OP_DIAGNOSIS:
      return numbered(request, false, false, out);
    case OP_DIAGNOSIS_LEGACY:
      return numbered(request, false, true, out);
    case OP_CLOCK:
      return clock(request, out);
    case OP_SET_CLOCK:
      return setClock(request);
    default:
      return programCall(request, out);
  }
}

std::optional<int> MemoryCalls::programCall(const SubRequest& request, Writer& out) {
  switch (request.c3) {
    case OP_SEARCH_PROGRAM:
      return controller_.selectProgram(request.v[0]);
    case OP_DELETE_PROGRAM:
      return controller_.deleteProgram(request.v[0]);
    case OP_REWIND:
      return controller_.rewindProgram();
    case OP_SELECT_PROGRAM:
      return selectProgram(request);
    case OP_PROGRAM_LIST:
      return programList(request, out);
    case OP_FOLDER:
      out.text(controller_.programFolder(), PATH_WIDTH);
      return EW_OK;
    case OP_FOLDER_COUNT:
      return folderCount(request, out);
    case OP_FOLDER_LIST:
      return folderList(request, out);
    default:
      return std::nullopt;
  }
}

/// Each number: i32 number, i16 axis, u16 type, then MAX_AXIS slots of 8 bytes (30i) or 4 (legacy). The value
/// of a single axis is in the first slot.
int MemoryCalls::numbered(const SubRequest& request, bool parameters, bool legacy, Writer& out) const {
  const int axis = request.v[2];
  const int axes = static_cast<int>(info_.axes.size());
  if (request.v[0] < 0 || request.v[1] < request.v[0]) {
    return EW_NUMBER;
  }
  if (axis < ALL_AXES || axis > axes) {
    return EW_ATTRIB;
  }
  const std::vector<NumberedValue> entries = parameters ? controller_.parameters(request.v[0], request.v[1])
                                                        : controller_.diagnoses(request.v[0], request.v[1]);
  if (entries.empty()) {
    return EW_NUMBER;
  }
  const std::size_t count = std::min(entries.size(), MAX_NUMBERED);
  for (std::size_t i = 0; i < count; ++i) {
    const NumberedValue& entry = entries[i];
    if (count == 1 && entry.of_axis && axis == 0) {
      return EW_ATTRIB;  // a number with one value per axis requires an axis
    }
    std::vector<double> values = entry.values;
    if (entry.of_axis && axis > 0) {
      values = {values.at(static_cast<std::size_t>(axis - 1))};
    }
    out.i32(entry.number).i16(static_cast<std::int16_t>(entry.of_axis ? axis : 0));
    out.u16(
        static_cast<std::uint16_t>(parameters ? static_cast<int>(entry.type) : diagnosisType(entry.type)));
    values.resize(MAX_AXIS, 0.0);
    for (const double value : values) {
      const Value8 coded = Value8::fromDouble(value, entry.type == NumberedType::real ? entry.decimals : 0);
      if (legacy) {
        out.i32(coded.value);
      } else {
        out.value8(coded);
      }
    }
  }
  return EW_OK;
}

int MemoryCalls::clock(const SubRequest& request, Writer& out) const {
  if (request.v[0] != 0 && request.v[0] != 1) {
    return EW_DATA;
  }
  const std::optional<DateTime> now = controller_.dateTime();
  if (!now) {
    return EW_FUNC;
  }
  putDateTime(*now, out);  // always the date in the first half, the time in the second
  return EW_OK;
}

int MemoryCalls::setClock(const SubRequest& request) {
  std::optional<DateTime> now = controller_.dateTime();
  if (!now) {
    return EW_FUNC;
  }
  Reader reader(request.extra);
  std::array<int, 6> parts{};
  for (int& part : parts) {
    part = reader.u16();
  }
  if (request.v[0] == 0) {
    now->year = parts[0];
    now->month = parts[1];
    now->day = parts[2];
  } else if (request.v[0] == 1) {
    now->hour = parts[3];
    now->minute = parts[4];
    now->second = parts[5];
  } else {
    return EW_DATA;
  }
  const bool good = now->year >= 1970 && now->year <= 2099 && now->month >= 1 && now->month <= 12 &&
                    now->day >= 1 && now->day <= 31 && now->hour <= 23 && now->minute <= 59 &&
                    now->second <= 59;
  return good ? int{controller_.setDateTime(*now)} : int{EW_DATA};
}

/// Words and double words are big-endian on the wire and little-endian in the PMC.
int MemoryCalls::readPmc(const SubRequest& request, Writer& out) const {
  const int first = request.v[0], last = request.v[1], area = request.v[2], type = request.v[3];
  if (area < 0 || area > static_cast<int>(PmcArea::d) || type < 0 || type > 2) {
    return EW_ATTRIB;
  }
  const int element = 1 << type;
  if (first < 0 || last < first || last - first >= MAX_PMC_BYTES) {
    return EW_NUMBER;
  }
  if ((last - first + 1) % element != 0) {
    return EW_LENGTH;
  }
  Bytes bytes;
  const int code = controller_.readPmc(static_cast<PmcArea>(area), first, last, &bytes);
  if (code != EW_OK) {
    return code;
  }
  for (std::size_t i = 0; i < bytes.size(); i += static_cast<std::size_t>(element)) {
    for (int k = element - 1; k >= 0; --k) {
      out.u8(bytes[i + static_cast<std::size_t>(k)]);
    }
  }
  return EW_OK;
}

int MemoryCalls::writePmc(const SubRequest& request) {
  const int first = request.v[0], last = request.v[1], area = request.v[2], type = request.v[3];
  if (area < 0 || area > static_cast<int>(PmcArea::d) || type < 0 || type > 2) {
    return EW_ATTRIB;
  }
  if (first < 0 || last < first || last - first >= MAX_PMC_BYTES) {
    return EW_NUMBER;
  }
  const std::size_t element = std::size_t{1} << type;
  const std::size_t size = static_cast<std::size_t>(last - first + 1);
  if (size % element != 0 || request.extra.size() != size) {
    return EW_LENGTH;
  }
  Bytes bytes = request.extra;
  for (std::size_t i = 0; i < size; i += element) {
    std::reverse(bytes.begin() + static_cast<std::ptrdiff_t>(i),
                 bytes.begin() + static_cast<std::ptrdiff_t>(i + element));
  }
  return controller_.writePmc(static_cast<PmcArea>(area), first, bytes);
}

/// Programs from a number on: u32 number, u32 size, comment. An empty list is the end.
int MemoryCalls::programList(const SubRequest& request, Writer& out) const {
  int remaining = std::clamp(request.v[1], 0, MAX_LISTED);
  for (const StoredProgram& program : controller_.programs()) {
    if (program.number < request.v[0] || remaining <= 0) {
      continue;
    }
    --remaining;
    out.u32(static_cast<std::uint32_t>(program.number)).u32(static_cast<std::uint32_t>(program.size));
    out.text(program.comment, COMMENT_WIDTH);
  }
  return EW_OK;
}

int MemoryCalls::folderCount(const SubRequest& request, Writer& out) const {
  const std::string path = folderPath(request.extra);
  const auto folders = foldersIn(path, controller_.programFolder());
  if (!folders) {
    return EW_DATA;
  }
  const bool programs = path == upper(controller_.programFolder());
  out.i32(static_cast<std::int32_t>(folders->size()));
  out.i32(static_cast<std::int32_t>(programs ? controller_.programs().size() : 0));
  return EW_OK;
}

/// Entries of a folder from the first requested on, 128 bytes each: i16 kind (0 folder, 1 program), 6 x u16
/// date and time, 6 unknown bytes, u32 size, u32 attributes, name, comment, 12 bytes with the time of the
/// last run.
int MemoryCalls::folderList(const SubRequest& request, Writer& out) const {
  const std::string path = folderPath(request.extra);
  const auto folders = foldersIn(path, controller_.programFolder());
  if (!folders || request.v[0] < 0) {
    return EW_DATA;
  }
  std::vector<Bytes> entries;
  for (const std::string& folder : *folders) {
    entries.push_back(Writer().i16(0).zeros(26).text(folder, NAME_WIDTH).zeros(64).data());
  }
  if (path == upper(controller_.programFolder())) {
    for (const StoredProgram& program : controller_.programs()) {
      Writer entry;
      putDateTime(program.changed, entry.i16(1));
      entry.zeros(6).u32(static_cast<std::uint32_t>(program.size)).u32(0).text(program.name, NAME_WIDTH);
      entries.push_back(entry.text(program.comment, FOLDER_COMMENT_WIDTH).zeros(12).data());
    }
  }
  const std::size_t first = std::min(entries.size(), static_cast<std::size_t>(request.v[0]));
  const std::size_t count = static_cast<std::size_t>(std::clamp(request.v[1], 0, MAX_LISTED));
  for (std::size_t i = first; i < std::min(entries.size(), first + count); ++i) {
    out.bytes(entries[i]);
  }
  return EW_OK;
}

int MemoryCalls::selectProgram(const SubRequest& request) {
  Reader reader(request.extra);
  const std::optional<int> number = programNumber(reader.text(request.extra.size()));
  return number ? int{controller_.selectProgram(*number)} : int{EW_DATA};
}

}  // namespace smartmill::focas
