#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/range.h"
#include "smartmill_recording/import/channel_mapping.h"

namespace smartmill::recording {

/// What is stated of one test, in the units of campaign.yaml; absent: not stated.
struct TestSettings {
  std::optional<std::string> name, kind, direction;
  std::optional<double> sample_rate_hz, spindle_speed_rpm, feed_per_tooth_mm, axial_depth_mm, entry_deg,
      exit_deg, feed_direction_deg, engage_time_s, running_before_s, start_time_s, cut_time_before_s;
  ChannelChoices channels;

  /// Takes what `other` states.
  void overlay(const TestSettings& other);
};

/// A number of TestSettings: its key in YAML, its option and its range.
struct SettingKey {
  const char* key = "";
  const char* option = "";
  std::optional<double> TestSettings::*value = nullptr;
  Range range = {};
  const char* help = "";
};
const std::vector<SettingKey>& settingKeys();

/// The tool, where no model file is given.
struct ToolSettings {
  std::optional<int> teeth;
  std::optional<double> diameter_mm, helix_deg;
};

/// The same for every spelling of a path; the file may be absent.
std::string canonicalPath(const std::string& path);

/// How files become a campaign: smartmill-import/1 (docs/formats.md) and the options of the command.
struct ImportPlan {
  std::string file;   ///< of the plan; empty: none
  std::string model;  ///< path of the machine model; empty: made from the tool
  ToolSettings tool;
  std::string measures;  ///< force_on_tool or force_on_workpiece; empty: not stated
  TestSettings defaults;
  struct Entry {
    std::string file;       ///< path, relative paths from the plan's folder
    std::string canonical;  ///< canonicalPath() of it
    TestSettings settings;
  };
  std::vector<Entry> files;
  TestSettings stated;  ///< on the command line, before all others

  /// Settings of one file: defaults, then its entry, then the command line.
  TestSettings settingsOf(const std::string& path) const;
};

/// @throws Error "FILE: key: what", as all formats: unknown key, wrong type, out of range.
ImportPlan readImport(const std::string& file);

}  // namespace smartmill::recording
