#pragma once

#include <string>

#include "smartmill_exchange/items/asset.h"

namespace smartmill::exchange {

/// Namespace of this project's extension of MTConnect: types of data items and of assets.
constexpr const char* EXTENSION = "urn:smartmill:MTConnect:1.0";

/// Text as content or attribute of XML: escaped, control characters are blanks.
std::string xmlText(const std::string& text);

/// The asset as one XML element on several lines, with its own declaration of the namespace.
std::string assetXml(const Asset& asset, const std::string& device_uuid);

}  // namespace smartmill::exchange
