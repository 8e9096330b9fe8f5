#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace smartmill::exchange {

/// An error document: code of the standard, text, status of HTTP.
struct AgentError {
  std::string code, text;
  int status = 400;
};

/// A request of a client, read from the target of an HTTP GET.
struct AgentRequest {
  enum class Kind { probe, current, sample, asset, assets } kind = Kind::probe;
  std::string device;  ///< name or UUID; empty: not given
  std::string path;    ///< XPath of the items; empty: all
  std::optional<std::uint64_t> from, at;
  std::optional<long> count;     ///< negative: backwards from `from`
  std::optional<int> interval;   ///< [ms] 0: at once; absent: one document
  int heartbeat = 10000;         ///< [ms]
  std::vector<std::string> ids;  ///< of assets
  std::string type;              ///< of assets; empty: all
};

/// @throws AgentError
AgentRequest readRequest(const std::string& target);

/// Items that an XPath selects, of the forms that clients use: steps after `/` or `//`, each a name or `*`
/// with
/// `[@attribute="value" and ...]`, joined by `|`. @return whether each item of the catalogue is selected
/// @throws AgentError INVALID_XPATH
std::vector<bool> selectedBy(const std::string& path, const std::string& device_name);

}  // namespace smartmill::exchange
