#include "smartmill_panel/server/command_gate.h"

#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/io/secret_file.h"

namespace smartmill::panel {
namespace {

constexpr int FORBIDDEN = 403, NOT_ALLOWED = 405, UNAUTHORIZED = 401;

// The run time does not depend on the number of matching characters.
bool equalInConstantTime(const std::string& a, const std::string& b) {
  unsigned char different = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < a.size(); ++i)
    different |= static_cast<unsigned char>(a[i] ^ (b.empty() ? '\0' : b[i % b.size()]));
  return different == 0;
}

}  // namespace

CommandGate::CommandGate(const std::string& token_file) : token_(readSecret("token_file", token_file)) {
  if (token_.size() < MIN_LENGTH)
    throw Error("token_file " + token_file + ": expected a token of at least " + std::to_string(MIN_LENGTH) +
                " characters");
}

std::optional<ApiResponse> CommandGate::refusal(const ApiRequest& command) const {
  if (!open())
    return messageResponse(FORBIDDEN, "this panel is read-only (it was started without allow_commands)");
  if (!command.post) return messageResponse(NOT_ALLOWED, "a command requires POST");
  if (!equalInConstantTime(command.token, token_))
    return messageResponse(UNAUTHORIZED, "the token is missing or wrong");
  return {};
}

ApiResponse messageResponse(int status, const std::string& line) {
  return {status,
          nlohmann::json({{"message", line}}).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)};
}

std::string oneLine(const std::string& text, std::size_t length) {
  std::string line = text.substr(0, length);
  for (char& c : line)
    if (std::iscntrl(static_cast<unsigned char>(c))) c = ' ';
  return line;
}

}  // namespace smartmill::panel
