// rosrun smartmill_studies loadmeter_shop_year: learning of a database that is filled by the cuts.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <string>
#include <vector>

#include "loadmeter/shop_year.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "study_case.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

constexpr double LAST_PART = 0.7;  // start of the last part, as share of the year

/// Queries of one part of the year.
struct Part {
  std::vector<double> errors;
  int queries = 0, inside = 0;

  void add(const ShopJob& job) {
    ++queries;
    if (!job.answered) return;
    errors.push_back(100.0 * job.error);
    inside += job.inside;
  }
  double at(double share) {
    if (errors.empty()) return std::nan("");
    std::sort(errors.begin(), errors.end());
    return errors[static_cast<std::size_t>(share * static_cast<double>(errors.size() - 1))];
  }
  void print(const char* name) {
    const double count = static_cast<double>(errors.size());
    std::printf("%-28s %5d %8zu %8.1f %8.1f %8.1f %%\n", name, queries, errors.size(), at(0.5), at(0.95),
                errors.empty() ? std::nan("") : 100.0 * inside / count);
  }
};

void print(const std::vector<ShopJob>& jobs, int days) {
  constexpr double ENDS[] = {0.0, 0.02,      0.06, 0.16,
                             0.4, LAST_PART, 1.0};  // as shares of the year: most is learnt early
  std::printf("%-28s %5s %8s %8s %8s %10s\n", "days", "jobs", "answered", "median %", "95 % [%]",
              "inside 95 %");
  for (std::size_t part = 0; part + 1 < std::size(ENDS); ++part) {
    Part all;
    const int from = static_cast<int>(ENDS[part] * days), to = static_cast<int>(ENDS[part + 1] * days);
    for (const ShopJob& job : jobs)
      if (job.day >= from && job.day < to) all.add(job);
    all.print((std::to_string(from + 1) + " .. " + std::to_string(to)).c_str());
  }
  for (const bool met : {true, false}) {
    Part part;
    for (const ShopJob& job : jobs)
      if (job.met == met) part.add(job);
    part.print(met ? "pairs that have met" : "pairs that have never met");
  }
  for (const EstimationMethod way : {EstimationMethod::pair, EstimationMethod::shear_zone,
                                     EstimationMethod::standard_cuts, EstimationMethod::other_tool}) {
    Part part;
    for (const ShopJob& job : jobs)
      if (job.answered && job.way == way) part.add(job);
    part.print(nameOf(way));
  }
}

void save(const std::vector<ShopJob>& jobs, const std::string& file) {
  CsvWriter csv("day,met,answered,way,error,inside,width", 6);
  for (const ShopJob& j : jobs)
    csv.row(j.day + 1, static_cast<int>(j.met), static_cast<int>(j.answered), j.answered ? nameOf(j.way) : "",
            j.error, static_cast<int>(j.inside), j.width);
  csv.save(file);
}

/// Results of a year, for all jobs and for those of its last part.
nlohmann::json lineOf(int number, const std::vector<ShopJob>& jobs, int days) {
  nlohmann::json line{{"case", number}};
  const auto add = [&](const std::string& name, const auto& belongs) {
    Part part;
    for (const ShopJob& job : jobs)
      if (belongs(job)) part.add(job);
    const auto answered = static_cast<double>(part.errors.size());
    line[name] = {{"jobs", part.queries},
                  {"answered", part.errors.size()},
                  {"median_percent", part.at(0.5)},
                  {"percent_95", part.at(0.95)},
                  {"inside", part.errors.empty() ? std::nan("") : part.inside / answered}};
  };
  add("whole_year", [](const ShopJob&) { return true; });
  add("last_part", [days](const ShopJob& job) { return job.day >= LAST_PART * days; });
  add("never_met", [](const ShopJob& job) { return !job.met; });
  return line;
}

void report(const std::vector<nlohmann::json>& lines) {
  if (lines.empty()) throw Error("no case");
  std::printf("%zu shops, means over them\n%-12s %8s %8s %8s %8s %10s\n", lines.size(), "", "jobs",
              "answered", "median %", "95 % [%]", "inside 95 %");
  for (const char* name : {"whole_year", "last_part", "never_met"}) {
    const auto mean = [&](const char* field) {
      double sum = 0.0, count = 0.0;
      for (const nlohmann::json& line : lines) {
        const double value = numberOf(line.at(name), field);
        if (std::isnan(value)) continue;
        sum += value;
        ++count;
      }
      return sum / count;
    };
    std::printf("%-12s %8.1f %8.1f %8.1f %8.1f %8.1f %%\n", name, mean("jobs"), mean("answered"),
                mean("median_percent"), mean("percent_95"), 100.0 * mean("inside"));
  }
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "A year of a shop whose database starts empty and stores every cut: errors of its estimates.");
  ShopOptions options;
  std::string out;
  int shops = 1;
  StudyCase one;
  one.addTo(line, "--cases", shops, "number of shops, for --case");
  one.addScore(line);
  line.option("--days", options.days, "working days (250)");
  line.option("--jobs", options.jobs, "jobs per day (4)");
  line.option("--cuts", options.cuts, "cuts per job (4)");
  line.option("--tools", options.tools, "(8)");
  line.option("--materials", options.materials, "(6)");
  line.option("--seed", options.seed, "(1)");
  line.option("-o,--out", out, "CSV of all jobs");
  return runProgram(line, argc, argv, [&] {
    one.check(shops);
    if (one.scores()) return report(readJsonLines(one.lines));
    if (one.one()) {
      options.seed = static_cast<unsigned>(seedOfCase(options.seed, one.number));
      return one.print(lineOf(one.number, shopYear(options), options.days));
    }
    if (shops > 1) throw UsageError("--cases: requires --case");
    const auto jobs =
        shopYear(options, [](double share) { std::fprintf(stderr, "\r%3.0f %%", 100.0 * share); });
    std::fprintf(stderr, "\n");
    print(jobs, options.days);
    if (!out.empty()) save(jobs, out);
  });
}
