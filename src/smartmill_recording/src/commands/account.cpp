#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "smartmill_core/formatted.h"
#include "smartmill_recording/account.h"
#include "smartmill_recording/commands.h"
#include "smartmill_recording/reading_progress.h"

namespace smartmill::recording {
namespace {

constexpr int INCOMPLETE = 3;  // exit code
constexpr std::size_t GAPS_PRINTED = 20;

using Kind = StreamGap::Kind;

std::string textOf(const StreamGap& gap) {
  const auto count = static_cast<unsigned long long>(gap.count);
  switch (gap.kind) {
    case Kind::messages:
      return formatted("%.3f s  %s: %llu messages lost between publisher and recorder", gap.stamp,
                       gap.topic.c_str(), count);
    case Kind::samples:
      return formatted("%.3f s  %s: %llu samples lost before they were published", gap.stamp,
                       gap.topic.c_str(), count);
    case Kind::repeated:
      return formatted("%.3f s  %s: %llu samples repeated", gap.stamp, gap.topic.c_str(), count);
    case Kind::unprocessed:
      break;
  }
  return formatted("%.3f s  %s: lacks %llu samples of the sensor", gap.stamp, gap.topic.c_str(), count);
}

// One line for each node, and one for each of its inputs that it has not received or used entirely.
void printInputs(const std::vector<InputAccount>& inputs) {
  if (inputs.empty()) return;
  std::printf("\n%-44s %7s %9s %6s %8s %8s\n", "node", "starts", "messages", "lost", "dropped", "refused");
  const auto print = [](const std::string& name, const std::string& starts, const InputAccount& account) {
    std::printf(
        "%-44s %7s %9llu %6llu %8llu %8llu\n", name.c_str(), starts.c_str(),
        static_cast<unsigned long long>(account.received), static_cast<unsigned long long>(account.lost),
        static_cast<unsigned long long>(account.dropped), static_cast<unsigned long long>(account.refused));
  };
  for (auto input = inputs.begin(); input != inputs.end();) {
    InputAccount node;
    std::vector<InputAccount> incomplete;
    for (node.node = input->node; input != inputs.end() && input->node == node.node; ++input) {
      node.starts = input->starts;
      node.received += input->received;
      node.lost += input->lost;
      node.dropped += input->dropped;
      node.refused += input->refused;
      if (input->lost + input->dropped + input->refused > 0) incomplete.push_back(*input);
    }
    print(node.node, std::to_string(node.starts), node);
    for (const InputAccount& one : incomplete) print("  " + one.topic, "", one);
  }
}

struct Arguments {
  std::vector<std::string> parts;
};

int run(const Arguments& arguments) {
  const RecordingAccount account = accountOf(arguments.parts, printReadingProgress);
  std::printf("%-44s %9s %6s %10s %6s %8s %10s %12s  %s\n", "topic", "messages", "lost", "samples", "lost",
              "not fin.", "rate [Hz]", "by stamps", "publisher");
  for (const StreamAccount& s : account.streams) {
    std::printf("%-44s %9llu %6llu", s.topic.c_str(), static_cast<unsigned long long>(s.messages),
                static_cast<unsigned long long>(s.lost_messages));
    if (s.sampled) {
      std::printf(" %10llu %6llu %8llu %10.1f %12.4f", static_cast<unsigned long long>(s.samples),
                  static_cast<unsigned long long>(s.lost_samples),
                  static_cast<unsigned long long>(s.not_finite), s.rate_stated, s.rate_seen);
    } else {
      std::printf(" %10s %6s %8s %10s %12s", "", "", "", "", "");
    }
    std::printf("  %s\n", s.publisher.c_str());
  }
  printInputs(account.inputs);
  for (std::size_t k = 0; k < std::min(GAPS_PRINTED, account.gaps.size()); ++k)
    std::printf("%s\n", textOf(account.gaps[k]).c_str());
  if (account.gaps.size() > GAPS_PRINTED)
    std::printf("and %zu more gaps\n", account.gaps.size() - GAPS_PRINTED);
  if (!account.isComplete()) {
    std::printf("incomplete: %zu gaps; nodes have lost %llu messages\n", account.gaps.size(),
                static_cast<unsigned long long>(account.lostByNodes()));
    return INCOMPLETE;
  }
  std::printf("complete: no message and no sample is missing\n");
  return 0;
}

}  // namespace

Command accountCommand() {
  Command command("account", "accounts for every message and sample of a recording");
  command.description =
      "Counts the messages of a recording by the sequence numbers of their headers, the samples of sensors "
      "and forces by their running index, the samples of the force sensor that have no compensated force, "
      "and "
      "by the topic health what each node has received, lost, dropped and refused.";
  command.examples = {{"session.bag", "proves that nothing is missing, or lists what is"},
                      {"week.bag week_1.bag week_2.bag", "a recording in parts"}};
  command.files = {{"RECORDING", "bag or MCAP file; several: parts of one recording, in order"}};
  command.exits = {{INCOMPLETE, "messages or samples are missing or repeated"}};
  command.setBody(run, [](CommandLine& line, Arguments& arguments) {
    line.option("RECORDING", arguments.parts, "bag or MCAP files, the parts of one recording in order")
        .required();
  });
  return command;
}

}  // namespace smartmill::recording
