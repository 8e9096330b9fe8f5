// rosrun smartmill_studies discrepancy_starts: convergence of fits of vibrating cuts from distant starts.

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "discrepancy/starts_case.h"
#include "smartmill_core/program.h"
#include "study_case.h"

namespace {

using namespace smartmill;

struct Options {
  std::vector<std::string> campaigns;
  StudyCase one;
  int starts = 100;
  std::uint64_t seed = 1;
};

// The campaigns in turn, each first unchanged and then with a chattering cut.
void runOne(const Options& o, int number) {
  const auto turn = static_cast<std::size_t>(number);
  const std::size_t count = o.campaigns.size();
  o.one.print(discrepancy::runStart(o.campaigns[turn % count], turn / count % 2 == 1, o.seed, number));
}

void run(const Options& o) {
  o.one.check(o.starts);
  if (o.one.one()) return runOne(o, o.one.number);
  for (int number = 0; number < o.starts; ++number) runOne(o, number);
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  CommandLine line{
      "Fits campaigns from nominal values up to 50 % off the truth. One line of JSON per start: distance of "
      "the result from the truth in standard deviations."};
  line.option("CAMPAIGN", o.campaigns, "folders with truth.yaml, used in turn").required();
  o.one.addTo(line, "--cases", o.starts, "starts");
  line.option("--seed", o.seed, "of the starts");
  return runProgram(line, argc, argv, [&] { run(o); });
}
