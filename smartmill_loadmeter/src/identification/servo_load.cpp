#include "smartmill_loadmeter/identification/servo_load.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

constexpr const char* FORMAT = "smartmill-servo-cuts/1";

ServoTest readTest(const StrictYaml& map) {
  ServoTest one;
  CampaignTest& test = one.test;
  test.name = map.word("name");
  test.kind = map.oneOf("kind", {"cut", "air"}) == "cut" ? TestKind::cut : TestKind::air;
  one.block = map.integer("block", 1, 99999);
  one.begin = map.optionalNumber("begin_s", Range::notNegative()).value_or(0.0);
  one.end = map.optionalNumber("end_s", Range::positive()).value_or(0.0);
  if (one.end > 0.0 && !(one.end > one.begin)) map.fail("end_s", "expected a time after begin_s");
  test.spindle_speed = units::radPerSecFromRpm(map.number("spindle_speed_rpm", Range::positive()));
  test.cut_time_before = map.optionalNumber("cut_time_before_s", Range::notNegative());
  if (test.kind == TestKind::cut) {
    Engagement e;
    e.feed_per_tooth = map.number("feed_per_tooth_mm", Range::positive()) * units::MM;
    e.axial_depth = map.number("axial_depth_mm", Range::positive()) * units::MM;
    const Range turn = Range::closed(0.0, 360.0);
    e.entry = units::radFromDeg(map.number("entry_deg", turn));
    e.exit = units::radFromDeg(map.number("exit_deg", turn));
    if (!(e.exit > e.entry)) map.fail("exit_deg", "expected an angle above entry_deg");
    test.engagement = e;
    if (one.begin == 0.0) test.engage_time = 0.0;
  }
  map.finish();
  return one;
}

}  // namespace

std::vector<ServoTest> readServoTests(const std::string& file) {
  const StrictYaml root = StrictYaml::fromFile(file);
  root.oneOf("format", {FORMAT});
  std::vector<ServoTest> tests;
  std::set<std::string> names;
  for (const StrictYaml& map : root.maps("tests")) {
    tests.push_back(readTest(map));
    if (!names.insert(tests.back().test.name).second)
      map.fail("name", "'" + tests.back().test.name + "' is the name of two tests");
  }
  root.finish();
  return tests;
}

void ServoLoad::add(const SampleBlock& block) {
  const std::size_t load = block.channel("spindle_load"), sequence = block.channel("sequence");
  if (rate_ != 0.0 && block.sample_rate != rate_) {
    throw Error(
        formatted("daq/servo: %.1f Hz after %.1f Hz, expected one sample rate", block.sample_rate, rate_));
  }
  const bool gap = rate_ != 0.0 && block.first_index != next_;
  rate_ = block.sample_rate;
  next_ = block.first_index + block.size();
  for (std::size_t i = 0; i < block.size(); ++i) {
    const int number = static_cast<int>(std::lround(block.at(i, sequence)));
    if (executions_.empty() || executions_.back().block != number)
      executions_.push_back({number, load_.size(), 0, false});
    Execution& now = executions_.back();
    now.gap = now.gap || (gap && i == 0);
    ++now.count;
    load_.push_back(block.at(i, load));
    time_.push_back(block.timeOf(i));
  }
}

std::vector<ServoLoad::Execution> ServoLoad::executionsOf(int block) const {
  std::vector<Execution> found;
  std::copy_if(executions_.begin(), executions_.end(), std::back_inserter(found),
               [block](const Execution& e) { return e.block == block; });
  return found;
}

std::vector<TestRecord> ServoLoad::records(const std::vector<ServoTest>& tests, double full_scale,
                                           const std::string& where) const {
  std::map<int, std::size_t> listed, taken;
  for (const ServoTest& test : tests) ++listed[test.block];
  std::vector<TestRecord> records;
  for (const ServoTest& test : tests) {
    const std::string of = where + ": test '" + test.test.name + "': ";
    const std::vector<Execution> executions = executionsOf(test.block);
    if (executions.size() != listed[test.block]) {
      throw Error(formatted("%sblock N%d is executed %zu times in the record, expected %zu, as listed",
                            of.c_str(), test.block, executions.size(), listed[test.block]));
    }
    const Execution& execution = executions[taken[test.block]++];
    if (execution.gap) throw Error(of + "samples of the record are lost, expected a continuous record");
    const auto sample = [&](double time) {
      return std::min(execution.count, static_cast<std::size_t>(std::ceil(time * rate_ - 1e-9)));
    };
    const std::size_t begin = sample(test.begin), end = test.end > 0.0 ? sample(test.end) : execution.count;
    const double duration = begin < end ? static_cast<double>(end - begin) / rate_ : 0.0;
    if (duration < SHORTEST - 1e-9)
      throw Error(
          formatted("%s%.3f s in the record, expected %.0f s or more", of.c_str(), duration, SHORTEST));
    TestRecord one;
    one.test = test.test;
    one.test.sample_rate = rate_;
    one.test.start_time = time_[execution.first] - time_.front();
    one.record.file = where;
    std::vector<double>& voltage = one.record.add("load_meter");
    for (std::size_t i = begin; i < end; ++i) {
      const double load = load_[execution.first + i];
      if (!std::isfinite(load)) throw Error(of + "its spindle load has a sample that is not a finite number");
      voltage.push_back(load * full_scale);
      one.record.time.push_back(static_cast<double>(i - begin) / rate_);
    }
    records.push_back(std::move(one));
  }
  return records;
}

}  // namespace smartmill::loadmeter
