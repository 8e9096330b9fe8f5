#include "smartmill_panel/server/command_gate.h"

#include <cctype>
#include <filesystem>
#include <fstream>

#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"

namespace smartmill::panel {
namespace {

constexpr int FORBIDDEN = 403, NOT_ALLOWED = 405, UNAUTHORIZED = 401;

// In a time that does not tell how much of it is right.
bool same(const std::string& a, const std::string& b) {
  unsigned char different = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < a.size(); ++i)
    different |= static_cast<unsigned char>(a[i] ^ (b.empty() ? '\0' : b[i % b.size()]));
  return different == 0;
}

}  // namespace

CommandGate::CommandGate(const std::string& token_file) {
  namespace fs = std::filesystem;
  std::ifstream in(token_file);
  if (!in.is_open() || !std::getline(in, token_))
    throw Error("token_file " + token_file + ": cannot be read");
  std::error_code failed;
  const fs::perms others = fs::perms::group_all | fs::perms::others_all;
  if ((fs::status(token_file, failed).permissions() & others) != fs::perms::none)
    throw Error("token_file " + token_file + ": others may read it (chmod 600 is due)");
  while (!token_.empty() && std::isspace(static_cast<unsigned char>(token_.back()))) token_.pop_back();
  if (token_.size() < LEAST)
    throw Error("token_file " + token_file + ": a token of at least " + std::to_string(LEAST) +
                " characters is due");
}

std::optional<Answer> CommandGate::refusal(const Question& command) const {
  if (!open()) return answerOf(FORBIDDEN, "this panel is read-only (it was started without allow_commands)");
  if (!command.post) return answerOf(NOT_ALLOWED, "a command comes by POST");
  if (!same(command.token, token_)) return answerOf(UNAUTHORIZED, "the token is missing or wrong");
  return {};
}

Answer answerOf(int status, const std::string& line) {
  return {status,
          nlohmann::json({{"message", line}}).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)};
}

std::string oneLine(const std::string& text, std::size_t most) {
  std::string line = text.substr(0, most);
  for (char& c : line)
    if (std::iscntrl(static_cast<unsigned char>(c))) c = ' ';
  return line;
}

}  // namespace smartmill::panel
