// Programs in memory, their start and the reset.
#include <algorithm>
#include <cctype>
#include <cstdint>
#include <vector>

#include "calls.h"

namespace smartmill::focas {
namespace {

constexpr std::size_t PATH_WIDTH = 256;           // [byte]
constexpr std::size_t COMMENT_WIDTH = 64;         // [byte] in a program list
constexpr std::size_t NAME_WIDTH = 36;            // [byte] in a folder's list
constexpr std::size_t FOLDER_COMMENT_WIDTH = 52;  // [byte]
constexpr int MAX_LISTED = 400;

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

/// Programs from a number on: u32 number, u32 size, comment. An empty list is the end.
int programList(const ProgramsInterface& memory, const SubRequest& request, Writer& out) {
  int remaining = std::clamp(request.v[1], 0, MAX_LISTED);
  for (const StoredProgram& program : memory.programs()) {
    if (program.number < request.v[0] || remaining <= 0) {
      continue;
    }
    --remaining;
    out.u32(static_cast<std::uint32_t>(program.number)).u32(static_cast<std::uint32_t>(program.size));
    out.text(program.comment, COMMENT_WIDTH);
  }
  return EW_OK;
}

int folderCount(const ProgramsInterface& memory, const SubRequest& request, Writer& out) {
  const std::string path = folderPath(request.extra);
  const auto folders = foldersIn(path, PROGRAM_FOLDER);
  if (!folders) {
    return EW_DATA;
  }
  const bool programs = path == upper(PROGRAM_FOLDER);
  out.i32(static_cast<std::int32_t>(folders->size()));
  out.i32(static_cast<std::int32_t>(programs ? memory.programs().size() : 0));
  return EW_OK;
}

/// Entries of a folder from the first requested on, 128 bytes each: i16 kind (0 folder, 1 program), 6 x u16
/// date and time, 6 unknown bytes, u32 size, u32 attributes, name, comment, 12 bytes with the time of the
/// last run.
int folderList(const ProgramsInterface& memory, const SubRequest& request, Writer& out) {
  const std::string path = folderPath(request.extra);
  const auto folders = foldersIn(path, PROGRAM_FOLDER);
  if (!folders || request.v[0] < 0) {
    return EW_DATA;
  }
  std::vector<Bytes> entries;
  for (const std::string& folder : *folders) {
    entries.push_back(Writer().i16(0).zeros(26).text(folder, NAME_WIDTH).zeros(64).data());
  }
  if (path == upper(PROGRAM_FOLDER)) {
    for (const StoredProgram& program : memory.programs()) {
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

int selectProgram(ProgramsInterface& memory, const SubRequest& request) {
  Reader reader(request.extra);
  const std::optional<int> number = programNumber(reader.text(request.extra.size()));
  return number ? int{memory.selectProgram(*number)} : int{EW_DATA};
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

void addProgramCalls(ProgramsInterface& memory, CallTable& table) {
  table.add(OP_START, [&](const SubRequest&, Writer&) { return memory.cycleStart(); });
  table.add(OP_RESET, [&](const SubRequest&, Writer&) { return memory.reset(); });
  table.add(OP_SEARCH_PROGRAM, [&](const SubRequest& r, Writer&) { return memory.selectProgram(r.v[0]); });
  table.add(OP_DELETE_PROGRAM, [&](const SubRequest& r, Writer&) { return memory.deleteProgram(r.v[0]); });
  table.add(OP_REWIND, [&](const SubRequest&, Writer&) { return memory.rewindProgram(); });
  table.add(OP_SELECT_PROGRAM, [&](const SubRequest& r, Writer&) { return selectProgram(memory, r); });
  table.add(OP_PROGRAM_LIST, [&](const SubRequest& r, Writer& out) { return programList(memory, r, out); });
  table.add(OP_FOLDER_COUNT, [&](const SubRequest& r, Writer& out) { return folderCount(memory, r, out); });
  table.add(OP_FOLDER_LIST, [&](const SubRequest& r, Writer& out) { return folderList(memory, r, out); });
  table.addReply(OP_FOLDER, [&](const SubRequest&, Writer& out) { out.text(PROGRAM_FOLDER, PATH_WIDTH); });
}

}  // namespace smartmill::focas
