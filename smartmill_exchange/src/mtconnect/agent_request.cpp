#include "smartmill_exchange/mtconnect/agent_request.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <set>

#include "smartmill_exchange/items/catalogue.h"

namespace smartmill::exchange {
namespace {

constexpr std::size_t LONGEST = 4096;                         // [byte] of a target
constexpr int LONGEST_INTERVAL = 3600000;                     // [ms]
constexpr int LEAST_HEARTBEAT = 1, MOST_HEARTBEAT = 3600000;  // [ms]

[[noreturn]] void refuse(const char* code, const std::string& text, int status = 400) {
  throw AgentError{code, text, status};
}

int hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  const char lower = static_cast<char>(c | 0x20);
  return lower >= 'a' && lower <= 'f' ? lower - 'a' + 10 : -1;
}

std::string decoded(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      out += text[i] == '+' ? ' ' : text[i];
      continue;
    }
    const int high = i + 2 < text.size() ? hexDigit(text[i + 1]) : -1;
    const int low = high < 0 ? -1 : hexDigit(text[i + 2]);
    if (low < 0) refuse("INVALID_URI", "expected two hexadecimal digits after %");
    out += static_cast<char>(16 * high + low);
    i += 2;
  }
  return out;
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == separator) {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

template <class Number>
Number numberOf(const std::string& key, const std::string& text) {
  Number value{};
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (failed == std::errc::result_out_of_range) refuse("OUT_OF_RANGE", key + "=" + text + ": out of range");
  if (failed != std::errc() || end != text.data() + text.size())
    refuse("INVALID_REQUEST", key + "=" + text + ": expected an integer");
  return value;
}

int milliseconds(const std::string& key, const std::string& text, int least, int most) {
  const int value = numberOf<int>(key, text);
  if (value < least || value > most)
    refuse("OUT_OF_RANGE",
           key + "=" + text + ": expected " + std::to_string(least) + " to " + std::to_string(most) + " ms");
  return value;
}

const std::map<std::string, AgentRequest::Kind>& kinds() {
  using Kind = AgentRequest::Kind;
  static const std::map<std::string, Kind> KINDS{{"probe", Kind::probe},
                                                 {"current", Kind::current},
                                                 {"sample", Kind::sample},
                                                 {"asset", Kind::asset},
                                                 {"assets", Kind::assets}};
  return KINDS;
}

void setKey(const std::string& key, const std::string& value, AgentRequest* request) {
  using Kind = AgentRequest::Kind;
  static const std::map<Kind, std::set<std::string>> KEYS{
      {Kind::probe, {"deviceType"}},
      {Kind::current, {"path", "at", "interval", "heartbeat", "deviceType"}},
      {Kind::sample, {"path", "from", "count", "interval", "heartbeat", "deviceType"}},
      {Kind::asset, {"type", "count", "removed"}},
      {Kind::assets, {"type", "count", "removed"}}};
  const std::set<std::string>& keys = KEYS.at(request->kind);
  if (!keys.count(key)) {
    std::string list;
    for (const std::string& one : keys) list += (list.empty() ? "" : ", ") + one;
    refuse("INVALID_REQUEST", "unknown parameter '" + key + "', expected " + list);
  }
  if (key == "path") request->path = value;
  if (key == "from") request->from = numberOf<std::uint64_t>(key, value);
  if (key == "at") request->at = numberOf<std::uint64_t>(key, value);
  if (key == "count") request->count = numberOf<long>(key, value);
  if (key == "interval") request->interval = milliseconds(key, value, 0, LONGEST_INTERVAL);
  if (key == "heartbeat") request->heartbeat = milliseconds(key, value, LEAST_HEARTBEAT, MOST_HEARTBEAT);
  if (key == "type") request->type = value;
}

/// One step of an XPath.
struct Step {
  bool anywhere = false;  // after `//`
  std::string name;       // or `*`
  std::vector<std::pair<std::string, std::string>> attributes;
};

/// An element of the device model with its attributes.
struct Element {
  std::string name;
  std::map<std::string, std::string> attributes;
};

class PathReader {
 public:
  explicit PathReader(const std::string& text) : text_(text) {}

  std::vector<std::vector<Step>> read() {
    std::vector<std::vector<Step>> paths(1);
    while (true) {
      blanks();
      if (at_ == text_.size() || text_[at_] != '/') fail();
      paths.back().push_back(step());
      blanks();
      if (at_ == text_.size()) return paths;
      if (text_[at_] == '|') {
        ++at_;
        paths.emplace_back();
      }
    }
  }

 private:
  [[noreturn]] static void fail() {
    refuse("INVALID_XPATH", "path: expected steps as //Name or //Name[@attribute=\"value\"], joined by |");
  }
  void blanks() {
    while (at_ < text_.size() && text_[at_] == ' ') ++at_;
  }
  void expect(char c) {
    blanks();
    if (at_ == text_.size() || text_[at_] != c) fail();
    ++at_;
  }
  std::string word() {
    std::string name;
    while (at_ < text_.size() &&
           (std::isalnum(static_cast<unsigned char>(text_[at_])) || text_[at_] == '_' || text_[at_] == ':'))
      name += text_[at_++];
    if (name.empty()) fail();
    return name;
  }
  Step step() {
    Step step;
    expect('/');
    if (at_ < text_.size() && text_[at_] == '/') {
      ++at_;
      step.anywhere = true;
    }
    if (at_ < text_.size() && text_[at_] == '*') {
      ++at_;
      step.name = "*";
    } else {
      step.name = word();
    }
    while (at_ < text_.size() && text_[at_] == '[') predicate(&step);
    return step;
  }
  void predicate(Step* step) {
    expect('[');
    while (true) {
      expect('@');
      const std::string name = word();
      expect('=');
      blanks();
      const char quote = at_ < text_.size() ? text_[at_] : ' ';
      if (quote != '"' && quote != '\'') fail();
      const std::size_t end = text_.find(quote, at_ + 1);
      if (end == std::string::npos) fail();
      step->attributes.emplace_back(name, text_.substr(at_ + 1, end - at_ - 1));
      at_ = end + 1;
      blanks();
      if (text_.compare(at_, 4, "and ") != 0) break;
      at_ += 4;
    }
    expect(']');
  }

  const std::string& text_;
  std::size_t at_ = 0;
};

bool matches(const Step& step, const Element& element) {
  if (step.name != "*" && step.name != element.name) return false;
  return std::all_of(step.attributes.begin(), step.attributes.end(), [&](const auto& attribute) {
    const auto found = element.attributes.find(attribute.first);
    return found != element.attributes.end() && found->second == attribute.second;
  });
}

/// Whether the steps from `step` on select the item at the end of the chain, or an element that contains it.
bool selects(const std::vector<Step>& steps, std::size_t step, const std::vector<Element>& chain,
             std::size_t at) {
  if (step == steps.size()) return true;
  for (std::size_t k = at; k < chain.size(); ++k) {
    if (matches(steps[step], chain[k]) && selects(steps, step + 1, chain, k + 1)) return true;
    if (!steps[step].anywhere) return false;
  }
  return false;
}

/// The elements that contain an item, from the root to the item.
std::vector<Element> chainOf(const DataItem& item, const std::string& device_name) {
  std::vector<Element> inner;
  std::string id = item.component;
  while (!id.empty()) {
    for (const Component& component : components()) {
      if (component.id != id) continue;
      inner.push_back({component.element, {{"id", component.id}, {"name", component.name}}});
      inner.push_back({"Components", {}});
      id = component.parent;
      break;
    }
  }
  std::vector<Element> chain{{"MTConnectDevices", {}}, {"Devices", {}}, {"Device", {{"name", device_name}}}};
  chain.insert(chain.end(), inner.rbegin(), inner.rend());
  chain.push_back({"DataItems", {}});
  std::map<std::string, std::string> attributes{
      {"id", item.id}, {"name", item.id}, {"category", nameOf(item.category)}, {"type", item.type}};
  if (!item.sub_type.empty()) attributes["subType"] = item.sub_type;
  if (!item.statistic.empty()) attributes["statistic"] = item.statistic;
  if (!item.units.empty()) attributes["units"] = item.units;
  chain.push_back({"DataItem", attributes});
  return chain;
}

}  // namespace

AgentRequest readRequest(const std::string& target) {
  using Kind = AgentRequest::Kind;
  if (target.size() > LONGEST)
    refuse("INVALID_URI", "longer than " + std::to_string(LONGEST) + " bytes", 414);
  if (target.empty() || target.front() != '/') refuse("INVALID_URI", "expected a path that begins with /");
  const std::size_t question = target.find('?');
  std::vector<std::string> parts;
  for (const std::string& part :
       split(target.substr(1, question == std::string::npos ? question : question - 1), '/'))
    if (!part.empty()) parts.push_back(decoded(part));

  AgentRequest request;
  // DEVICE/KIND, KIND, DEVICE, or asset/ID;ID
  std::size_t at = 0;
  if (!parts.empty() && !kinds().count(parts[0])) request.device = parts[at++];
  if (at < parts.size()) {
    const auto kind = kinds().find(parts[at]);
    if (kind == kinds().end())
      refuse("UNSUPPORTED", "'" + parts[at] + "': expected probe, current, sample, asset or assets", 404);
    request.kind = kind->second;
    ++at;
  }
  const bool of_assets = request.kind == Kind::asset || request.kind == Kind::assets;
  if (of_assets && at < parts.size()) {
    for (const std::string& id : split(parts[at], ';'))
      if (!id.empty()) request.ids.push_back(id);
    ++at;
  }
  if (at < parts.size())
    refuse("INVALID_URI", "'" + parts[at] + "': nothing expected after the request", 404);

  if (question != std::string::npos) {
    for (const std::string& part : split(target.substr(question + 1), '&')) {
      if (part.empty()) continue;
      const std::size_t equal = part.find('=');
      if (equal == std::string::npos)
        refuse("INVALID_REQUEST", "parameter '" + decoded(part) + "': expected KEY=VALUE");
      setKey(decoded(part.substr(0, equal)), decoded(part.substr(equal + 1)), &request);
    }
  }
  if (request.at && request.interval) refuse("INVALID_REQUEST", "at and interval exclude each other");
  return request;
}

std::vector<bool> selectedBy(const std::string& path, const std::string& device_name) {
  std::vector<bool> selected(catalogue().size(), path.empty());
  if (path.empty()) return selected;
  const std::vector<std::vector<Step>> paths = PathReader(path).read();
  for (std::size_t i = 0; i < selected.size(); ++i) {
    const std::vector<Element> chain = chainOf(catalogue()[i], device_name);
    selected[i] = std::any_of(paths.begin(), paths.end(),
                              [&](const std::vector<Step>& steps) { return selects(steps, 0, chain, 0); });
  }
  if (std::none_of(selected.begin(), selected.end(), [](bool one) { return one; }))
    refuse("INVALID_XPATH", "path: no data item of this machine is selected");
  return selected;
}

}  // namespace smartmill::exchange
