#include "smartmill_core/campaign/campaign.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/campaign/slow_channels.h"
#include "smartmill_core/campaign/stream_offset.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/units.h"

namespace smartmill {

namespace {

namespace fs = std::filesystem;

constexpr const char* FORMAT = "smartmill-campaign/1";

const Range POSITIVE = Range::positive();
const Range NOT_NEGATIVE = Range::notNegative();
const Range TURN_DEG{0.0, 360.0, false, false};
constexpr std::array<TestKind, 5> KINDS{
    {TestKind::cut, TestKind::air, TestKind::tap, TestKind::move, TestKind::path}};

bool insideFolder(const std::string& file) {
  const fs::path path(file);
  if (path.is_absolute()) return false;
  for (const fs::path& part : path) {
    if (part == "..") return false;
  }
  return true;
}

TestKind readKind(const StrictYaml& map) {
  std::vector<std::string> names;
  for (const TestKind kind : KINDS) names.push_back(testKindName(kind));
  const std::string name = map.oneOf("kind", names);
  return KINDS[static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin())];
}

std::map<std::string, double> readStreamOffsets(const StrictYaml& map) {
  std::map<std::string, double> offsets;
  for (const std::string& group : map.keys()) {
    if (streamGroups().count(group) == 0)
      map.fail(group, "is not a group of columns (expected force, controller or tool)");
    offsets[group] = map.number(group, Range{});
  }
  map.finish();
  return offsets;
}

PulseTachometerParameters readTachometer(const StrictYaml& map) {
  PulseTachometerParameters tachometer;
  const double pulses =
      map.optionalNumber("pulses_per_revolution", Range::closed(1.0, 10000.0)).value_or(1.0);
  if (pulses != std::floor(pulses))
    map.fail("pulses_per_revolution", yamlNumber(pulses) + " is not an integer");
  tachometer.pulses_per_revolution = static_cast<int>(pulses);
  tachometer.threshold = map.optionalNumber("threshold_v", Range{}).value_or(tachometer.threshold);
  tachometer.hysteresis = map.optionalNumber("hysteresis_v", NOT_NEGATIVE).value_or(tachometer.hysteresis);
  if (map.has("edge")) tachometer.falling = map.oneOf("edge", {"rising", "falling"}) == "falling";
  tachometer.angle = units::radFromDeg(map.optionalNumber("angle_deg", Range{}).value_or(0.0));
  map.finish();
  return tachometer;
}

PathProgram readPathProgram(const StrictYaml& map) {
  PathProgram program;
  program.file = fileInside(map, "program");
  program.linuxcnc = map.has("dialect") && map.oneOf("dialect", {"fanuc", "linuxcnc"}) == "linuxcnc";
  if (map.has("program_zero_mm")) {
    const std::vector<double> zero = map.numbers("program_zero_mm", program.zero.size());
    for (std::size_t a = 0; a < zero.size(); ++a) program.zero[a] = zero[a] * units::MM;
  }
  const auto tools = map.optionalMap("tools");
  if (!tools) return program;
  for (const std::string& key : tools->keys()) {
    const bool digits = key.size() <= 8 && key.find_first_not_of("0123456789") == std::string::npos;
    const int number = digits ? std::stoi(key) : 0;
    if (number < 1) tools->fail(key, "is not a tool number (expected 1 to 99999999)");
    program.tools[number] = fileInside(*tools, key);
  }
  tools->finish();
  return program;
}

CampaignTest readTest(const StrictYaml& map) {
  CampaignTest test;
  test.name = map.word("name");
  test.kind = readKind(map);
  test.file = fileInside(map, "file");
  test.sample_rate = map.number("sample_rate_hz", POSITIVE);
  if (map.has("file_format")) {
    test.file_format = map.oneOf("file_format", {"dynoware", "sound"});
    const StrictYaml channels = map.map("channels");
    for (const std::string& key : channels.keys()) {
      // A sound file may contain any column of a record; its reader rejects others.
      if (test.file_format == "sound" || key == "fx" || key == "fy" || key == "fz" ||
          key == TACHOMETER_CHANNEL)
        test.channels[key] = channels.word(key);
    }
    channels.finish();
    if (test.channels.empty()) map.fail("channels", "expected at least one channel");
  }
  const bool turns = test.kind == TestKind::cut || test.kind == TestKind::air;
  test.spindle_speed =
      units::radPerSecFromRpm(turns ? map.number("spindle_speed_rpm", POSITIVE)
                                    : map.optionalNumber("spindle_speed_rpm", NOT_NEGATIVE).value_or(0.0));
  if (test.kind == TestKind::path) test.program = readPathProgram(map);
  if (test.kind == TestKind::tap)
    test.direction = map.oneOf("direction", {AXIS_NAMES.begin(), AXIS_NAMES.end()});
  if (test.kind == TestKind::cut) {
    Engagement e;
    e.feed_per_tooth = map.number("feed_per_tooth_mm", POSITIVE) * units::MM;
    e.axial_depth = map.number("axial_depth_mm", POSITIVE) * units::MM;
    const double entry = map.number("entry_deg", TURN_DEG), exit = map.number("exit_deg", TURN_DEG);
    if (!(exit > entry)) {
      map.fail("exit_deg", yamlNumber(exit) + " is out of range (> entry_deg " + yamlNumber(entry) + ")");
    }
    e.entry = units::radFromDeg(entry);
    e.exit = units::radFromDeg(exit);
    test.engagement = e;
    test.feed_direction = units::radFromDeg(
        map.optionalNumber("feed_direction_deg", Range::closed(-360.0, 360.0)).value_or(0.0));
    test.engage_time = map.optionalNumber("engage_time_s", NOT_NEGATIVE);
  }
  if (turns) {
    test.running_before = map.optionalNumber("running_before_s", NOT_NEGATIVE);
    if (test.running_before && test.engage_time)
      map.fail("running_before_s", yamlNumber(*test.running_before) + " contradicts engage_time_s");
  }
  test.start_time = map.optionalNumber("start_time_s", NOT_NEGATIVE);
  test.cut_time_before = map.optionalNumber("cut_time_before_s", NOT_NEGATIVE);
  if (const auto offsets = map.optionalMap("stream_offset_s"))
    test.stream_offset = readStreamOffsets(*offsets);
  if (const auto tachometer = map.optionalMap("tachometer")) test.tachometer = readTachometer(*tachometer);
  map.finish();
  return test;
}

void write(const PathProgram& program, std::ostream& out) {
  out << "  program: " << yamlWord(program.file) << "\n";
  if (program.linuxcnc) out << "  dialect: linuxcnc\n";
  out << "  program_zero_mm: [";
  for (std::size_t a = 0; a < program.zero.size(); ++a)
    out << (a > 0 ? ", " : "") << yamlNumber(program.zero[a] / units::MM);
  out << "]\n" << (program.tools.empty() ? "" : "  tools:\n");
  for (const auto& [number, file] : program.tools) out << "    " << number << ": " << yamlWord(file) << "\n";
}

}  // namespace

const char* testKindName(TestKind kind) {
  switch (kind) {
    case TestKind::cut:
      return "cut";
    case TestKind::air:
      return "air";
    case TestKind::tap:
      return "tap";
    case TestKind::move:
      return "move";
    case TestKind::path:
      break;
  }
  return "path";
}

std::string fileInside(const StrictYaml& map, const std::string& key) {
  const std::string file = map.word(key);
  if (!insideFolder(file)) map.fail(key, "'" + file + "' lies outside the campaign's folder");
  return file;
}

std::string Campaign::inFolder(const std::string& file) const {
  return (fs::path(folder) / file).string();
}

std::string Campaign::pathOf(const CampaignTest& test) const {
  return inFolder(test.file);
}

std::string Campaign::modelPath() const {
  return inFolder(model_file);
}

bool hasPaths(const Campaign& campaign) {
  return std::any_of(campaign.tests.begin(), campaign.tests.end(),
                     [](const CampaignTest& test) { return test.kind == TestKind::path; });
}

Campaign readCampaign(const std::string& path) {
  const Campaign campaign = readCampaignWithPaths(path);
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind == TestKind::path)
      throw Error(
          path + ": test " + test.name +
          " is of kind path, expected cut, air, tap or move; `smartmill campaign` makes a campaign of "
          "its steady cuts");
  }
  return campaign;
}

Campaign readCampaignWithPaths(const std::string& path) {
  const fs::path file = fs::is_directory(path) ? fs::path(path) / "campaign.yaml" : fs::path(path);
  const StrictYaml root = StrictYaml::fromFile(file.string());
  Campaign campaign;
  campaign.folder = file.has_parent_path() ? file.parent_path().string() : ".";
  root.oneOf("format", {FORMAT});
  campaign.model_file = root.word("model");
  std::set<std::string> names;
  for (const StrictYaml& map : root.maps("tests")) {
    campaign.tests.push_back(readTest(map));
    if (!names.insert(campaign.tests.back().name).second) {
      map.fail("name", "'" + campaign.tests.back().name + "' is the name of two tests");
    }
  }
  readSlowChannels(root, campaign.tests);
  root.finish();
  return campaign;
}

void writeCampaign(const Campaign& campaign, const std::string& folder) {
  std::ostringstream out;
  out << "format: " << FORMAT << "\nmodel: " << yamlWord(campaign.model_file) << "\n";
  out << "tests:" << (campaign.tests.empty() ? " []" : "") << "\n";
  const auto number = [&out](const char* key, double value) {
    out << "  " << key << ": " << yamlNumber(value) << "\n";
  };
  for (const CampaignTest& test : campaign.tests) {
    out << "- name: " << yamlWord(test.name) << "\n  kind: " << testKindName(test.kind) << "\n";
    out << "  file: " << yamlWord(test.file) << "\n";
    if (!test.file_format.empty()) {
      out << "  file_format: " << test.file_format << "\n  channels:\n";
      for (const auto& [name, channel] : test.channels)
        out << "    " << name << ": " << yamlWord(channel) << "\n";
    }
    number("sample_rate_hz", test.sample_rate);
    number("spindle_speed_rpm", units::rpmFromRadPerSec(test.spindle_speed));
    if (test.engagement) {
      number("feed_per_tooth_mm", test.engagement->feed_per_tooth / units::MM);
      number("axial_depth_mm", test.engagement->axial_depth / units::MM);
      number("entry_deg", units::degFromRad(test.engagement->entry));
      number("exit_deg", units::degFromRad(test.engagement->exit));
      if (test.feed_direction != 0.0) number("feed_direction_deg", units::degFromRad(test.feed_direction));
    }
    if (test.engage_time) number("engage_time_s", *test.engage_time);
    if (test.running_before) number("running_before_s", *test.running_before);
    if (test.start_time) number("start_time_s", *test.start_time);
    if (test.cut_time_before) number("cut_time_before_s", *test.cut_time_before);
    if (!test.direction.empty()) out << "  direction: " << test.direction << "\n";
    if (test.program) write(*test.program, out);
    if (!test.stream_offset.empty()) out << "  stream_offset_s:\n";
    for (const auto& [group, offset] : test.stream_offset)
      out << "    " << group << ": " << yamlNumber(offset) << "\n";
    if (test.tachometer) {
      const PulseTachometerParameters& t = *test.tachometer;
      out << "  tachometer: {pulses_per_revolution: " << t.pulses_per_revolution
          << ", threshold_v: " << yamlNumber(t.threshold) << ", hysteresis_v: " << yamlNumber(t.hysteresis)
          << ", edge: " << (t.falling ? "falling" : "rising")
          << ", angle_deg: " << yamlNumber(units::degFromRad(t.angle)) << "}\n";
    }
  }
  std::error_code ignored;
  fs::create_directories(folder, ignored);
  const std::string file = (fs::path(folder) / "campaign.yaml").string();
  std::ofstream stream(file);
  stream << out.str();
  stream.close();
  if (!stream) throw Error(file + ": cannot be written");
}

}  // namespace smartmill
