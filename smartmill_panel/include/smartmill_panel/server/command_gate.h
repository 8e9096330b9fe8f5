#pragma once

#include <optional>
#include <string>

#include "smartmill_panel/server/server.h"

namespace smartmill::panel {

/// Who may command. A panel is read-only unless it was started otherwise, and then each command carries the
/// token of a file that only the operator can read.
class CommandGate {
 public:
  /// Closed.
  CommandGate() = default;
  /// @param token_file its first line is the token. @throws Error naming the file when it cannot be read,
  /// when others may read it, or when the token is shorter than LEAST characters
  explicit CommandGate(const std::string& token_file);

  static constexpr std::size_t LEAST = 16;

  bool open() const { return !token_.empty(); }
  /// What a command is answered when it may not pass; empty: it may.
  std::optional<Answer> refusal(const Question& command) const;

 private:
  std::string token_;
};

/// {"message": line}
Answer answerOf(int status, const std::string& line);

/// First line for people of what was sent: control characters are replaced, the rest is cut off.
std::string oneLine(const std::string& text, std::size_t most = 200);

}  // namespace smartmill::panel
