#include "smartmill_launch/session/session_progress.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"

namespace smartmill::session {

void SessionProgress::begin(const std::string& name, const std::string& holder, std::uint32_t starts,
                            bool lane) {
  entries_.push_back({{name, holder, starts, lane, false, ""}, true});
}

void SessionProgress::end(const std::string& detail) {
  Action& action = entries_.back().action;
  action.done = true;
  action.detail = detail;
}

void SessionProgress::restarted(const std::string& holder, std::uint32_t starts) {
  for (auto& [action, taken] : entries_) {
    if (action.holder == holder && action.starts != starts) action.done = false;
  }
}

std::vector<std::string> SessionProgress::holders() const {
  std::vector<std::string> names;
  for (const Entry& entry : entries_) {
    const std::string& holder = entry.action.holder;
    if (!holder.empty() && std::find(names.begin(), names.end(), holder) == names.end())
      names.push_back(holder);
  }
  return names;
}

std::optional<SessionProgress::Action> SessionProgress::take(const std::string& name) {
  for (auto& [action, taken] : entries_) {
    if (taken || !action.done || action.name != name) continue;
    taken = true;
    return action;
  }
  return std::nullopt;
}

std::size_t SessionProgress::lostLanes() const {
  return static_cast<std::size_t>(std::count_if(entries_.begin(), entries_.end(), [](const Entry& entry) {
    return entry.action.lane && !entry.action.done;
  }));
}

bool SessionProgress::cutLanes() const {
  return std::any_of(entries_.begin(), entries_.end(), [](const Entry& entry) { return entry.action.lane; });
}

std::string SessionProgress::text() const {
  nlohmann::json actions = nlohmann::json::array();
  for (const Entry& entry : entries_) {
    const Action& a = entry.action;
    actions.push_back({a.name, a.holder, a.starts, a.lane, a.done, a.detail});
  }
  return nlohmann::json{{"subject", subject}, {"summary", summary}, {"actions", actions}}.dump();
}

SessionProgress SessionProgress::of(const std::string& text) {
  SessionProgress progress;
  try {
    const auto json = nlohmann::json::parse(text);
    json.at("subject").get_to(progress.subject);
    json.at("summary").get_to(progress.summary);
    for (const auto& a : json.at("actions")) {
      progress.entries_.push_back({{a.at(0), a.at(1), a.at(2), a.at(3), a.at(4), a.at(5)}, false});
    }
  } catch (const nlohmann::json::exception& error) {
    throw Error(std::string("progress of a session: ") + error.what());
  }
  return progress;
}

}  // namespace smartmill::session
