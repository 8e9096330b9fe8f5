#include "loadmeter/fleet_history.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>
#include <set>
#include <sstream>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill::studies {
namespace {

using loadmeter::CoefficientRecord;
using Name = std::pair<std::string, std::size_t>;

bool same(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

std::vector<double> valuesOf(const CuttingCoefficients& c) {
  return {c.ktc, c.krc, c.kac, c.kte, c.kre, c.kae};
}

// The version of the software is added by the database.
bool haveSameContent(const CoefficientRecord& a, const CoefficientRecord& b) {
  const auto words = [](const CoefficientRecord& r) {
    return std::vector<std::string>{r.set.tool, r.set.material, r.set.source, r.machine, r.bag};
  };
  const auto numbers = [](const CoefficientRecord& r) {
    std::vector<double> all{r.set.stamp,
                            static_cast<double>(r.set.tests),
                            static_cast<double>(r.teeth),
                            r.diameter,
                            r.cutting_speed,
                            r.feed_per_tooth};
    for (const auto& values : {valuesOf(r.set.value), valuesOf(r.set.std_dev)})
      all.insert(all.end(), values.begin(), values.end());
    all.insert(all.end(), r.covariance.begin(), r.covariance.end());
    return all;
  };
  const std::vector<double> x = numbers(a), y = numbers(b);
  return words(a) == words(b) && std::equal(x.begin(), x.end(), y.begin(), same);
}

Name nameOf(const CoefficientRecord& record) {
  Name name{"", 0};
  std::istringstream(record.bag) >> name.first >> name.second;
  return name;
}

std::set<Name> numbersOf(const PushHistory& history, PushEvent::Kind kind) {
  std::set<Name> numbers;
  for (const auto& [machine, events] : history) {
    for (const PushEvent& event : events) {
      for (std::size_t n = event.first; event.kind == kind && n < event.last; ++n)
        numbers.emplace(machine, n);
    }
  }
  return numbers;
}

std::string textOf(const Name& name) {
  return "record " + std::to_string(name.second) + " of " + name.first;
}

}  // namespace

CoefficientRecord recordOf(const std::string& machine, std::size_t number) {
  std::mt19937 random(static_cast<unsigned>(std::hash<std::string>{}(machine) + 7919 * number));
  std::uniform_real_distribution<double> uniform;
  CoefficientRecord r;
  r.set.tool = number % 2 == 0 ? "endmill 12" : "endmill\t\"16\" \\N";
  r.set.material = "material " + std::to_string(number % 5);
  r.set.source = "load_meter";
  r.set.stamp = 1.7e9 + static_cast<double>(number) + uniform(random);
  r.set.tests = 3;
  r.set.value = {1e9 * uniform(random), NAN, NAN, 17e3, NAN, NAN};
  r.set.std_dev = {2e6, NAN, NAN, 100.0, NAN, NAN};
  r.machine = machine;
  r.teeth = 3;
  r.diameter = 0.012;
  r.cutting_speed = 0.5 + 10.0 * uniform(random);
  r.covariance[CoefficientRecord::covarianceIndex(0, 3)] = -uniform(random);
  r.bag = machine + " " + std::to_string(number);
  return r;
}

std::vector<PushEvent> readPushEvents(const std::string& file) {
  std::ifstream in(file);
  std::vector<PushEvent> events;
  for (std::string line; std::getline(in, line) && !in.eof();) {
    std::istringstream words(line);
    std::string kind;
    PushEvent event;
    words >> kind >> event.first >> event.last;
    if (!words || (kind != "attempted" && kind != "acknowledged"))
      throw Error(file + ": line '" + line + "', expected attempted or acknowledged and two numbers");
    event.kind = kind == "attempted" ? PushEvent::Kind::attempted : PushEvent::Kind::acknowledged;
    events.push_back(event);
  }
  return events;
}

std::vector<std::string> violationsOf(const PushHistory& history,
                                      const std::vector<CoefficientRecord>& server) {
  std::vector<std::string> violations;
  const std::set<Name> attempted = numbersOf(history, PushEvent::Kind::attempted);
  std::map<Name, std::size_t> stored;
  for (const CoefficientRecord& record : server) {
    const Name name = nameOf(record);
    ++stored[name];
    if (attempted.count(name) == 0) {
      violations.push_back(textOf(name) + " was sent by no client");
    } else if (!haveSameContent(record, recordOf(name.first, name.second))) {
      violations.push_back(textOf(name) + " has another content");
    }
  }
  for (const auto& [name, count] : stored) {
    if (count > 1) violations.push_back(textOf(name) + " is stored " + std::to_string(count) + " times");
  }
  for (const Name& name : numbersOf(history, PushEvent::Kind::acknowledged)) {
    if (stored.count(name) == 0) violations.push_back(textOf(name) + " was acknowledged and is not stored");
  }
  return violations;
}

UnknownRecords unknownOf(const PushHistory& history, const std::vector<CoefficientRecord>& server) {
  std::set<Name> stored;
  for (const CoefficientRecord& record : server) stored.insert(nameOf(record));
  const std::set<Name> acknowledged = numbersOf(history, PushEvent::Kind::acknowledged);
  UnknownRecords unknown;
  for (const Name& name : numbersOf(history, PushEvent::Kind::attempted)) {
    if (acknowledged.count(name) == 0) ++(stored.count(name) > 0 ? unknown.stored : unknown.absent);
  }
  return unknown;
}

}  // namespace smartmill::studies
