// rosrun smartmill_studies loadmeter_shop_year: does a database that compiles itself learn?

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

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT

/// What was asked in some part of the year.
struct Part {
  std::vector<double> errors;
  int asked = 0, inside = 0;

  void add(const ShopJob& job) {
    ++asked;
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
    std::printf("%-28s %5d %8zu %8.1f %8.1f %8.1f %%\n", name, asked, errors.size(), at(0.5), at(0.95),
                errors.empty() ? std::nan("") : 100.0 * inside / count);
  }
};

void print(const std::vector<ShopJob>& jobs, int days) {
  constexpr double ENDS[] = {0.0, 0.02, 0.06, 0.16, 0.4, 0.7, 1.0};  // of the year: most is learnt early
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
  for (const AnswerWay way :
       {AnswerWay::pair, AnswerWay::shear_zone, AnswerWay::standard_cuts, AnswerWay::other_tool}) {
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

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "A year of a shop whose database starts empty and keeps every cut: how wrong its answers are.");
  ShopOptions options;
  std::string out;
  line.option("--days", options.days, "working days (250)");
  line.option("--jobs", options.jobs, "a day (4)");
  line.option("--cuts", options.cuts, "a job (4)");
  line.option("--tools", options.tools, "(8)");
  line.option("--materials", options.materials, "(6)");
  line.option("--seed", options.seed, "(1)");
  line.option("-o,--out", out, "CSV of all jobs");
  return runProgram(line, argc, argv, [&] {
    const auto jobs =
        shopYear(options, [](double share) { std::fprintf(stderr, "\r%3.0f %%", 100.0 * share); });
    std::fprintf(stderr, "\n");
    print(jobs, options.days);
    if (!out.empty()) save(jobs, out);
  });
}
