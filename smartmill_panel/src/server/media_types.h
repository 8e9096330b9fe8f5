#pragma once

#include <string>

namespace smartmill::panel {

/// Media type of a file of the page; empty: not served.
inline std::string mediaTypeOf(const std::string& path) {
  const std::string end = path.substr(path.rfind('.') + 1);
  if (end == "html") return "text/html; charset=utf-8";
  if (end == "js") return "text/javascript; charset=utf-8";
  if (end == "css") return "text/css; charset=utf-8";
  if (end == "png") return "image/png";
  if (end == "svg") return "image/svg+xml";
  return {};
}

}  // namespace smartmill::panel
