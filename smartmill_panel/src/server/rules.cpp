// Access rules: permitted origins, hosts and files.
#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>

#include "server/media_types.h"
#include "smartmill_panel/server/server.h"

namespace smartmill::panel {
namespace {

bool contains(const std::vector<std::string>& list, const std::string& word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

// Host name without the port; the brackets of [::1]:8090 stay.
std::string nameOf(const std::string& host) {
  const auto colon = host.rfind(':');
  const auto bracket = host.rfind(']');
  if (colon == std::string::npos || (bracket != std::string::npos && colon < bracket)) return host;
  return host.substr(0, colon);
}

bool plainAddress(const std::string& name) {
  if (name.size() > 2 && name.front() == '[' && name.back() == ']') return true;
  return !name.empty() &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) { return std::isdigit(c) || c == '.'; });
}

int hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  const char lower = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return lower >= 'a' && lower <= 'f' ? lower - 'a' + 10 : -1;
}

std::string decoded(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size() && hexDigit(text[i + 1]) >= 0 && hexDigit(text[i + 2]) >= 0) {
      out += static_cast<char>(16 * hexDigit(text[i + 1]) + hexDigit(text[i + 2]));
      i += 2;
    } else {
      out += text[i] == '+' ? ' ' : text[i];
    }
  }
  return out;
}

}  // namespace

bool originAllowed(const std::string& origin, const std::string& host, const ServerOptions& options) {
  const std::string name = nameOf(host);
  const bool permitted = name == "localhost" || plainAddress(name) || contains(options.names, name);
  if (!permitted) return false;
  return origin.empty() || origin == "http://" + host || contains(options.origins, origin);
}

std::string fileOf(const std::string& folder, const std::string& target) {
  namespace fs = std::filesystem;
  std::string path = target.substr(0, target.find_first_of("?#"));
  if (path == "/") path = "/index.html";
  if (path == "/phone") path = "/phone.html";
  const bool plain = std::all_of(path.begin(), path.end(), [](unsigned char c) {
    return std::isalnum(c) || c == '.' || c == '_' || c == '-' || c == '/';
  });
  if (!plain || path.empty() || path.front() != '/' || path.find("/.") != std::string::npos ||
      mediaTypeOf(path).empty())
    return {};
  std::error_code failed;
  const fs::path root = fs::canonical(folder, failed);
  if (failed) return {};
  const fs::path file = fs::canonical(root.string() + path, failed);
  if (failed || !fs::is_regular_file(file, failed)) return {};
  const auto inside = std::mismatch(root.begin(), root.end(), file.begin(), file.end());
  return inside.first == root.end() ? file.string() : std::string();
}

std::map<std::string, std::string> queryOf(const std::string& target) {
  std::map<std::string, std::string> query;
  const auto begin = target.find('?');
  if (begin == std::string::npos) return query;
  std::string rest = target.substr(begin + 1, target.find('#') - begin - 1);
  while (!rest.empty()) {
    const auto end = rest.find('&');
    const std::string part = rest.substr(0, end);
    const auto equal = part.find('=');
    if (!part.empty())
      query[decoded(part.substr(0, equal))] =
          equal == std::string::npos ? "" : decoded(part.substr(equal + 1));
    rest = end == std::string::npos ? "" : rest.substr(end + 1);
  }
  return query;
}

}  // namespace smartmill::panel
