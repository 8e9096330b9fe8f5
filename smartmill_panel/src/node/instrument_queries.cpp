#include "node/instrument_queries.h"

#include <cmath>
#include <string>

#include <smartmill_msgs/CalibrateChannel.h>
#include <smartmill_msgs/TryInstrument.h>
#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_panel/server/command_gate.h"

namespace smartmill::panel {
namespace {

using nlohmann::json;
using smartmill_msgs::CalibrateChannel;
using smartmill_msgs::TryInstrument;

constexpr int BAD_REQUEST = 400, UNAVAILABLE = 200;
constexpr const char* NO_NODE =
    "setup_node does not answer: roslaunch smartmill_daq setup.launch folder:=/path/of/instruments";

json objectOf(const ApiRequest& request) {
  if (!request.post) throw Error("expected POST");
  json body = json::parse(request.body, nullptr, false);
  if (!body.is_object()) throw Error("expected a JSON object");
  return body;
}

template <class Value>
Value valueOf(const json& body, const char* key, Value otherwise) {
  const auto found = body.find(key);
  if (found == body.end()) return otherwise;
  try {
    return found->get<Value>();
  } catch (const json::exception&) {
    throw Error(std::string(key) + ": a value of the wrong kind");
  }
}

std::string whoOf(const json& body) {
  std::string who = oneLine(valueOf<std::string>(body, "who", ""), 40);
  if (who.empty()) throw Error("who: expected a name for the log");
  return who;
}

json number(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

std::string textOf(const json& answer) {
  return answer.dump(-1, ' ', false, json::error_handler_t::replace);
}

json driversOf(const TryInstrument::Response& found) {
  json drivers = json::object();
  for (const std::string& name : found.drivers) drivers[name] = json::array();
  for (std::size_t i = 0; i < found.option_driver.size(); ++i)
    drivers[found.option_driver[i]].push_back(
        {{"key", found.option_key.at(i)}, {"meaning", found.option_meaning.at(i)}});
  return drivers;
}

json channelsOf(const TryInstrument::Response& found) {
  json channels = json::array();
  for (std::size_t c = 0; c < found.channel.size(); ++c)
    channels.push_back({{"topic", found.topic.at(c)},
                        {"name", found.channel[c]},
                        {"unit", found.unit.at(c)},
                        {"mean", number(found.mean.at(c))},
                        {"rms", number(found.rms.at(c))},
                        {"peak", number(found.peak.at(c))},
                        {"clipped", found.clipped.at(c)},
                        {"faulty", found.faulty.at(c) != 0}});
  return channels;
}

std::uint8_t methodOf(const std::string& word) {
  using Request = CalibrateChannel::Request;
  if (word == "exciter") return Request::EXCITER;
  if (word == "empty") return Request::EMPTY;
  if (word == "mass") return Request::MASS;
  if (word == "hits") return Request::HITS;
  if (word == "store") return Request::STORE;
  throw Error("method: '" + oneLine(word, 40) + "', expected exciter, empty, mass, hits or store");
}

}  // namespace

ApiResponse tryInstrument(ros::NodeHandle& nh, const ApiRequest& request, PanelLog& log) {
  const json body = objectOf(request);
  const std::string who = whoOf(body);
  TryInstrument service;
  service.request.description = valueOf<std::string>(body, "description", "");
  service.request.seconds = valueOf(body, "seconds", 0.0);
  service.request.file = valueOf<std::string>(body, "file", "");
  service.request.replace = valueOf(body, "replace", false);
  if (!nh.serviceClient<TryInstrument>(names::TRY_INSTRUMENT).call(service))
    return messageResponse(UNAVAILABLE, NO_NODE);
  const auto& found = service.response;
  const bool good = found.code == found.OK;
  if (!service.request.file.empty())
    log.write(who, request.from,
              std::string("instrument") + (good ? ": " : " REFUSED: ") + oneLine(found.message));
  const json answer = {{"good", good},
                       {"message", found.message},
                       {"path", found.path},
                       {"files", found.files},
                       {"drivers", driversOf(found)},
                       {"channels", channelsOf(found)},
                       {"samples", found.samples},
                       {"drift", number(found.drift)},
                       {"drift_std", number(found.drift_std)},
                       {"jitter", number(found.jitter)},
                       {"faults", found.faults}};
  return {200, textOf(answer)};
}

ApiResponse calibrateChannel(ros::NodeHandle& nh, const ApiRequest& request, PanelLog& log) {
  const json body = objectOf(request);
  const std::string who = whoOf(body);
  CalibrateChannel service;
  auto& input = service.request;
  input.file = valueOf<std::string>(body, "file", "");
  input.topic = valueOf<std::string>(body, "topic", "");
  input.channel = valueOf<std::string>(body, "channel", "");
  input.method = methodOf(valueOf<std::string>(body, "method", ""));
  input.seconds = valueOf(body, "seconds", 0.0);
  input.exciter = valueOf(body, "exciter", 0.0);
  input.frequency = valueOf(body, "frequency", 0.0);
  input.mass = valueOf(body, "mass", 0.0);
  input.against = valueOf(body, "against", false);
  input.gravity = valueOf(body, "gravity", 0.0);
  input.accelerometer = valueOf<std::string>(body, "accelerometer", "");
  input.reference_std = valueOf(body, "reference_std", 0.0);
  if (!nh.serviceClient<CalibrateChannel>(names::CALIBRATE_CHANNEL).call(service))
    return messageResponse(UNAVAILABLE, NO_NODE);
  const auto& found = service.response;
  const bool good = found.code == found.OK;
  if (input.method == CalibrateChannel::Request::STORE)
    log.write(who, request.from,
              std::string("sensitivity") + (good ? ": " : " REFUSED: ") + oneLine(found.message));
  const json answer = {{"good", good},
                       {"message", found.message},
                       {"sensitivity", number(found.sensitivity)},
                       {"sensitivity_std", number(found.sensitivity_std)},
                       {"before", number(found.before)},
                       {"parts", found.parts}};
  return {200, textOf(answer)};
}

}  // namespace smartmill::panel
