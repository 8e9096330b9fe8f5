#pragma once

#include <optional>
#include <string>

#include "smartmill_panel/server/server.h"

namespace smartmill::panel {

/// Authorisation of commands. Closed by default; an open gate requires the token of a file that only the
/// operator can read.
class CommandGate {
 public:
  /// Closed.
  CommandGate() = default;
  /// @param token_file its first line is the token. @throws Error naming the file if it cannot be read, if
  /// others may read it, or if the token is shorter than MIN_LENGTH characters
  explicit CommandGate(const std::string& token_file);

  static constexpr std::size_t MIN_LENGTH = 16;

  bool open() const { return !token_.empty(); }
  /// Response to an unauthorised command; empty: authorised.
  std::optional<ApiResponse> refusal(const ApiRequest& command) const;

 private:
  std::string token_;
};

/// JSON response {"message": line}
ApiResponse messageResponse(int status, const std::string& line);

/// Text as one line: control characters become blanks. @param length truncated to this
std::string oneLine(const std::string& text, std::size_t length = 200);

}  // namespace smartmill::panel
