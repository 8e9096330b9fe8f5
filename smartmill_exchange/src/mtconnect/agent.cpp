#include "smartmill_exchange/mtconnect/agent.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>

#include "smartmill_core/error.h"
#include "smartmill_exchange/items/catalogue.h"
#include "smartmill_exchange/mtconnect/asset_document.h"

namespace smartmill::exchange {
namespace {

constexpr const char* VERSION = "1.8";
constexpr const char* DECLARATION = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
constexpr std::size_t DEFAULT_COUNT = 100;  // [1] observations of a sample, as the standard states

std::string attribute(const char* name, const std::string& value) {
  return std::string(" ") + name + "=\"" + xmlText(value) + "\"";
}

std::string optionalAttribute(const char* name, const std::string& value) {
  return value.empty() ? "" : attribute(name, value);
}

std::string attribute(const char* name, std::uint64_t value) {
  return attribute(name, std::to_string(value));
}

/// ROTARY_VELOCITY: RotaryVelocity; s:DEPTH_LIMIT: s:DepthLimit.
std::string elementName(const DataItem& item) {
  const std::size_t colon = item.type.find(':');
  std::string name = colon == std::string::npos ? "" : item.type.substr(0, colon + 1);
  bool capital = true;
  for (std::size_t i = colon == std::string::npos ? 0 : colon + 1; i < item.type.size(); ++i) {
    const char c = item.type[i];
    if (c != '_') name += capital ? c : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    capital = c == '_';
  }
  return item.set ? name + "DataSet" : name;
}

std::string dataItemXml(const DataItem& item, const std::string& indent) {
  std::string xml = indent + "<DataItem" + attribute("category", nameOf(item.category)) +
                    attribute("id", item.id) + attribute("name", item.id) + attribute("type", item.type) +
                    optionalAttribute("subType", item.sub_type) +
                    optionalAttribute("statistic", item.statistic) + optionalAttribute("units", item.units);
  if (item.set) xml += attribute("representation", "DATA_SET");
  if (item.type == "POSITION") xml += attribute("coordinateSystem", "MACHINE");
  return xml + ">\n" + indent + "  <Definition><Description>" +
         xmlText(item.meaning + "; uncertainty: " + item.uncertainty + "; bandwidth: " + item.bandwidth) +
         "</Description></Definition>\n" + indent + "</DataItem>\n";
}

std::string dataItemsXml(const std::string& component, const std::string& indent) {
  std::string xml;
  for (const DataItem& item : catalogue())
    if (item.component == component) xml += dataItemXml(item, indent + "  ");
  return xml.empty() ? "" : indent + "<DataItems>\n" + xml + indent + "</DataItems>\n";
}

std::string componentsXml(const std::string& parent, const std::string& indent) {
  std::string xml;
  for (const Component& c : components()) {
    if (c.parent != parent) continue;
    xml += indent + "  <" + c.element + attribute("id", c.id) + attribute("name", c.name) + ">\n" +
           dataItemsXml(c.id, indent + "    ") + componentsXml(c.id, indent + "    ") + indent + "  </" +
           c.element + ">\n";
  }
  return xml.empty() ? "" : indent + "<Components>\n" + xml + indent + "</Components>\n";
}

std::string conditionXml(const DataItem& item, const ConditionChange& change, const std::string& common) {
  using Level = ConditionChange::Level;
  const char* element = change.level == Level::unavailable ? "Unavailable"
                        : change.level == Level::normal    ? "Normal"
                        : change.level == Level::warning   ? "Warning"
                                                           : "Fault";
  const std::string begin = "<" + std::string(element) + common + attribute("type", item.type) +
                            optionalAttribute("nativeCode", change.code);
  return change.text.empty() ? begin + "/>" : begin + ">" + xmlText(change.text) + "</" + element + ">";
}

std::string observationXml(const Record& record) {
  const DataItem& item = catalogue()[record.item];
  std::string common = attribute("dataItemId", item.id) + attribute("timestamp", timeText(record.time)) +
                       attribute("sequence", record.sequence) + attribute("name", item.id) +
                       optionalAttribute("subType", item.sub_type);
  if (const auto* change = std::get_if<ConditionChange>(&record.content))
    return conditionXml(item, *change, common);
  if (item.category == Category::sample) common += optionalAttribute("statistic", item.statistic);
  std::string content = "UNAVAILABLE";
  const bool of_asset = item.source == "assets";
  const auto* text = std::get_if<Text>(&record.content);
  if (of_asset) common += attribute("assetType", text ? text->asset_type : content);
  if (text) content = xmlText(text->text);
  if (const auto* number = std::get_if<double>(&record.content)) content = numberText(*number);
  if (item.set) {
    const auto* set = std::get_if<DataSet>(&record.content);
    common += attribute("count", set ? set->size() : 0);
    if (set) {
      content.clear();
      for (const auto& [key, number] : *set)
        content += "<Entry" + attribute("key", key) + ">" + numberText(number) + "</Entry>";
    }
  }
  const std::string element = elementName(item);
  return "<" + element + common + ">" + content + "</" + element + ">";
}

/// Records of one component by category, in the order of their sequence numbers.
using OfComponent = std::array<std::vector<const Record*>, 3>;
constexpr std::array<const char*, 3> ELEMENTS{
    {"Samples", "Events", "Condition"}};  // in the order of Category

std::string recordsXml(OfComponent records) {
  std::string xml;
  for (std::size_t category = 0; category < records.size(); ++category) {
    std::vector<const Record*>& list = records[category];
    if (list.empty()) continue;
    std::sort(list.begin(), list.end(),
              [](const Record* a, const Record* b) { return a->sequence < b->sequence; });
    xml += std::string("        <") + ELEMENTS[category] + ">\n";
    for (const Record* record : list) xml += "          " + observationXml(*record) + "\n";
    xml += std::string("        </") + ELEMENTS[category] + ">\n";
  }
  return xml;
}

std::string root(const char* kind, const std::string& content) {
  const std::string name = std::string("MTConnect") + kind;
  const std::string space = "urn:mtconnect.org:" + name + ":" + VERSION;
  return std::string(DECLARATION) + "<" + name + attribute("xmlns", space) + attribute("xmlns:m", space) +
         attribute("xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance") +
         attribute("xmlns:s", EXTENSION) +
         attribute("xsi:schemaLocation",
                   space + " http://schemas.mtconnect.org/schemas/" + name + "_" + VERSION + ".xsd") +
         ">\n" + content + "</" + name + ">\n";
}

}  // namespace

Agent::Agent(AgentOptions options, double now)
    : options_(std::move(options)), started_(now), buffer_(catalogue().size(), options_.buffer, now) {
  const bool name =
      !options_.device.empty() && !std::isdigit(static_cast<unsigned char>(options_.device.front())) &&
      std::all_of(options_.device.begin(), options_.device.end(),
                  [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '-' || c == '.'; });
  if (!name)
    throw Error("device: '" + options_.device +
                "', expected letters, digits, points, hyphens and underscores");
  if (options_.uuid.empty()) throw Error("uuid: empty, expected a name that is unique in the shop");
  if (options_.instance < 1) throw Error("instance: 0, expected a positive integer");
}

void Agent::store(const Asset& asset) {
  assets_.erase(std::remove_if(assets_.begin(), assets_.end(),
                               [&](const Asset& other) { return other.id == asset.id; }),
                assets_.end());
  assets_.push_front(asset);
  if (assets_.size() > options_.assets) assets_.pop_back();
}

std::string Agent::header(const char* kind, double now, const std::string& more) const {
  return root(kind, "  <Header" + attribute("creationTime", timeText(now)) +
                        attribute("sender", options_.sender) + attribute("instanceId", options_.instance) +
                        attribute("version", std::string(VERSION) + ".0.0") + more);
}

AgentAnswer Agent::answer(const std::string& target, double now) const {
  try {
    return answerOrThrow(readRequest(target), now);
  } catch (const AgentError& error) {
    return refuse(error, now);
  }
}

AgentAnswer Agent::refuse(const AgentError& error, double now) const {
  return {error.status, header("Error", now,
                               attribute("bufferSize", buffer_.capacity()) + "/>\n  <Errors>\n    <Error" +
                                   attribute("errorCode", error.code) + ">" + xmlText(error.text) +
                                   "</Error>\n  </Errors>\n")};
}

void Agent::requireDevice(const AgentRequest& request) const {
  if (!request.device.empty() && request.device != options_.device && request.device != options_.uuid)
    throw AgentError{"NO_DEVICE", "no device '" + request.device + "', expected " + options_.device, 404};
}

AgentAnswer Agent::answerOrThrow(const AgentRequest& request, double now) const {
  using Kind = AgentRequest::Kind;
  requireDevice(request);
  if (request.kind == Kind::probe) return {200, probe(now)};
  if (request.kind == Kind::asset || request.kind == Kind::assets) return assets(request, now);
  AgentStream stream;
  stream.selected = selectedBy(request.path, options_.device);
  stream.sample = request.kind == Kind::sample;
  stream.interval = 1e-3 * request.interval.value_or(0);
  stream.heartbeat = 1e-3 * request.heartbeat;
  stream.sent = now;
  AgentAnswer answer;
  if (stream.sample) {
    const long count = request.count.value_or(static_cast<long>(DEFAULT_COUNT));
    const auto most = static_cast<long>(buffer_.capacity());
    if (count == 0 || count > most || count < -most)
      throw AgentError{"OUT_OF_RANGE", "count=" + std::to_string(count) + ": expected 1 to " +
                                           std::to_string(most) + ", or negative"};
    if (count < 0 && request.interval)
      throw AgentError{"INVALID_REQUEST", "count: expected a positive number with interval"};
    const std::uint64_t from = request.from.value_or(count < 0 ? buffer_.last() : buffer_.first());
    if (from < buffer_.first() || from > buffer_.next())
      throw AgentError{"OUT_OF_RANGE", "from=" + std::to_string(from) + ": expected " +
                                           std::to_string(buffer_.first()) + " to " +
                                           std::to_string(buffer_.next())};
    stream.count = static_cast<std::size_t>(std::labs(count));
    answer.document = sample(stream.selected, from, count, now, &stream.next);
  } else if (request.at) {
    if (*request.at < buffer_.first() || *request.at > buffer_.last())
      throw AgentError{"OUT_OF_RANGE", "at=" + std::to_string(*request.at) + ": expected " +
                                           std::to_string(buffer_.first()) + " to " +
                                           std::to_string(buffer_.last())};
    answer.document = current(buffer_.stateAt(*request.at), stream.selected, now);
  } else {
    answer.document = current(buffer_.now(), stream.selected, now);
  }
  if (request.interval) answer.stream = stream;
  return answer;
}

std::string Agent::next(AgentStream& stream, double now) const {
  const double since = now - stream.sent;
  if (since < stream.interval) return {};
  if (!stream.sample) {
    stream.sent = now;
    return current(buffer_.now(), stream.selected, now);
  }
  if (stream.next < buffer_.first())
    throw AgentError{
        "OUT_OF_RANGE",
        "the client is too slow: observation " + std::to_string(stream.next) + " has left the buffer", 404};
  std::uint64_t at = stream.next;
  while (at < buffer_.next() && !stream.selected[buffer_.at(at).item]) ++at;
  const bool news = at < buffer_.next();
  if (!news) stream.next = at;
  if (!news && since < stream.heartbeat) return {};
  stream.sent = now;
  return sample(stream.selected, stream.next, static_cast<long>(stream.count), now, &stream.next);
}

std::string Agent::probe(double now) const {
  std::string device = "  <Devices>\n    <Device id=\"d\"" + attribute("name", options_.device) +
                       attribute("uuid", options_.uuid) + ">\n";
  device += "      <Description" + optionalAttribute("manufacturer", options_.manufacturer) +
            optionalAttribute("model", options_.model) +
            ">Milling machine that measures itself</Description>\n";
  device += dataItemsXml("", "      ") + componentsXml("", "      ") + "    </Device>\n  </Devices>\n";
  return header("Devices", now,
                attribute("deviceModelChangeTime", timeText(started_)) +
                    attribute("assetBufferSize", options_.assets) + attribute("assetCount", assets_.size()) +
                    attribute("bufferSize", buffer_.capacity()) + "/>\n" + device);
}

std::string Agent::streams(const std::vector<std::vector<const Record*>>& records, std::uint64_t next,
                           double now) const {
  std::map<std::string, OfComponent> of_components;
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (records[i].empty()) continue;
    const DataItem& item = catalogue()[i];
    std::vector<const Record*>& list = of_components[item.component][static_cast<std::size_t>(item.category)];
    list.insert(list.end(), records[i].begin(), records[i].end());
  }
  std::string streams;
  const auto add = [&](const Component& c) {
    const auto found = of_components.find(c.id);
    if (found == of_components.end()) return;
    streams += "      <ComponentStream" + attribute("component", c.element) + attribute("name", c.name) +
               attribute("componentId", c.id.empty() ? "d" : c.id) + ">\n" + recordsXml(found->second) +
               "      </ComponentStream>\n";
  };
  add({"", "", "Device", options_.device});
  for (const Component& c : components()) add(c);
  return header("Streams", now,
                attribute("deviceModelChangeTime", timeText(started_)) +
                    attribute("bufferSize", buffer_.capacity()) + attribute("nextSequence", next) +
                    attribute("firstSequence", buffer_.first()) + attribute("lastSequence", buffer_.last()) +
                    "/>\n  <Streams>\n    <DeviceStream" + attribute("name", options_.device) +
                    attribute("uuid", options_.uuid) + ">\n" + streams +
                    "    </DeviceStream>\n  </Streams>\n");
}

std::string Agent::current(const Snapshot& snapshot, const std::vector<bool>& selected, double now) const {
  std::vector<std::vector<const Record*>> records(selected.size());
  for (std::size_t i = 0; i < selected.size(); ++i)
    if (selected[i])
      for (const Record& record : snapshot.of(i)) records[i].push_back(&record);
  return streams(records, buffer_.next(), now);
}

std::string Agent::sample(const std::vector<bool>& selected, std::uint64_t from, long count, double now,
                          std::uint64_t* next) const {
  std::vector<std::vector<const Record*>> records(selected.size());
  long left = std::labs(count);
  std::uint64_t at = from;
  if (count > 0) {
    for (; at < buffer_.next() && left > 0; ++at) {
      const Record& record = buffer_.at(at);
      if (!selected[record.item]) continue;
      records[record.item].push_back(&record);
      --left;
    }
  } else {
    for (at = std::min(from, buffer_.last()); at >= buffer_.first() && left > 0; --at) {
      const Record& record = buffer_.at(at);
      if (!selected[record.item]) continue;
      records[record.item].push_back(&record);
      --left;
    }
  }
  *next = std::max<std::uint64_t>(at, 1);
  return streams(records, at, now);
}

AgentAnswer Agent::assets(const AgentRequest& request, double now) const {
  std::vector<const Asset*> chosen;
  if (!request.ids.empty()) {
    for (const std::string& id : request.ids) {
      const auto found =
          std::find_if(assets_.begin(), assets_.end(), [&](const Asset& asset) { return asset.id == id; });
      if (found == assets_.end()) throw AgentError{"ASSET_NOT_FOUND", "no asset '" + id + "'", 404};
      chosen.push_back(&*found);
    }
  } else {
    const auto bare = [](const std::string& type) {
      return type.rfind("s:", 0) == 0 ? type.substr(2) : type;
    };
    if (request.count && *request.count < 1)
      throw AgentError{"OUT_OF_RANGE", "count: expected a positive number"};
    for (const Asset& asset : assets_) {
      if (request.count && chosen.size() >= static_cast<std::size_t>(*request.count)) break;
      if (request.type.empty() || bare(request.type) == asset.type) chosen.push_back(&asset);
    }
  }
  std::string list;
  for (const Asset* asset : chosen) list += assetXml(*asset, options_.uuid) + "\n";
  return {200,
          header("Assets", now,
                 attribute("deviceModelChangeTime", timeText(started_)) +
                     attribute("assetBufferSize", options_.assets) + attribute("assetCount", assets_.size()) +
                     "/>\n  <Assets>\n" + list + "  </Assets>\n")};
}

}  // namespace smartmill::exchange
