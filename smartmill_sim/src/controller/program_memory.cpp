#include "controller/program_memory.h"

#include <cctype>
#include <sstream>

#include "smartmill_core/formatted.h"

namespace smartmill::sim {
namespace {

/// O number at the start of a line; nullopt: another line.
std::optional<int> numberOf(const std::string& line) {
  if (line.empty() || (line[0] != 'O' && line[0] != 'o' && line[0] != ':')) return std::nullopt;
  int number = 0;
  std::size_t digits = 0;
  for (std::size_t i = 1; i < line.size() && std::isdigit(static_cast<unsigned char>(line[i])) != 0; ++i) {
    number = 10 * number + (line[i] - '0');
    if (++digits > 8) return std::nullopt;
  }
  return digits > 0 && number > 0 ? std::optional<int>(number) : std::nullopt;
}

std::string commentOf(const std::string& text) {
  const std::size_t end = text.find('\n');
  const std::size_t open = text.find('(');
  const std::size_t close = text.find(')', open);
  if (open == std::string::npos || close == std::string::npos || close > end) return {};
  return text.substr(open, close - open + 1);
}

std::string nameOf(int number) {
  return formatted("O%04d", number);
}

}  // namespace

focas::EwCode ProgramMemory::store(const std::string& text, bool runs, const focas::DateTime& now) {
  std::map<int, Program> loaded;
  Program* current = nullptr;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    while (!line.empty() && (line.back() == '\r' || line.back() == '\0')) line.pop_back();
    if (line.empty() || line[0] == '%') continue;
    if (const std::optional<int> number = numberOf(line)) {
      current = &loaded[*number];
      *current = Program{{}, now};
    }
    if (current == nullptr) return focas::EW_DATA;
    current->text += line + "\n";
  }
  if (loaded.empty()) return focas::EW_DATA;
  std::size_t size = 0;
  for (const auto& [number, program] : programs_) size += loaded.count(number) != 0 ? 0 : program.text.size();
  for (const auto& [number, program] : loaded) {
    if (runs && number == selected_) return focas::EW_BUSY;
    size += program.text.size();
  }
  if (size > capacity_) return focas::EW_OVRFLOW;
  for (auto& [number, program] : loaded) programs_[number] = std::move(program);
  return focas::EW_OK;
}

focas::EwCode ProgramMemory::select(int number, bool runs) {
  if (programs_.count(number) == 0) return focas::EW_DATA;
  if (runs) return focas::EW_BUSY;
  selected_ = number;
  return focas::EW_OK;
}

focas::EwCode ProgramMemory::erase(int number, bool runs) {
  if (programs_.count(number) == 0) return focas::EW_DATA;
  if (runs && number == selected_) return focas::EW_BUSY;
  programs_.erase(number);
  if (number == selected_) selected_ = 0;
  return focas::EW_OK;
}

std::optional<std::string> ProgramMemory::fetch(int first, int last) const {
  std::string all;
  for (const auto& [number, program] : programs_) {
    if (number >= first && number <= last) all += program.text;
  }
  return all.empty() ? std::nullopt : std::optional<std::string>("%\n" + all + "%\n");
}

std::vector<focas::StoredProgram> ProgramMemory::list() const {
  std::vector<focas::StoredProgram> entries;
  for (const auto& [number, program] : programs_) {
    entries.push_back(
        {number, nameOf(number), commentOf(program.text), program.text.size(), program.changed});
  }
  return entries;
}

std::optional<std::string> ProgramMemory::text(int number) const {
  const auto found = programs_.find(number);
  return found == programs_.end() ? std::nullopt : std::optional<std::string>(found->second.text);
}

}  // namespace smartmill::sim
