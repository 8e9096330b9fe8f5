#include "node/service_queries.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include <smartmill_msgs/FindCoefficients.h>
#include <smartmill_msgs/PlayControl.h>
#include <smartmill_msgs/SetSoundCut.h>
#include <smartmill_msgs/WhatIf.h>
#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_panel/server/command_gate.h"

namespace smartmill::panel {
namespace {

using nlohmann::json;

// Data that do not exist yet are no error of the client: the response contains the reason instead.
constexpr int BAD_REQUEST = 400, CONFLICT = 409, UNAVAILABLE = 200;
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

double numberOf(const ApiRequest& request, const std::string& key, double otherwise) {
  const auto found = request.query.find(key);
  if (found == request.query.end() || found->second.empty()) return otherwise;
  std::size_t used = 0;
  double value = NONE;
  try {
    value = std::stod(found->second, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used != found->second.size() || !std::isfinite(value))
    throw Error(key + ": '" + oneLine(found->second, 40) + "' is not a number");
  return value;
}

std::uint32_t countOf(const ApiRequest& request, const std::string& key, double most) {
  const double value = numberOf(request, key, 0.0);
  if (value < 0.0 || value > most || value != std::floor(value))
    throw Error(key + ": expected an integer from 0 to " + std::to_string(static_cast<int>(most)));
  return static_cast<std::uint32_t>(value);
}

/// Numbers that are not finite become null, since JSON has neither NaN nor infinity.
json numbers(const std::vector<double>& values) {
  json list = json::array();
  for (const double value : values) list.push_back(std::isfinite(value) ? json(value) : json(nullptr));
  return list;
}

json number(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

}  // namespace

ApiResponse queryWhatIf(ros::NodeHandle& nh, const ApiRequest& request) {
  smartmill_msgs::WhatIf service;
  auto& input = service.request;
  input.teeth = countOf(request, "teeth", 20.0);
  input.helix = numberOf(request, "helix", NONE);
  input.entry_angle = numberOf(request, "entry_angle", NONE);
  input.exit_angle = numberOf(request, "exit_angle", NONE);
  input.feed_per_tooth = numberOf(request, "feed_per_tooth", NONE);
  input.overhang = numberOf(request, "overhang", NONE);
  input.axial_depth = numberOf(request, "axial_depth", NONE);
  input.speeds = countOf(request, "speeds", 1000.0);
  input.spread = countOf(request, "spread", 1.0) == 1;
  if (!nh.serviceClient<smartmill_msgs::WhatIf>(names::WHAT_IF).call(service))
    return messageResponse(UNAVAILABLE, "the stability node does not answer");
  const auto& found = service.response;
  if (found.code != found.OK)
    return messageResponse(found.code == found.BAD_REQUEST ? BAD_REQUEST : UNAVAILABLE, found.message);
  const json answer = {{"spindle_speed", numbers(found.spindle_speed)},
                       {"depth_limit", numbers(found.depth_limit)},
                       {"chatter_frequency", numbers(found.chatter_frequency)},
                       {"mode", found.mode},
                       {"modes", found.modes},
                       {"torque_depth_limit", numbers(found.torque_depth_limit)},
                       {"power_depth_limit", numbers(found.power_depth_limit)},
                       {"limit_low", numbers(found.limit_low)},
                       {"limit_high", numbers(found.limit_high)},
                       {"stable_share", number(found.stable_share)},
                       {"seconds", found.seconds}};
  return {200, answer.dump()};
}

ApiResponse controlReplay(ros::NodeHandle& nh, const ApiRequest& request) {
  constexpr int NOT_ALLOWED = 405;
  if (!request.post) return messageResponse(NOT_ALLOWED, "replay control requires POST");
  smartmill_msgs::PlayControl service;
  service.request.speed = numberOf(request, "speed", NONE);
  service.request.paused = countOf(request, "paused", 1.0) == 1;
  service.request.position = numberOf(request, "position", NONE);
  if (!nh.serviceClient<smartmill_msgs::PlayControl>(names::REPLAY_CONTROL).call(service))
    return messageResponse(UNAVAILABLE, "no recording is played");
  return messageResponse(service.response.ok ? 200 : BAD_REQUEST, service.response.message);
}

ApiResponse queryCoefficients(ros::NodeHandle& nh, const ApiRequest& request) {
  smartmill_msgs::FindCoefficients service;
  const auto word = [&](const char* key) {
    const auto found = request.query.find(key);
    return found == request.query.end() ? std::string() : found->second;
  };
  service.request.tool = word("tool");
  service.request.material = word("material");
  if (!nh.serviceClient<smartmill_msgs::FindCoefficients>(names::FIND_COEFFICIENTS).call(service))
    return messageResponse(UNAVAILABLE, "the load meter node does not answer");
  const auto& found = service.response;
  if (found.code != found.OK) {
    const json answer = {{"message", found.message}, {"database", found.database}};
    return {UNAVAILABLE, answer.dump(-1, ' ', false, json::error_handler_t::replace)};
  }
  const auto& c = found.coefficients;
  const auto range = [](const auto& values) { return json{number(values[0]), number(values[1])}; };
  const auto& next = found.next_test;
  json next_test;
  if (next.kind == next.CUT) {
    next_test = {{"spindle_speed", number(next.spindle_speed)},
                 {"feed_per_tooth", number(next.feed_per_tooth)},
                 {"axial_depth", number(next.axial_depth)},
                 {"entry_angle", number(next.entry_angle)},
                 {"exit_angle", number(next.exit_angle)},
                 {"teeth", next.teeth},
                 {"helix", number(next.helix)},
                 {"diameter", number(next.diameter)},
                 {"ktc_std", number(found.next_std[0])},
                 {"kte_std", number(found.next_std[1])}};
  }
  const json answer = {{"of_pair", found.of_pair != 0},
                       {"database", found.database},
                       {"identifications", found.identifications},
                       {"production_cuts", found.production_cuts},
                       {"superseded", found.superseded},
                       {"cutting_speed", range(found.cutting_speed)},
                       {"feed_per_tooth", range(found.feed_per_tooth)},
                       {"axial_depth", range(found.axial_depth)},
                       {"edge_age", range(found.edge_age)},
                       {"next_test", next_test},
                       {"tool", c.tool},
                       {"material", c.material},
                       {"ktc", number(c.ktc)},
                       {"ktc_std", number(c.ktc_std)},
                       {"krc", number(c.krc)},
                       {"krc_std", number(c.krc_std)},
                       {"kac", number(c.kac)},
                       {"kac_std", number(c.kac_std)},
                       {"kte", number(c.kte)},
                       {"kte_std", number(c.kte_std)},
                       {"kre", number(c.kre)},
                       {"kre_std", number(c.kre_std)},
                       {"kae", number(c.kae)},
                       {"kae_std", number(c.kae_std)},
                       {"source", c.source},
                       {"test_count", c.test_count},
                       {"stamp", c.header.stamp.toSec()},
                       {"message", found.message}};
  return {200, answer.dump(-1, ' ', false, json::error_handler_t::replace)};
}

ApiResponse setSoundCut(ros::NodeHandle& nh, const ApiRequest& request, PanelLog& log) {
  constexpr int NOT_ALLOWED = 405;
  if (!request.post) return messageResponse(NOT_ALLOWED, "a setting requires POST");
  const json body = json::parse(request.body, nullptr, false);
  if (!body.is_object()) return messageResponse(BAD_REQUEST, "expected a JSON object");
  smartmill_msgs::SetSoundCut service;
  auto& setting = service.request;
  setting.speed_low = setting.speed_high = setting.spindle_speed = NONE;
  for (const auto& [key, value] : body.items()) {
    const auto number = [&, key = key, value = value] {
      if (!value.is_number()) throw Error(oneLine(key, 40) + ": expected a number");
      return value.get<double>();
    };
    const auto flag = [&, key = key, value = value] {
      if (!value.is_boolean()) throw Error(oneLine(key, 40) + ": expected true or false");
      return value.get<bool>();
    };
    if (key == "teeth") {
      const double teeth = number();
      if (!(teeth >= 1.0 && teeth <= 40.0) || teeth != std::floor(teeth))
        throw Error("teeth: expected an integer from 1 to 40");
      setting.teeth = static_cast<std::uint32_t>(teeth);
    } else if (key == "speed_low") {
      setting.speed_low = number();
    } else if (key == "speed_high") {
      setting.speed_high = number();
    } else if (key == "spindle_speed") {
      setting.spindle_speed = number();
    } else if (key == "restart") {
      setting.restart = flag();
    } else if (key == "discard_last") {
      setting.discard_last = flag();
    } else {
      throw Error("'" + oneLine(key, 40) +
                  "': expected teeth, speed_low, speed_high, spindle_speed, restart or discard_last");
    }
  }
  if (!nh.serviceClient<smartmill_msgs::SetSoundCut>(names::SET_SOUND_CUT).call(service))
    return messageResponse(CONFLICT, "the sound node does not answer");
  if (service.response.code != service.response.OK)
    return messageResponse(BAD_REQUEST, service.response.message);
  log.write("phone", request.from, "sound: " + service.response.message);
  return messageResponse(200, service.response.message);
}

ApiResponse newestReport(const std::string& folder) {
  namespace fs = std::filesystem;
  if (folder.empty()) return messageResponse(UNAVAILABLE, "no folder of reports is set");
  fs::path newest;
  fs::file_time_type when;
  std::error_code failed;
  const fs::recursive_directory_iterator end;
  for (fs::recursive_directory_iterator it(folder, fs::directory_options::skip_permission_denied, failed);
       !failed && it != end; it.increment(failed)) {
    constexpr int DEEPEST = 3;
    if (it.depth() >= DEEPEST) it.disable_recursion_pending();
    if (it->path().filename() != "report.json") continue;
    std::error_code gone;
    const auto time = fs::last_write_time(it->path(), gone);
    if (!gone && (newest.empty() || time > when)) {
      newest = it->path();
      when = time;
    }
  }
  if (newest.empty()) return messageResponse(UNAVAILABLE, "no report yet");
  std::ifstream in(newest);
  const json report = json::parse(in, nullptr, false);
  if (!report.is_object()) return messageResponse(UNAVAILABLE, newest.string() + ": cannot be read");
  return {200, json({{"folder", newest.parent_path().filename().string()}, {"report", report}}).dump()};
}

}  // namespace smartmill::panel
