#include "smartmill_recording/import/import_campaign.h"

#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <set>

#include "smartmill_core/campaign/slow_channels.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"

namespace smartmill::recording {
namespace {

namespace fs = std::filesystem;

constexpr int DIGITS = 9;  // as many as the CSV's writer prints; more than a converter of 24 bits has
constexpr const char* MODEL_FILE = "model.yaml";

/// A folder next to the target that disappears unless it becomes the target.
class NewFolder {
 public:
  explicit NewFolder(const std::string& target) : target_(fs::absolute(target).lexically_normal()) {
    if (!target_.has_filename()) target_ = target_.parent_path();
    if (fs::exists(target_) && !(fs::is_directory(target_) && fs::is_empty(target_)))
      throw Error(target + ": exists and is not an empty folder");
    std::error_code code;
    fs::create_directories(target_.parent_path(), code);
    std::string pattern = target_.string() + ".XXXXXX";
    if (!mkdtemp(pattern.data())) throw Error(target + ": cannot be created: " + std::strerror(errno));
    path_ = pattern;
    fs::permissions(path_,
                    fs::perms::owner_all | fs::perms::group_read | fs::perms::group_exec |
                        fs::perms::others_read | fs::perms::others_exec,
                    code);
  }
  ~NewFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;

  std::string file(const std::string& name) const { return path_ + "/" + name; }
  const std::string& path() const { return path_; }
  void keep() {
    std::error_code code;
    fs::rename(path_, target_, code);
    if (code) throw Error(target_.string() + ": cannot be written: " + code.message());
    path_.clear();
  }

 private:
  fs::path target_;
  std::string path_;
};

// File names of tests: letters, digits, - and _.
std::string testName(const std::string& path) {
  std::string name = fs::path(path).stem().string();
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '_') c = '_';
  }
  return name;
}

class Importer {
 public:
  Importer(const ImportPlan& plan, const std::string& folder, const RecordingImport& recordings)
      : plan_(plan), folder_(folder), recordings_(recordings) {}

  ImportResult run(const std::vector<std::string>& files) {
    std::set<std::string> given;
    for (const std::string& file : files) {
      if (given.insert(canonicalPath(file)).second)
        guarded(file);
      else
        result_.faults.push_back(file + ": given twice");
    }
    bool needs_tool = false;
    for (const CampaignTest& test : campaign_.tests) needs_tool = needs_tool || test.kind == TestKind::cut;
    writeModel(needs_tool || a_cut_);
    if (!result_.faults.empty()) return result_;
    campaign_.folder = folder_.path();
    campaign_.model_file = MODEL_FILE;
    writeCampaign(campaign_, slow_, folder_.path());
    readCampaign(folder_.path());  // as every tool will
    folder_.keep();
    return result_;
  }

 private:
  void guarded(const std::string& file) {
    try {
      const FileKind kind = fileKind(file);
      if (kind == FileKind::campaign) {
        const Campaign campaign = readCampaignWithPaths(file);
        if (!hasPaths(campaign)) {
          takeCampaign(campaign, file);
        } else {
          if (model_of_campaign_.empty()) model_of_campaign_ = campaign.modelPath();
          takeSteadyCuts(file, plan_.model.empty() ? campaign.modelPath() : plan_.model);
        }
      } else if (kind == FileKind::bag || kind == FileKind::mcap) {
        if (plan_.model.empty())
          throw Error(file +
                      ": a recording needs the machine model that it was made with (--model, or model in "
                      "import.yaml)");
        takeSteadyCuts(file, plan_.model);
      } else {
        takeChannels(file);
      }
    } catch (const Error& error) {
      result_.faults.push_back(error.what());
    }
  }

  void takeChannels(const std::string& file) {
    const TestSettings settings = plan_.settingsOf(file);
    const std::size_t before = result_.faults.size();
    CampaignTest test = testOf(settings, file);
    ChannelFile channels;
    try {
      channels = readChannelFile(file);
    } catch (const Error& error) {
      result_.faults.push_back(error.what());
      return;
    }
    const std::optional<TestKind> kind = settings.kind ? std::optional<TestKind>(test.kind) : std::nullopt;
    MappedRecord mapped = mapChannels(channels, settings.channels, kind, settings.sample_rate_hz);
    for (const std::string& fault : mapped.faults) result_.faults.push_back(file + ": " + fault);
    for (const std::string& note : channels.notes) result_.report.push_back(file + ": " + note);
    for (const std::string& line : mapped.report) result_.report.push_back(file + ": " + line);
    if (result_.faults.size() > before) return;
    test.sample_rate = mapped.sample_rate;
    result_.report.push_back(file + formatted(": test %s, %zu samples at %.10g Hz", test.name.c_str(),
                                              mapped.record.size(), mapped.sample_rate));
    add(test, mapped.record, file);
  }

  void takeCampaign(const Campaign& campaign, const std::string& file) {
    if (plan_.model.empty() && !campaign.model_file.empty() && model_of_campaign_.empty())
      model_of_campaign_ = campaign.modelPath();
    for (const CampaignTest& test : campaign.tests) {
      CampaignTest copy = test;
      copy.file_format.clear();
      copy.channels.clear();
      add(copy, readRecord(campaign, test), file);
      result_.report.push_back(file + ": test " + test.name + " as it is");
    }
    for (const SlowChannel& slow : readSlowChannels(campaign)) {
      SlowChannel copy = slow;
      copy.file = testName(slow.test) + "_" + slow.channel + ".csv";
      writeCsv(readRecord(campaign, slow), folder_.file(copy.file), DIGITS);
      slow_.push_back(copy);
    }
  }

  void takeSteadyCuts(const std::string& file, const std::string& model) {
    if (!recordings_)
      throw Error(file + ": recordings are not read here; expected files of channels or campaigns");
    const NewFolder recorded(folder_.file("recording"));
    takeCampaign(recordings_(file, model, recorded.path()), file);
  }

  void add(CampaignTest test, const Record& record, const std::string& file) {
    if (!names_.insert(test.name).second)
      throw Error(file + ": a second test named " + test.name +
                  "; expected different names (name in import.yaml)");
    test.file = testName(test.name + ".csv") + ".csv";
    if (!csv_names_.insert(test.file).second)
      test.file = formatted("test_%zu.csv", campaign_.tests.size() + 1);
    writeCsv(record, folder_.file(test.file), DIGITS);
    campaign_.tests.push_back(test);
  }

  /// A number that the test needs, or a fault.
  double needed(const TestSettings& settings, std::optional<double> TestSettings::*value,
                const std::string& file) {
    if (settings.*value) return *(settings.*value);
    for (const SettingKey& key : settingKeys()) {
      if (key.value == value)
        result_.faults.push_back(file + ": " + key.key + " is missing (expected in import.yaml or " +
                                 key.option + ")");
    }
    return 0.0;
  }

  CampaignTest testOf(const TestSettings& s, const std::string& file) {
    CampaignTest test;
    test.name = s.name ? *s.name : testName(file);
    if (!s.kind) {
      result_.faults.push_back(file +
                               ": kind is missing: cut, air or tap (expected in import.yaml or --kind)");
      return test;
    }
    test.kind = *s.kind == "cut" ? TestKind::cut : *s.kind == "air" ? TestKind::air : TestKind::tap;
    test.start_time = s.start_time_s;
    test.cut_time_before = s.cut_time_before_s;
    if (test.kind == TestKind::tap) {
      test.spindle_speed = units::radPerSecFromRpm(s.spindle_speed_rpm.value_or(0.0));
      if (s.direction) {
        test.direction = *s.direction;
      } else {
        result_.faults.push_back(
            file +
            ": direction is missing: x, y or z, the hammer's axis (expected in import.yaml or "
            "--direction)");
      }
      return test;
    }
    test.spindle_speed = units::radPerSecFromRpm(needed(s, &TestSettings::spindle_speed_rpm, file));
    test.running_before = s.running_before_s;
    if (test.kind == TestKind::air) return test;
    a_cut_ = true;
    Engagement e;
    e.feed_per_tooth = needed(s, &TestSettings::feed_per_tooth_mm, file) * units::MM;
    e.axial_depth = needed(s, &TestSettings::axial_depth_mm, file) * units::MM;
    e.entry = units::radFromDeg(needed(s, &TestSettings::entry_deg, file));
    e.exit = units::radFromDeg(needed(s, &TestSettings::exit_deg, file));
    if (s.entry_deg && s.exit_deg && !(*s.exit_deg > *s.entry_deg))
      result_.faults.push_back(
          file + formatted(": exit_deg: %g is out of range (> entry_deg %g)", *s.exit_deg, *s.entry_deg));
    if (s.engage_time_s && s.running_before_s)
      result_.faults.push_back(file + ": running_before_s contradicts engage_time_s");
    test.engagement = e;
    test.feed_direction = units::radFromDeg(s.feed_direction_deg.value_or(0.0));
    test.engage_time = s.engage_time_s;
    return test;
  }

  void writeModel(bool needs_tool) {
    const bool tool_given = plan_.tool.teeth || plan_.tool.diameter_mm || plan_.tool.helix_deg;
    const std::string given = plan_.model.empty() && !tool_given ? model_of_campaign_ : plan_.model;
    const std::string file = folder_.file(MODEL_FILE);
    if (!given.empty()) {
      try {
        const MachineModel model = readMachineModel(given);
        if (needs_tool && !model.tool)
          result_.faults.push_back(given + ": tool is missing (needed by every cut)");
        writeText(file, readText(given));
      } catch (const Error& error) {
        result_.faults.push_back(error.what());
      }
      return;
    }
    const auto missing = [&](const char* key, const char* option) {
      result_.faults.push_back(std::string("model: ") + key + " is missing (expected in import.yaml or " +
                               option + ", or a whole model with --model)");
    };
    if (needs_tool || tool_given) {
      if (!plan_.tool.teeth) missing("tool.teeth", "--teeth");
      if (!plan_.tool.diameter_mm) missing("tool.diameter_mm", "--diameter-mm");
      if (!plan_.tool.helix_deg) missing("tool.helix_deg", "--helix-deg");
      if (!plan_.tool.teeth || !plan_.tool.diameter_mm || !plan_.tool.helix_deg) return;
    }
    std::string lacks = needs_tool || tool_given ? "" : "tool, ";
    lacks += "cutting, tool_tip, force_sensor, spindle";
    std::string text =
        "# Made by smartmill campaign. Not stated: " + lacks + ".\nformat: smartmill-model/1\n";
    if (plan_.tool.teeth)
      text += formatted("tool: {teeth: %d, diameter_mm: %.10g, helix_deg: %.10g}\n", *plan_.tool.teeth,
                        *plan_.tool.diameter_mm, *plan_.tool.helix_deg);
    if (!plan_.measures.empty()) text += "force_sensor: {measures: " + plan_.measures + "}\n";
    writeText(file, text);
    readMachineModel(file);
    result_.report.push_back("model.yaml: made from the tool; not stated: " + lacks);
  }

  const ImportPlan& plan_;
  NewFolder folder_;
  const RecordingImport& recordings_;
  ImportResult result_;
  Campaign campaign_;
  std::vector<SlowChannel> slow_;
  std::set<std::string> names_, csv_names_;
  std::string model_of_campaign_;
  bool a_cut_ = false;
};

}  // namespace

ImportResult importCampaign(const ImportPlan& plan, const std::vector<std::string>& files,
                            const std::string& folder, const RecordingImport& recordings) {
  if (files.empty()) throw Error("no files; expected at least one (arguments, or files in import.yaml)");
  return Importer(plan, folder, recordings).run(files);
}

}  // namespace smartmill::recording
