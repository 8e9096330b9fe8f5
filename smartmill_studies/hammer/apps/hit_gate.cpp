// rosrun smartmill_studies hammer_hit_gate [--records N] [--seed N]

#include <cstdint>
#include <cstdio>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/modal/hit_check.h"
#include "smartmill_core/program.h"
#include "smartmill_hammer_testing/hit_records.h"
#include "study_case.h"

namespace {

using namespace smartmill;
using hammer::HitClass;

struct Request {
  int records = 1000;
  std::uint64_t seed = 14;
  bool list = false;
  StudyCase one;
  int cases = 1;
};

/// Word of the rejection reason that identifies the fault of the class.
const std::map<HitClass, std::string> WORD = {
    {HitClass::double_hit, "double"},  {HitClass::clipping, "clipped"}, {HitClass::dropout, "dropout"},
    {HitClass::drift, "baseline"},     {HitClass::stuck, "stuck"},      {HitClass::late_bump, "late bump"},
    {HitClass::weak, "weak"},          {HitClass::dull, "dull"},        {HitClass::trigger_skew, "skew"},
    {HitClass::gain_jump, "gain jump"}};

/// Counts of a class: hits, rejected hits, hits rejected for the fault of the class, and rejected clean hits
/// of the same records.
struct Tally {
  int hits = 0, refused = 0, named = 0, beside = 0, beside_refused = 0;
};

bool isClean(HitClass kind) {
  return WORD.count(kind) == 0;
}

/// @param first, step selection of the records
Tally count(HitClass kind, const Request& request, int first, int step) {
  Tally tally;
  const bool clean = isClean(kind);
  for (int i = first; i < request.records; i += step) {
    const std::uint64_t seed = request.seed * 1000000 + static_cast<std::uint64_t>(i);
    const hammer::HitCase drawn = hammer::drawHitCase(kind, seed);
    HitCheckOptions options;
    options.weak_force = drawn.weak_force;
    options.high = drawn.high;
    const std::vector<HitFault> faults = checkHits(drawn.hits, options);
    for (std::size_t h = 0; h < faults.size(); ++h) {
      const std::string& text = faults[h].text;
      if (!clean && h != drawn.at_fault) {
        ++tally.beside;
        tally.beside_refused += !text.empty();
        continue;
      }
      ++tally.hits;
      tally.refused += !text.empty();
      tally.named += !clean && text.find(WORD.at(kind)) != std::string::npos;
      if (request.list && text.empty() != clean)
        std::printf("  %s, seed %llu: %s\n", nameOf(kind).c_str(), static_cast<unsigned long long>(seed),
                    text.empty() ? "accepted" : text.c_str());
    }
  }
  return tally;
}

using Tallies = std::map<HitClass, Tally>;
constexpr std::pair<const char*, int Tally::*> FIELDS[] = {{"hits", &Tally::hits},
                                                           {"refused", &Tally::refused},
                                                           {"named", &Tally::named},
                                                           {"beside", &Tally::beside},
                                                           {"beside_refused", &Tally::beside_refused}};

nlohmann::json lineOf(const Tallies& tallies) {
  nlohmann::json line;
  for (const auto& [kind, tally] : tallies) {
    for (const auto& [name, member] : FIELDS) line[nameOf(kind)][name] = tally.*member;
  }
  return line;
}

Tallies sumOf(const std::vector<nlohmann::json>& lines) {
  Tallies sum;
  for (int k = 0; k < hammer::HIT_CLASSES; ++k) {
    const auto kind = static_cast<HitClass>(k);
    for (const nlohmann::json& line : lines) {
      for (const auto& [name, member] : FIELDS)
        sum[kind].*member += line.at(nameOf(kind)).at(name).get<int>();
    }
  }
  return sum;
}

int report(const Tallies& tallies) {
  bool good = true;
  std::printf("%-20s %6s %9s %9s %7s  %s\n", "class", "hits", "accepted", "refused", "named",
              "clean hits refused");
  for (const auto& [kind, t] : tallies) {
    const double refused = 100.0 * t.refused / t.hits;
    std::printf("%-20s %6d %7.1f %% %7.1f %% %5.1f %%", nameOf(kind).c_str(), t.hits, 100.0 - refused,
                refused, 100.0 * t.named / t.hits);
    if (t.beside > 0) std::printf("  %d of %d", t.beside_refused, t.beside);
    std::printf("\n");
    good = good && (isClean(kind) ? refused <= 1.0 : refused >= 98.0);
  }
  std::printf("required: clean accepted 99 %%, each fault refused 98 %%: %s\n", good ? "met" : "missed");
  return good ? 0 : 1;
}

int run(const Request& request) {
  if (request.one.scores()) return report(sumOf(readJsonLines(request.one.lines)));
  request.one.check(request.cases);
  Tallies tallies;
  for (int k = 0; k < hammer::HIT_CLASSES; ++k) {
    const auto kind = static_cast<HitClass>(k);
    tallies[kind] = request.one.one() ? count(kind, request, request.one.number, request.cases)
                                      : count(kind, request, 0, 1);
    if (!request.one.one()) std::fprintf(stderr, "%d of %d classes\n", k + 1, hammer::HIT_CLASSES);
  }
  if (!request.one.one()) return report(tallies);
  request.one.print(lineOf(tallies));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line(
      "Acceptance of hits over random records: clean hits accepted, each kind of fault refused "
      "(smartmill_hammer_testing/hit_records.h).");
  line.option("--records", request.records, "records of each class").positive().showDefault();
  line.option("--seed", request.seed, "of the records").showDefault();
  request.one.addTo(line, "--cases", request.cases, "shares of the records");
  request.one.addScore(line);
  line.flag("--list", request.list, "list every misjudged record with its seed");
  return runProgram(line, argc, argv, [&] { return run(request); });
}
