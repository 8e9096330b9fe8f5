// rosrun smartmill_launch compare_bags LIVE.bag REPLAY.bag

#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/names.h"
#include "smartmill_core/program.h"
#include "smartmill_launch/comparison/topic_comparison.h"
#include "smartmill_recording/recording_reader.h"

namespace {

using namespace smartmill;
using namespace smartmill::session;

/// Key with the full stamp, so that results of equal stamps match.
std::string keyOf(const plain::Header& header, const std::string& about) {
  return about + (about.empty() ? "" : " ") + "at " +
         formatted("%u.%09u", header.stamp.sec, header.stamp.nsec);
}

ResultRecord begin(const plain::Header& header, const std::string& about) {
  ResultRecord record;
  record.key = keyOf(header, about);
  record.stamp = toSec(header.stamp);
  record.values = {static_cast<double>(header.stamp.sec), static_cast<double>(header.stamp.nsec)};
  record.words = {header.frame_id};
  return record;
}

void add(ResultRecord& record, const std::vector<double>& values) {
  record.values.push_back(static_cast<double>(values.size()));
  record.values.insert(record.values.end(), values.begin(), values.end());
}

ResultRecord recordOf(const plain::ForceBlock& m) {
  ResultRecord record = begin(m.header, "");
  record.key = "sample " + std::to_string(m.first_index);
  record.values.insert(record.values.end(), {m.sample_rate, static_cast<double>(m.status)});
  for (const std::vector<double>* axis : {&m.fx, &m.fy, &m.fz}) add(record, *axis);
  return record;
}

ResultRecord recordOf(const plain::Frf& m) {
  ResultRecord record = begin(m.header, m.tool + " " + m.point + " " + m.direction);
  record.words.push_back(m.unit);
  record.values.push_back(m.averages);
  for (const std::vector<double>* v : {&m.frequency, &m.real, &m.imag, &m.coherence, &m.standard_deviation})
    add(record, *v);
  return record;
}

ResultRecord recordOf(const plain::ModalModel& m) {
  ResultRecord record = begin(m.header, m.tool + " " + m.point + " " + m.direction);
  record.words.push_back(m.unit);
  for (const plain::Mode& mode : m.modes) {
    add(record, {mode.frequency, mode.damping_ratio, mode.gain, mode.frequency_std, mode.damping_ratio_std,
                 mode.gain_std});
  }
  add(record, {m.direct, m.direct_std, m.relative_error});
  return record;
}

ResultRecord recordOf(const plain::CuttingCoefficients& m) {
  ResultRecord record = begin(m.header, m.tool + " in " + m.material);
  record.words.push_back(m.source);
  add(record,
      {m.ktc, m.krc, m.kac, m.kte, m.kre, m.kae, m.ktc_std, m.krc_std, m.kac_std, m.kte_std, m.kre_std,
       m.kae_std, m.friction_viscous, m.friction_coulomb, static_cast<double>(m.test_count)});
  return record;
}

ResultRecord recordOf(const plain::ForceCurve& m) {
  ResultRecord record = begin(m.header, m.tool + " in " + m.material);
  record.words.insert(record.words.end(), m.cuts.begin(), m.cuts.end());
  for (const std::vector<double>* v : {&m.chip, &m.tangential, &m.radial, &m.tangential_std, &m.radial_std})
    add(record, *v);
  add(record, {m.rms, m.scatter});
  return record;
}

ResultRecord recordOf(const plain::StabilityChart& m) {
  ResultRecord record = begin(m.header, m.tool + " in " + m.material);
  record.words.push_back(m.method);
  add(record, {m.entry_angle, m.exit_angle, m.feed_per_tooth, m.absolute_depth_limit});
  for (const std::vector<double>* v :
       {&m.spindle_speed, &m.depth_limit, &m.chatter_frequency, &m.torque_depth_limit, &m.power_depth_limit})
    add(record, *v);
  for (const auto* points : {&m.recommended, &m.unstable}) {
    for (const plain::StabilityPoint& p : *points) {
      add(record, {p.spindle_speed, p.axial_depth, p.depth_limit, p.chatter_frequency, p.torque, p.power,
                   p.material_removal_rate});
    }
  }
  return record;
}

ResultRecord recordOf(const plain::ChatterState& m) {
  ResultRecord record = begin(m.header, m.condition);
  add(record, {static_cast<double>(m.valid), static_cast<double>(m.chatter), m.frequency, m.energy_ratio,
               m.severity});
  return record;
}

/// Stamp [s] of the first sensor block of the first bag. What a node made of blocks before it, which the
/// recorder did not get, cannot be repeated.
struct Beginning {
  double stamp = -std::numeric_limits<double>::infinity();

  void read(RecordingReader& bag) {
    for (const char* sensor : {names::DYNAMOMETER, names::SPINDLE_FORCE})
      bag.on<plain::SampleBlock>(sensor, [this](const plain::SampleBlock& block, double) {
        if (!std::isfinite(stamp)) stamp = toSec(block.header.stamp);
      });
  }
};

/// One topic of both bags.
struct Topic {
  std::string name;
  TopicComparison comparison;
  std::function<void(RecordingReader&, bool first)> attach;
};

template <class Message>
std::unique_ptr<Topic> topic(const char* name, double slack) {
  auto topic = std::make_unique<Topic>(Topic{name, TopicComparison(slack), {}});
  topic->attach = [target = topic.get()](RecordingReader& bag, bool first) {
    bag.on<Message>(target->name, [target, first](const Message& message, double) {
      if (first) {
        target->comparison.addFirst(recordOf(message));
      } else {
        target->comparison.addSecond(recordOf(message));
      }
    });
  };
  return topic;
}

int run(const std::string& first, const std::string& second, double slack, double most_lost) {
  // Single results must be in both recordings; of streams a recorder may miss the ends.
  Beginning beginning;
  std::vector<std::unique_ptr<Topic>> topics;
  topics.push_back(topic<plain::Frf>(names::TOOL_FRF, 0.0));
  topics.push_back(topic<plain::ModalModel>(names::TOOL_MODES, 0.0));
  topics.push_back(topic<plain::CuttingCoefficients>(names::COEFFICIENTS, 0.0));
  topics.push_back(topic<plain::ForceCurve>(names::FORCE_CURVE, 0.0));
  topics.push_back(topic<plain::StabilityChart>(names::STABILITY_CHART, 0.0));
  topics.push_back(topic<plain::ForceBlock>(names::FORCE_MEASURED, slack));
  topics.push_back(topic<plain::ForceBlock>(names::FORCE_COMPENSATED, slack));
  topics.push_back(topic<plain::ChatterState>(names::CHATTER_STATE, slack));
  for (const bool is_first : {true, false}) {
    RecordingReader bag(is_first ? first : second);
    if (is_first) beginning.read(bag);
    for (const auto& topic : topics) topic->attach(bag, is_first);
    bag.run();
  }
  bool same = true;
  std::size_t common = 0;
  for (const auto& topic : topics) {
    const TopicDifference difference = topic->comparison.result(beginning.stamp);
    std::printf("%s\n", difference.text(topic->name).c_str());
    const bool is_stream = topic->name.rfind("force/", 0) == 0 || topic->name == names::CHATTER_STATE;
    same = same && (is_stream ? difference.sameButFor(most_lost) : difference.same());
    common += difference.common;
  }
  if (common == 0) throw Error(first + " and " + second + ": no common result");
  return same ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  std::string first, second;
  double slack = 1.0, most_lost = 0.0;
  CommandLine line{
      "Compares the results in two recordings (a session and its replay) to the last digit; exit code 1 on "
      "any difference."};
  line.option("first", first, "bag").required();
  line.option("second", second, "bag").required();
  line.option("--slack", slack,
              "seconds of forces and verdicts that a recording may lack at its start and end")
      .showDefault()
      .notNegative();
  line.option("--most-lost", most_lost,
              "share of forces and verdicts that a recording may lack in between (busy computer)")
      .showDefault()
      .within(0.0, 1.0);
  return runProgram(line, argc, argv, [&] { return run(first, second, slack, most_lost); });
}
