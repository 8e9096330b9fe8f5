// The database under load: `lookup` among many records compared with baselines; `crash` kills writers while
// they write.
#include <signal.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <deque>
#include <exception>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_loadmeter/database/database.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT
using Clock = std::chrono::steady_clock;

double since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

CoefficientRecord recordOf(const std::string& tool, double stamp, double ktc, double cutting_speed) {
  CoefficientRecord r;
  r.set.tool = tool;
  r.set.material = "1018";
  r.set.source = "load_meter";
  r.set.stamp = stamp;
  r.set.tests = 3;
  r.set.value = {ktc, NOT_A_NUMBER, NOT_A_NUMBER, 17e3, NOT_A_NUMBER, NOT_A_NUMBER};
  r.set.std_dev = {2e6, NOT_A_NUMBER, NOT_A_NUMBER, 100.0, NOT_A_NUMBER, NOT_A_NUMBER};
  r.teeth = 3;
  r.diameter = 0.012;
  r.cutting_speed = cutting_speed;
  r.feed_per_tooth = 6e-5;
  return r;
}

void report(const char* name, std::vector<double> times) {
  std::sort(times.begin(), times.end());
  std::printf("%-62s median %8.2f ms, slowest %8.2f ms\n", name, 1e3 * times[times.size() / 2],
              1e3 * times.back());
}

void lookup(const std::string& file, int records) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform;
  CoefficientDatabase database(file);
  std::vector<CoefficientRecord> many;
  for (int i = 0; i < records; ++i) {
    // Half of them one pair: the worst case of an index.
    const std::string tool = i % 2 ? "common" : "tool " + std::to_string(i % 200);
    many.push_back(recordOf(tool, i, 1e9 * (0.8 + 0.4 * uniform(random)), 0.5 + 10.0 * uniform(random)));
  }
  database.add(many);
  std::vector<double> ours, scan, memory;
  sqlite3* db = nullptr;
  if (sqlite3_open(file.c_str(), &db) != SQLITE_OK) throw Error(file + ": cannot be opened");
  for (int i = 0; i < 60; ++i) {
    const CoefficientQuery query{i % 3 ? "common" : "tool 42", "1018", 0.5 + 10.0 * uniform(random), 6e-5};
    Clock::time_point begin = Clock::now();
    const auto found = database.estimate(query);
    const auto newest = database.find(query.tool, query.material);
    ours.push_back(since(begin));
    if (!found || !newest) throw Error("an existing pair was not found");
    if (i % 5) continue;  // both kinds of pair
    // "+" keeps the index out: every row is read.
    const std::string sql =
        "SELECT max(stamp), avg(ktc) FROM coefficients WHERE +material = '1018' AND +tool = '" + query.tool +
        "' AND +cutting_speed BETWEEN " + std::to_string(0.9 * query.cutting_speed) + " AND " +
        std::to_string(1.1 * query.cutting_speed);
    begin = Clock::now();
    if (sqlite3_exec(db, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK)
      throw Error(sqlite3_errmsg(db));
    scan.push_back(since(begin));
    begin = Clock::now();
    const auto all = database.records(query.tool, query.material);
    memory.push_back(since(begin));
    if (all.empty()) throw Error("an existing pair was not read");
  }
  sqlite3_close(db);
  std::printf("%d records in a file, half of them one work-tool pair\n", records);
  report("estimate() with uncertainty, and find()", ours);
  report("baseline: SQLite scan of the table, no index", scan);
  report("baseline: every record of the pair read into memory", memory);
}

/// Processes that write records continuously and report the stamp of each acknowledged record through a pipe.
class Writers {
 public:
  explicit Writers(const std::string& file) : file_(file) {
    if (pipe(ends_) != 0) throw Error("no pipe");
  }

  void launch() {
    const int writer = launched_++;
    const pid_t pid = fork();
    if (pid < 0) throw Error("no process");
    if (pid == 0) writeForever(writer);
    running_.push_back(pid);
  }

  /// Kills the oldest process.
  void kill() {
    ::kill(running_.front(), SIGKILL);
    int status = 0;
    waitpid(running_.front(), &status, 0);
    by_itself_ = by_itself_ || !WIFSIGNALED(status);
    running_.pop_front();
  }

  /// Reads the pipe continuously, since a full pipe blocks the writers.
  void readFor(double time) {
    const Clock::time_point start = Clock::now();
    for (double left = time; left > 0.0; left = time - since(start)) {
      fd_set set;
      FD_ZERO(&set);
      FD_SET(ends_[0], &set);
      timeval wait{static_cast<time_t>(left),
                   static_cast<suseconds_t>(1e6 * (left - static_cast<int>(left)))};
      if (select(ends_[0] + 1, &set, nullptr, nullptr, &wait) <= 0) break;
      int stamp = 0;
      if (read(ends_[0], &stamp, sizeof stamp) == sizeof stamp) acknowledged_.insert(stamp);
    }
  }

  /// Kills all processes and reads the rest of the pipe.
  void end() {
    while (!running_.empty()) kill();
    close(ends_[1]);
    for (int stamp = 0; read(ends_[0], &stamp, sizeof stamp) == sizeof stamp;) acknowledged_.insert(stamp);
    close(ends_[0]);
  }

  const std::set<int>& acknowledged() const { return acknowledged_; }
  bool stoppedByThemselves() const { return by_itself_; }

 private:
  [[noreturn]] void writeForever(int writer) {
    close(ends_[0]);
    try {
      CoefficientDatabase database(file_);
      for (int i = 0;; ++i) {
        const int stamp = writer * 1000000 + i;
        database.add(recordOf("t", stamp, 1e9, 2.0));
        if (write(ends_[1], &stamp, sizeof stamp) != sizeof stamp) break;
      }
    } catch (const std::exception& error) {
      std::fprintf(stderr, "writer %d: %s\n", writer, error.what());
    }
    _exit(1);
  }

  std::string file_;
  int ends_[2] = {-1, -1};
  int launched_ = 0;
  std::deque<pid_t> running_;
  std::set<int> acknowledged_;
  bool by_itself_ = false;
};

// @return whether every acknowledged record is in the file.
bool crash(const std::string& file, int count, double seconds, double every) {
  Writers writers(file);
  for (int i = 0; i < count; ++i) writers.launch();
  const Clock::time_point begin = Clock::now();
  int kills = 0;
  for (; since(begin) < seconds; ++kills) {
    writers.readFor(every);
    writers.kill();
    writers.launch();
    if (isatty(STDERR_FILENO)) std::fprintf(stderr, "\r%.0f of %.0f s", since(begin), seconds);
  }
  if (isatty(STDERR_FILENO)) std::fprintf(stderr, "\n");
  writers.end();
  const CoefficientDatabase database(file);
  std::set<int> there;
  for (const CoefficientRecord& r : database.records("", "")) there.insert(static_cast<int>(r.set.stamp));
  std::size_t lost = 0;
  for (const int one : writers.acknowledged()) lost += there.count(one) == 0;
  std::printf(
      "%d writers for %.0f s, %d killed in between: %zu records acknowledged, %zu in the file, %zu lost%s\n",
      count, since(begin), kills, writers.acknowledged().size(), there.size(), lost,
      writers.stoppedByThemselves() ? "; a writer stopped by itself" : "");
  return lost == 0 && !writers.stoppedByThemselves();
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line("The database of coefficients under load.");
  int records = 100000, writers = 8;
  double seconds = 60.0, every = 1.0;
  const CommandOptions look =
      line.command("lookup", "time of a look-up among many records, compared with baselines");
  look.option("--records", records).showDefault().within(1000, 10000000);
  const CommandOptions kills = line.command(
      "crash", "kills writers while they write, and checks that every acknowledged record is stored");
  kills.option("--writers", writers).showDefault().within(1, 64);
  kills.option("--seconds", seconds).showDefault().positive();
  kills.option("--kill-every", every, "s").showDefault().positive();
  return runProgram(line, argc, argv, [&] {
    const TemporaryFolder folder;
    const std::string file = folder.file("study.sqlite");
    if (look.parsed()) {
      lookup(file, records);
      return 0;
    }
    return crash(file, writers, seconds, every) ? 0 : 1;
  });
}
