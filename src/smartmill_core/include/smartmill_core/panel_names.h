#pragma once

namespace smartmill::names {

// What the panel shows besides the topics of names.h, relative to the same namespace.
constexpr const char* FORCE_STRIP = "panel/strip";
constexpr const char* FORCE_REVOLUTION = "panel/revolution";
constexpr const char* FORCE_SPECTRUM = "panel/spectrum";
constexpr const char* PANEL_LOG = "panel/log";
constexpr const char* TWIN_FORCE = "discrepancy/force";
constexpr const char* REPLAY_STATE = "replay/state";
constexpr const char* REPLAY_CONTROL = "replay/control";
constexpr const char* SESSION_STATE = "session/state";
constexpr const char* FEED_HOLD = "cnc/feed_hold";
constexpr const char* WHAT_IF = "stability/what_if";

}  // namespace smartmill::names
