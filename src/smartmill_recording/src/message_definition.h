#pragma once

#include <string>

namespace smartmill {

/// MD5 sum of a message type by its full definition (the message's text, then each contained message behind a
/// line of '=' and "MSG: PACKAGE/NAME"), as genmsg computes it: comments left out, constants first, contained
/// messages by their own sums.
/// @return empty: the definition is incomplete
std::string definitionMd5(const std::string& type, const std::string& definition);

/// The same without constants: equal where messages have the same fields in the same order, and so the same
/// bytes.
std::string fieldsMd5(const std::string& type, const std::string& definition);

}  // namespace smartmill
