#include "smartmill_recording/import/import_plan.h"

#include <filesystem>
#include <set>
#include <system_error>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/model/strict_yaml.h"

namespace smartmill::recording {
namespace {

namespace fs = std::filesystem;

constexpr double STANDARD_GRAVITY = 9.80665;  // [m/s2]
constexpr double VOLT = 1e3;                  // [mV]

/// Sensitivity as a data sheet states it.
struct Sensitivity {
  const char* key;
  double si;  // of the unit under "per"
};
constexpr Sensitivity SENSITIVITIES[] = {{"sensitivity_mv_per_n", 1.0},
                                         {"sensitivity_mv_per_g", STANDARD_GRAVITY},
                                         {"sensitivity_mv_per_um", 1e-6}};

ChannelChoice readChoice(const StrictYaml& map, const std::string& column) {
  ChannelChoice choice;
  if (map.has("name")) choice.name = map.word("name");
  if (map.has("unit")) choice.unit = map.word("unit");
  choice.scale = map.optionalNumber("scale");
  for (const Sensitivity& s : SENSITIVITIES) {
    if (!map.has(s.key)) continue;
    if (choice.scale) map.fail(s.key, "contradicts scale or another sensitivity");
    const double value = map.number(s.key);
    if (value == 0.0) map.fail(s.key, "0 is out of range (any other number)");
    choice.scale = VOLT / value * s.si;
  }
  map.finish();
  checkChoice(map.file(), column, choice);
  return choice;
}

TestSettings readSettings(const StrictYaml& map) {
  TestSettings settings;
  if (map.has("kind")) settings.kind = map.oneOf("kind", {"cut", "air", "tap"});
  if (map.has("direction"))
    settings.direction = map.oneOf("direction", {AXIS_NAMES.begin(), AXIS_NAMES.end()});
  for (const SettingKey& key : settingKeys()) settings.*key.value = map.optionalNumber(key.key, key.range);
  if (const auto channels = map.optionalMap("channels")) {
    for (const std::string& column : channels->keys())
      settings.channels[column] = readChoice(channels->map(column), column);
    channels->finish();
  }
  return settings;
}

template <typename T>
void take(std::optional<T>& to, const std::optional<T>& from) {
  if (from) to = from;
}

}  // namespace

const std::vector<SettingKey>& settingKeys() {
  static const std::vector<SettingKey> all{
      {"sample_rate_hz", "--sample-rate-hz", &TestSettings::sample_rate_hz, Range::positive(),
       "[Hz] of files that state no times and no rate"},
      {"spindle_speed_rpm", "--speed-rpm", &TestSettings::spindle_speed_rpm, Range::positive(),
       "spindle speed"},
      {"feed_per_tooth_mm", "--feed-per-tooth-mm", &TestSettings::feed_per_tooth_mm, Range::positive(),
       "of a cut"},
      {"axial_depth_mm", "--axial-depth-mm", &TestSettings::axial_depth_mm, Range::positive(), "of a cut"},
      {"entry_deg", "--entry-deg", &TestSettings::entry_deg, Range::closed(0.0, 360.0),
       "immersion angle where a tooth enters; a slot: 0"},
      {"exit_deg", "--exit-deg", &TestSettings::exit_deg, Range::closed(0.0, 360.0),
       "immersion angle where a tooth leaves; a slot: 180"},
      {"feed_direction_deg", "--feed-direction-deg", &TestSettings::feed_direction_deg,
       Range::closed(-360.0, 360.0), "of the feed from +x towards +y; absent: along +x"},
      {"engage_time_s", "--engage-time-s", &TestSettings::engage_time_s, Range::notNegative(),
       "full engagement begins so long behind the first sample"},
      {"running_before_s", "--running-before-s", &TestSettings::running_before_s, Range::notNegative(),
       "it ran like this so long before the record"},
      {"start_time_s", "--start-time-s", &TestSettings::start_time_s, Range::notNegative(),
       "since the start of the campaign"},
      {"cut_time_before_s", "--cut-time-before-s", &TestSettings::cut_time_before_s, Range::notNegative(),
       "time that the edge has cut before"}};
  return all;
}

void TestSettings::overlay(const TestSettings& other) {
  take(name, other.name);
  take(kind, other.kind);
  take(direction, other.direction);
  for (const SettingKey& key : settingKeys()) take(this->*key.value, other.*key.value);
  for (const auto& [column, choice] : other.channels) {
    ChannelChoice& own = channels[column];
    take(own.name, choice.name);
    take(own.unit, choice.unit);
    take(own.scale, choice.scale);
  }
}

std::string canonicalPath(const std::string& path) {
  std::error_code failed;
  const fs::path canonical = fs::weakly_canonical(path, failed);
  return failed ? path : canonical.string();
}

TestSettings ImportPlan::settingsOf(const std::string& path) const {
  TestSettings settings = defaults;
  const std::string canonical = canonicalPath(path);
  for (const Entry& entry : files) {
    if (entry.canonical == canonical) settings.overlay(entry.settings);
  }
  settings.overlay(stated);
  return settings;
}

ImportPlan readImport(const std::string& file) {
  const StrictYaml root = StrictYaml::fromFile(file);
  const fs::path folder = fs::path(file).parent_path();
  ImportPlan plan;
  plan.file = file;
  root.oneOf("format", {"smartmill-import/1"});
  if (root.has("model")) plan.model = (folder / root.word("model")).string();
  if (const auto tool = root.optionalMap("tool")) {
    if (!plan.model.empty()) root.fail("tool", "contradicts model");
    if (tool->has("teeth")) plan.tool.teeth = tool->integer("teeth", 1, 20);
    plan.tool.diameter_mm = tool->optionalNumber("diameter_mm", Range::positive());
    plan.tool.helix_deg = tool->optionalNumber("helix_deg", Range::openHigh(0.0, 80.0));
    tool->finish();
  }
  if (root.has("measures")) {
    if (!plan.model.empty()) root.fail("measures", "contradicts model, whose force_sensor.measures is used");
    plan.measures = root.oneOf("measures", {"force_on_tool", "force_on_workpiece"});
  }
  if (const auto defaults = root.optionalMap("defaults")) {
    plan.defaults = readSettings(*defaults);
    defaults->finish();
  }
  if (root.has("files")) {
    std::set<std::string> listed;
    for (const StrictYaml& map : root.maps("files")) {
      ImportPlan::Entry entry;
      entry.file = (folder / map.word("file")).string();
      entry.canonical = canonicalPath(entry.file);
      if (!listed.insert(entry.canonical).second)
        map.fail("file", "'" + map.word("file") + "' is listed twice");
      entry.settings = readSettings(map);
      if (map.has("name")) entry.settings.name = map.word("name");
      map.finish();
      plan.files.push_back(std::move(entry));
    }
  }
  root.finish();
  return plan;
}

}  // namespace smartmill::recording
