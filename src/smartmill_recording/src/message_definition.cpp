#include "message_definition.h"

#include <map>
#include <set>
#include <sstream>

#include "checksum.h"

namespace smartmill {
namespace {

constexpr const char* BLANK = " \t\r";
constexpr const char* CONTAINED = "MSG: ";
constexpr int DEEPEST = 50;  // messages within each other; real ones have five

const std::set<std::string>& builtins() {
  static const std::set<std::string> NAMES{"bool",    "char",   "byte",   "int8",    "uint8",  "int16",
                                           "uint16",  "int32",  "uint32", "int64",   "uint64", "float32",
                                           "float64", "string", "time",   "duration"};
  return NAMES;
}

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(BLANK);
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(BLANK) - begin + 1);
}

/// Texts of the contained messages by name; the first by the given name.
std::map<std::string, std::string> textsOf(const std::string& type, const std::string& definition) {
  std::map<std::string, std::string> texts;
  std::string name = type, line;
  bool behind_separator = false;
  std::istringstream in(definition);
  while (std::getline(in, line)) {
    if (line.size() >= 4 && line.find_first_not_of("=\r") == std::string::npos) {
      behind_separator = true;
    } else if (behind_separator && line.rfind(CONTAINED, 0) == 0) {
      name = trimmed(line.substr(std::string(CONTAINED).size()));
      behind_separator = false;
    } else {
      texts[name] += line + "\n";
    }
  }
  texts[name];
  return texts;
}

class Sums {
 public:
  Sums(std::map<std::string, std::string> texts, bool with_constants)
      : texts_(std::move(texts)), with_constants_(with_constants) {}

  /// @return empty: incomplete, or nested deeper than DEEPEST
  std::string of(const std::string& type) {
    const auto known = sums_.find(type);
    if (known != sums_.end()) return known->second;
    sums_[type];  // empty while its own text is read: a message that contains itself has no sum
    const auto text = texts_.find(type);
    if (text == texts_.end() || depth_ >= DEEPEST) return {};
    ++depth_;
    std::string found = sum(type, text->second);
    --depth_;
    return sums_[type] = std::move(found);
  }

 private:
  std::string sum(const std::string& type, const std::string& text) {
    std::string constants, fields, line;
    std::istringstream in(text);
    while (std::getline(in, line)) {
      const std::string plain = trimmed(line.substr(0, line.find('#')));
      if (plain.empty()) continue;
      const std::size_t gap = plain.find_first_of(BLANK);
      if (gap == std::string::npos) return {};
      const std::string kind = plain.substr(0, gap);
      const std::size_t sign = plain.find('=');
      if (sign != std::string::npos) {
        // A string's value is all that follows, '#' too.
        const std::string value = kind == "string" ? line.substr(line.find('=') + 1) : plain.substr(sign + 1);
        if (with_constants_)
          constants += kind + " " + trimmed(plain.substr(gap, sign - gap)) + "=" + trimmed(value) + "\n";
        continue;
      }
      const std::string name = trimmed(plain.substr(gap));
      const std::string base = kind.substr(0, kind.find('['));
      if (builtins().count(base) != 0) {
        fields += kind + " " + name + "\n";
      } else {
        const std::string contained = of(resolved(base, type));
        if (contained.empty()) return {};
        fields += contained + " " + name + "\n";
      }
    }
    return md5(trimmedEnd(constants + fields));
  }

  static std::string trimmedEnd(const std::string& text) {
    return text.substr(0, text.find_last_not_of('\n') + 1);
  }
  static std::string resolved(const std::string& base, const std::string& inside) {
    if (base.find('/') != std::string::npos) return base;
    return base == "Header" ? "std_msgs/Header" : inside.substr(0, inside.find('/') + 1) + base;
  }

  std::map<std::string, std::string> texts_, sums_;
  bool with_constants_;
  int depth_ = 0;
};

}  // namespace

std::string definitionMd5(const std::string& type, const std::string& definition) {
  return Sums(textsOf(type, definition), true).of(type);
}

std::string fieldsMd5(const std::string& type, const std::string& definition) {
  return Sums(textsOf(type, definition), false).of(type);
}

}  // namespace smartmill
