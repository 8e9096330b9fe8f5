#include "node/questions.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include <smartmill_msgs/FindCoefficients.h>
#include <smartmill_msgs/PlayControl.h>
#include <smartmill_msgs/WhatIf.h>
#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_panel/server/command_gate.h"

namespace smartmill::panel {
namespace {

using nlohmann::json;

// Who asks for what is not there yet has done nothing wrong: an answer without the thing, and why.
constexpr int BAD_REQUEST = 400, NOT_THERE = 200;
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

double numberOf(const Question& question, const std::string& key, double otherwise) {
  const auto found = question.query.find(key);
  if (found == question.query.end() || found->second.empty()) return otherwise;
  std::size_t used = 0;
  double value = NONE;
  try {
    value = std::stod(found->second, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used != found->second.size() || !std::isfinite(value))
    throw Error(key + ": '" + oneLine(found->second, 40) + "' is no number");
  return value;
}

std::uint32_t countOf(const Question& question, const std::string& key, double most) {
  const double value = numberOf(question, key, 0.0);
  if (value < 0.0 || value > most || value != std::floor(value))
    throw Error(key + ": a whole number up to " + std::to_string(static_cast<int>(most)) + " is due");
  return static_cast<std::uint32_t>(value);
}

/// JSON knows neither NaN nor infinity.
json numbers(const std::vector<double>& values) {
  json list = json::array();
  for (const double value : values) list.push_back(std::isfinite(value) ? json(value) : json(nullptr));
  return list;
}

json number(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

}  // namespace

Answer askWhatIf(ros::NodeHandle& nh, const Question& question) {
  smartmill_msgs::WhatIf service;
  auto& request = service.request;
  request.teeth = countOf(question, "teeth", 20.0);
  request.helix = numberOf(question, "helix", NONE);
  request.entry_angle = numberOf(question, "entry_angle", NONE);
  request.exit_angle = numberOf(question, "exit_angle", NONE);
  request.feed_per_tooth = numberOf(question, "feed_per_tooth", NONE);
  request.overhang = numberOf(question, "overhang", NONE);
  request.axial_depth = numberOf(question, "axial_depth", NONE);
  request.speeds = countOf(question, "speeds", 1000.0);
  request.spread = countOf(question, "spread", 1.0) == 1;
  if (!nh.serviceClient<smartmill_msgs::WhatIf>(names::WHAT_IF).call(service))
    return answerOf(NOT_THERE, "the stability node does not answer");
  const auto& found = service.response;
  if (found.code != found.OK)
    return answerOf(found.code == found.BAD_REQUEST ? BAD_REQUEST : NOT_THERE, found.message);
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

Answer controlReplay(ros::NodeHandle& nh, const Question& question) {
  constexpr int NOT_ALLOWED = 405;
  if (!question.post) return answerOf(NOT_ALLOWED, "a wish comes by POST");
  smartmill_msgs::PlayControl service;
  service.request.speed = numberOf(question, "speed", NONE);
  service.request.paused = countOf(question, "paused", 1.0) == 1;
  service.request.position = numberOf(question, "position", NONE);
  if (!nh.serviceClient<smartmill_msgs::PlayControl>(names::REPLAY_CONTROL).call(service))
    return answerOf(NOT_THERE, "no recording is played");
  return answerOf(service.response.ok ? 200 : BAD_REQUEST, service.response.message);
}

Answer askCoefficients(ros::NodeHandle& nh, const Question& question) {
  smartmill_msgs::FindCoefficients service;
  const auto word = [&](const char* key) {
    const auto found = question.query.find(key);
    return found == question.query.end() ? std::string() : found->second;
  };
  service.request.tool = word("tool");
  service.request.material = word("material");
  if (!nh.serviceClient<smartmill_msgs::FindCoefficients>(names::FIND_COEFFICIENTS).call(service))
    return answerOf(NOT_THERE, "the load meter node does not answer");
  const auto& found = service.response;
  if (found.code != found.OK) return answerOf(NOT_THERE, found.message);
  const auto& c = found.coefficients;
  const json answer = {{"tool", c.tool},
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

Answer newestReport(const std::string& folder) {
  namespace fs = std::filesystem;
  if (folder.empty()) return answerOf(NOT_THERE, "no folder of reports was given");
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
  if (newest.empty()) return answerOf(NOT_THERE, "no report yet");
  std::ifstream in(newest);
  const json report = json::parse(in, nullptr, false);
  if (!report.is_object()) return answerOf(NOT_THERE, newest.string() + ": cannot be read");
  return {200, json({{"folder", newest.parent_path().filename().string()}, {"report", report}}).dump()};
}

}  // namespace smartmill::panel
