#include "stability/twin_cuts.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t BATCH = 20;  // cuts a process: start-up costs little, progress is seen

/// A folder that goes when it is left.
class Scratch {
 public:
  Scratch() {
    std::string name = (fs::temp_directory_path() / "smartmill_twin_XXXXXX").string();
    if (!mkdtemp(name.data())) throw Error(name + ": " + std::strerror(errno));
    path_ = name;
  }
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

Record planned(const TwinCut& cut, const std::vector<std::string>& columns) {
  const double turn = units::TWO_PI / cut.speed;
  Record record;
  const int n = cut.samples * (cut.air + cut.revolutions);
  for (int i = 0; i < n; ++i) record.time.push_back(turn * i / cut.samples);
  const auto zeros = std::vector<double>(record.time.size(), 0.0);
  // Between two samples tooth 1 stands at +y: a sample (or a step of the simulator, a quarter of one) right
  // at an entry would be in or out of cut by rounding.
  constexpr double BETWEEN = 0.137;
  std::vector<double>& angle = record.add("spindle_angle");
  for (int i = 0; i < n; ++i) angle.push_back(units::TWO_PI * (i % cut.samples + BETWEEN) / cut.samples);
  for (const std::string& name : columns) record.add(name) = zeros;
  return record;
}

Campaign writePlan(const MachineModel& model, const std::vector<TwinCut>& cuts, std::size_t from,
                   std::size_t to, const std::vector<std::string>& columns, const fs::path& folder) {
  fs::create_directories(folder);
  Campaign campaign;
  campaign.folder = folder.string();
  campaign.model_file = "model.yaml";
  for (std::size_t i = from; i < to; ++i) {
    const TwinCut& cut = cuts[i];
    CampaignTest test;
    test.name = "cut_" + std::to_string(i);
    test.file = test.name + ".csv";
    test.sample_rate = cut.samples * cut.speed / units::TWO_PI;
    test.spindle_speed = cut.speed;
    test.engagement = cut.engagement;
    test.engage_time = cut.air * units::TWO_PI / cut.speed;
    campaign.tests.push_back(test);
    writeCsv(planned(cut, columns), (folder / test.file).string());
  }
  writeMachineModel(model, (folder / campaign.model_file).string());
  writeCampaign(campaign, folder.string());
  return campaign;
}

pid_t start(const std::string& program, const std::vector<std::string>& arguments, const fs::path& words) {
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, words.c_str(), O_WRONLY | O_CREAT | O_TRUNC,
                                   0600);
  pid_t child = 0;
  const int failed = posix_spawn(&child, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed) throw Error(program + ": " + std::strerror(failed));
  return child;
}

/// The last line that a program said.
std::string lastLine(const fs::path& words) {
  std::ifstream file(words);
  std::string line, last;
  while (std::getline(file, line))
    if (!line.empty()) last = line;
  return last;
}

}  // namespace

TwinCuts::TwinCuts(std::string simulate) : simulate_(std::move(simulate)) {
  if (simulate_.empty() || access(simulate_.c_str(), X_OK) != 0)
    throw Error("'" + simulate_ + "': the simulator (program simulate of smartmill_sim) is not there");
}

std::string TwinCuts::besideThisProgram() {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  if (error) return "";
  const fs::path program = self.parent_path().parent_path() / "smartmill_sim" / "simulate";
  return fs::exists(program, error) ? program.string() : "";
}

void TwinCuts::run(const std::vector<MachineModel>& models, const std::vector<TwinCut>& cuts,
                   const std::vector<std::string>& columns, bool noise, unsigned seed,
                   const std::function<void(std::size_t, const Record&)>& judge,
                   const std::function<void(double)>& progress) const {
  if (models.size() != 1 && models.size() != cuts.size())
    throw Error("simulator: one machine or one a cut is due");
  const std::size_t most = models.size() == 1 ? BATCH : 1;
  const Scratch scratch;
  struct Batch {
    std::size_t from = 0, to = 0;
    pid_t child = 0;
    Campaign campaign;
    fs::path in, out, words;
  };
  const std::size_t cores = std::max(1u, std::thread::hardware_concurrency());
  std::size_t done = 0;
  while (done < cuts.size()) {
    std::vector<Batch> running;
    std::string problem;
    try {
      for (std::size_t c = 0; c < cores && done < cuts.size(); ++c) {
        Batch batch;
        batch.from = done;
        // Evenly over the cores where few are left.
        const std::size_t left = (cuts.size() - done + cores - c - 1) / (cores - c);
        batch.to = done + std::min(most, left);
        const std::string name = std::to_string(c);
        batch.in = scratch.path() / ("in_" + name);
        batch.out = scratch.path() / ("out_" + name);
        batch.words = scratch.path() / ("words_" + name);
        fs::remove_all(batch.in);
        fs::remove_all(batch.out);
        batch.campaign = writePlan(models[models.size() == 1 ? 0 : batch.from], cuts, batch.from, batch.to,
                                   columns, batch.in);
        batch.child = start(simulate_,
                            {(batch.in / "model.yaml").string(), batch.in.string(), "-o", batch.out.string(),
                             "--noise", noise ? "on" : "off", "--seed", std::to_string(seed + batch.from)},
                            batch.words);
        running.push_back(batch);
        done = batch.to;
      }
    } catch (const std::exception& e) {
      problem = e.what();
    }
    for (const Batch& batch : running) {
      int status = 0;
      while (waitpid(batch.child, &status, 0) < 0 && errno == EINTR) {
      }
      if (problem.empty() && (!WIFEXITED(status) || WEXITSTATUS(status) != 0))
        problem = "simulator: " + lastLine(batch.words);
    }
    if (!problem.empty()) throw Error(problem);
    for (const Batch& batch : running) {
      const Campaign made = readCampaign(batch.out.string());
      for (std::size_t i = batch.from; i < batch.to; ++i)
        judge(i, readRecord(made, made.tests.at(i - batch.from)));
    }
    if (progress) progress(static_cast<double>(done) / static_cast<double>(cuts.size()));
  }
}

}  // namespace smartmill::stability
