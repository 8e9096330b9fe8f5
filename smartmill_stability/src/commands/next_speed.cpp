#include "smartmill_stability/commands.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "commands/recording_file.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chatter/speed_search.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::stability;  // NOLINT

struct Request {
  std::vector<std::string> cuts;
  std::string speeds;
  int teeth = 0;
};

/// "RPM=stable", "RPM=HZ" or "RPM=FILE". @return nothing for a recording that does not decide
std::optional<HeardCut> cutOf(const std::string& text, int teeth) {
  const std::size_t at = text.find('=');
  char* end = nullptr;
  const double rpm = at == std::string::npos ? 0.0 : std::strtod(text.c_str(), &end);
  if (!(rpm > 0.0) || end != text.c_str() + at || at + 1 == text.size())
    throw UsageError("cut '" + text + "': expected RPM=stable, RPM=FREQUENCY [Hz] or RPM=FILE");
  const std::string what = text.substr(at + 1);
  HeardCut cut;
  cut.speed = units::radPerSecFromRpm(rpm);
  if (what == "stable") return cut;
  const double frequency = std::strtod(what.c_str(), &end);
  if (*end == '\0') {
    cut.frequency = frequency;
    return cut;
  }
  RecordingOptions options;
  options.file = what;
  RecordingRequest request;
  request.speed = cut.speed;
  request.teeth = teeth;
  request.validate();
  const RecordingVerdict verdict = judgeFile(options, request);
  std::printf("%s: %s\n", what.c_str(), verdict.text().c_str());
  if (verdict.kind == RecordingVerdict::Kind::stable) return cut;
  if (verdict.kind != RecordingVerdict::Kind::chatter) return std::nullopt;
  cut.frequency = verdict.frequency;
  return cut;
}

void run(const Request& request) {
  double low = 0.0, high = 0.0;
  char rest = 0;
  if (std::sscanf(request.speeds.c_str(), "%lf:%lf%c", &low, &high, &rest) != 2)
    throw UsageError("--speeds " + request.speeds + ": expected LO:HI [rpm]");
  SpeedSearch search(request.teeth, units::radPerSecFromRpm(low), units::radPerSecFromRpm(high));
  std::optional<HeardCut> last;
  for (const std::string& text : request.cuts) {
    last = cutOf(text, request.teeth);
    if (last) search.heard(*last);
  }
  if (last && !last->frequency) {
    std::printf("stable at %.0f rpm: no other speed is needed\n", units::rpmFromRadPerSec(last->speed));
    return;
  }
  const std::vector<SpeedProposal> best = bestProposals(search.proposals());
  if (best.empty()) throw Error("no cut with chatter was heard: expected one at least");
  const SpeedProposal next = search.next();
  std::printf("next: %.0f rpm, stable with a probability of %.0f %% at the same depth if any speed is\n",
              units::rpmFromRadPerSec(next.speed), 100.0 * next.stable);
  for (const SpeedProposal& p : best)
    std::printf("  %6.0f rpm  %3.0f %%\n", units::rpmFromRadPerSec(p.speed), 100.0 * p.stable);
}

}  // namespace

namespace smartmill::stability {

Command nextSpeedCommand() {
  Command command("next-speed",
                  "proposes the next spindle speed for a cut that chatters, from its sound alone");
  command.description =
      "Spindle speeds at which a chattering cut becomes stable at the same depth, with the probability of "
      "each, "
      "from the chatter frequencies and the stable cuts heard so far. No model is needed. Give all cuts in "
      "the order "
      "in which they were made.";
  command.examples = {
      {"--teeth 4 --speeds 6000:18000 8000=cut1.wav", "the sound of a cut at 8000 rpm"},
      {"--teeth 4 --speeds 6000:18000 8000=1068 16020=2210", "chatter frequencies [Hz] of two cuts"}};
  command.files = {
      {"CUT",
       "RPM=FILE (sound or other recording of the cut, as for `detect`), RPM=FREQUENCY [Hz] of the "
       "chatter, or RPM=stable"}};
  command.setBody(run, [](CommandLine& line, Request& request) {
    line.option("CUT", request.cuts, "cuts that were made").required();
    line.option("--teeth", request.teeth, "teeth of the tool").required().within(1, 40);
    line.option("--speeds", request.speeds, "range of the spindle LO:HI [rpm]").required();
  });
  return command;
}

}  // namespace smartmill::stability
