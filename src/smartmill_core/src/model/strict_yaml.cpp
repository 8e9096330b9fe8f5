#include "smartmill_core/model/strict_yaml.h"

#include <charconv>
#include <cmath>
#include <set>
#include <sstream>

#include <yaml-cpp/yaml.h>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"

namespace smartmill {

namespace {

// A value of the file for messages, in one line.
std::string displayed(const YAML::Node& node) {
  switch (node.Type()) {
    case YAML::NodeType::Scalar:
      return "'" + node.Scalar() + "'";
    case YAML::NodeType::Sequence:
      return "a list of " + std::to_string(node.size());
    case YAML::NodeType::Map:
      return "a map";
    default:
      return "nothing";
  }
}

bool quoted(const YAML::Node& node) {
  return node.Tag() == "!";
}

// YAML's decimal numbers; no hexadecimal, no words.
bool parse(const YAML::Node& node, double* value) {
  if (!node.IsScalar() || quoted(node)) return false;
  const std::string& text = node.Scalar();
  if (text == ".nan" || text == ".NaN" || text == ".NAN") {
    *value = std::nan("");
    return true;
  }
  const char* first = text.data();
  const char* last = first + text.size();
  if (first != last && *first == '+') ++first;
  const auto [end, code] = std::from_chars(first, last, *value);
  if (code == std::errc::result_out_of_range) *value = HUGE_VAL;
  return first != last && end == last && (code == std::errc() || code == std::errc::result_out_of_range);
}

std::string lineOf(const std::string& text) {
  const std::size_t end = text.find('\n');
  return end == std::string::npos ? text : text.substr(0, end);
}

}  // namespace

struct StrictYaml::Impl {
  YAML::Node node;
  std::string file;
  std::string path;  // with a dot at the end, empty at the root
  std::set<std::string> read;

  static std::shared_ptr<Impl> make(const YAML::Node& node, const std::string& file,
                                    const std::string& path) {
    auto impl = std::make_shared<Impl>();
    impl->node.reset(node);
    impl->file = file;
    impl->path = path;
    std::set<std::string> names;
    for (const auto& entry : node) {
      const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "?";
      if (!names.insert(key).second) throw Error(file + ": " + path + key + ": the key occurs twice");
    }
    return impl;
  }

  // Const lookup: operator[] of a mutable node would add the key.
  YAML::Node find(const std::string& key) const {
    const YAML::Node& fixed = node;
    const YAML::Node found = fixed[key];
    return found.IsDefined() ? found : YAML::Node(YAML::NodeType::Undefined);
  }
};

StrictYaml StrictYaml::fromFile(const std::string& file) {
  YAML::Node root;
  try {
    root = YAML::Load(readText(file));
  } catch (const YAML::Exception& error) {
    throw Error(file + ": not a YAML file: " + lineOf(error.what()));
  }
  if (root.IsNull()) throw Error(file + ": is empty");
  if (!root.IsMap()) throw Error(file + ": expected a map of keys, found " + displayed(root));
  return StrictYaml(Impl::make(root, file, ""));
}

bool StrictYaml::has(const std::string& key) const {
  return impl_->find(key).IsDefined();
}

bool StrictYaml::isList(const std::string& key) const {
  return has(key) && impl_->find(key).IsSequence();
}

std::vector<std::string> StrictYaml::keys() const {
  std::vector<std::string> names;
  for (const auto& entry : impl_->node) names.push_back(entry.first.Scalar());
  return names;
}

const std::string& StrictYaml::file() const {
  return impl_->file;
}

std::string StrictYaml::path(const std::string& key) const {
  return impl_->path + key;
}

void StrictYaml::fail(const std::string& key, const std::string& what) const {
  throw Error(impl_->file + ": " + path(key) + ": " + what);
}

double StrictYaml::number(const std::string& key, const Range& range) const {
  const YAML::Node node = impl_->find(key);
  if (!node.IsDefined()) fail(key, "is missing");
  impl_->read.insert(key);
  double value = 0.0;
  if (!parse(node, &value)) fail(key, displayed(node) + " is not a number");
  if (!std::isfinite(value)) fail(key, displayed(node) + " is not a finite number");
  if (!range.contains(value)) fail(key, outOfRange(value, range));
  return value;
}

int StrictYaml::integer(const std::string& key, int low, int high) const {
  const double value = number(key, {static_cast<double>(low), static_cast<double>(high), false, false});
  if (value != std::floor(value)) fail(key, shortNumber(value) + " is not an integer");
  return static_cast<int>(value);
}

std::string StrictYaml::word(const std::string& key) const {
  const YAML::Node node = impl_->find(key);
  if (!node.IsDefined()) fail(key, "is missing");
  impl_->read.insert(key);
  if (!node.IsScalar()) fail(key, displayed(node) + " is not a word");
  if (node.Scalar().empty()) fail(key, "is empty");
  return node.Scalar();
}

std::string StrictYaml::oneOf(const std::string& key, const std::vector<std::string>& words) const {
  const std::string value = word(key);
  std::string allowed;
  for (const std::string& candidate : words) {
    if (value == candidate) return value;
    allowed += (allowed.empty() ? "" : " | ") + candidate;
  }
  fail(key, "'" + value + "' is not one of " + allowed);
}

std::vector<double> StrictYaml::numbers(const std::string& key, std::size_t count, const Range& range) const {
  const YAML::Node node = impl_->find(key);
  if (!node.IsDefined()) fail(key, "is missing");
  impl_->read.insert(key);
  if (!node.IsSequence()) fail(key, displayed(node) + " is not a list of numbers");
  if (count == 0 ? node.size() == 0 : node.size() != count) {
    fail(key, "a list of " + std::to_string(node.size()) + ", expected " +
                  (count ? std::to_string(count) : "one or more") + " numbers");
  }
  std::vector<double> values;
  for (std::size_t i = 0; i < node.size(); ++i) {
    const std::string item = key + "[" + std::to_string(i) + "]";
    double value = 0.0;
    if (!parse(node[i], &value)) fail(item, displayed(node[i]) + " is not a number");
    if (!std::isfinite(value)) fail(item, displayed(node[i]) + " is not a finite number");
    if (!range.contains(value)) fail(item, outOfRange(value, range));
    values.push_back(value);
  }
  return values;
}

StrictYaml StrictYaml::map(const std::string& key) const {
  const YAML::Node node = impl_->find(key);
  if (!node.IsDefined()) fail(key, "is missing");
  impl_->read.insert(key);
  if (!node.IsMap()) fail(key, displayed(node) + " is not a map of keys");
  return StrictYaml(Impl::make(node, impl_->file, impl_->path + key + "."));
}

std::vector<StrictYaml> StrictYaml::maps(const std::string& key) const {
  const YAML::Node node = impl_->find(key);
  if (!node.IsDefined()) fail(key, "is missing");
  impl_->read.insert(key);
  if (!node.IsSequence()) fail(key, displayed(node) + " is not a list");
  std::vector<StrictYaml> list;
  for (std::size_t i = 0; i < node.size(); ++i) {
    const std::string item = key + "[" + std::to_string(i) + "]";
    if (!node[i].IsMap()) fail(item, displayed(node[i]) + " is not a map of keys");
    list.push_back(StrictYaml(Impl::make(node[i], impl_->file, impl_->path + item + ".")));
  }
  return list;
}

std::optional<double> StrictYaml::optionalNumber(const std::string& key, const Range& range) const {
  if (!has(key)) return std::nullopt;
  return number(key, range);
}

std::optional<StrictYaml> StrictYaml::optionalMap(const std::string& key) const {
  if (!has(key)) return std::nullopt;
  return map(key);
}

void StrictYaml::finish() const {
  for (const auto& entry : impl_->node) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "?";
    if (!impl_->read.count(key)) fail(key, "unknown key (its value: " + displayed(entry.second) + ")");
  }
}

namespace {

// YAML 1.1 parses 5e-05 as a word: a point is required.
std::string withPoint(std::string number) {
  if (number.find_first_of(".n") == std::string::npos) {
    const std::size_t exponent = number.find('e');
    number.insert(exponent == std::string::npos ? number.size() : exponent, ".0");
  }
  return number;
}

}  // namespace

std::string yamlNumber(double value, int digits) {
  return withPoint(formatted("%.*g", digits, value));
}

std::string yamlNumberExact(double value) {
  char text[40];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  return withPoint(std::string(text, end));
}

std::string yamlWord(const std::string& word) {
  bool plain = !word.empty();
  for (const char c : word) plain = plain && (std::isalnum(static_cast<unsigned char>(c)) || c == '_');
  double unused = 0.0;
  const auto parsed = std::from_chars(word.data(), word.data() + word.size(), unused);
  for (const char* special : {"true", "false", "yes", "no", "on", "off", "null", "y", "n"}) {
    plain = plain && word != special;
  }
  if (plain && parsed.ptr == word.data()) return word;
  YAML::Emitter out;
  out << YAML::DoubleQuoted << word;
  return out.c_str();
}

}  // namespace smartmill
