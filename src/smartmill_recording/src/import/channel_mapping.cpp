#include "smartmill_recording/import/channel_mapping.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "smartmill_core/campaign/record_columns.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_recording/import/names.h"
#include "smartmill_recording/import/unit.h"

namespace smartmill::recording {
namespace {

constexpr double SAME_RATE = 1e-3;   // as campaigns are read: 0.1 %
constexpr double WHOLE_RATE = 1e-5;  // printed times: a rate so close to a whole number of Hz is that number
constexpr const char* RESPONSES[] = {"acceleration", "displacement", "tool_x", "tool_y", "fx", "fy", "fz"};

struct Known {
  const char* column;
  Quantity quantity;
  const char* noun;
  std::vector<std::string> names;  // plainName()s that leave no doubt
};

const std::vector<Known>& knownColumns() {
  static const std::vector<Known> all{
      {"time", Quantity::time, "a time", {"time", "t", "timestamp", "zeit"}},
      {"spindle_angle", Quantity::angle, "an angle", {"spindleangle"}},
      {"fx", Quantity::force, "a force", {"fx", "forcex", "xforce"}},
      {"fy", Quantity::force, "a force", {"fy", "forcey", "yforce"}},
      {"fz", Quantity::force, "a force", {"fz", "forcez", "zforce"}},
      {"load_meter", Quantity::voltage, "a voltage", {"loadmeter", "spindleload"}},
      {"hammer",
       Quantity::force,
       "a force",
       {"hammer", "hammerforce", "forcehammer", "impacthammer", "impulsehammer"}},
      {"tool_x", Quantity::length, "a displacement", {"toolx"}},
      {"tool_y", Quantity::length, "a displacement", {"tooly"}},
      {"displacement", Quantity::length, "a displacement", {"displacement", "disp"}},
      {"acceleration",
       Quantity::acceleration,
       "an acceleration",
       {"acceleration", "acc", "accel", "accelerometer", "accx", "accy", "accz"}}};
  return all;
}

const Known& known(const std::string& column) {
  return *std::find_if(knownColumns().begin(), knownColumns().end(),
                       [&](const Known& k) { return column == k.column; });
}

std::string listOf(const std::vector<const FileChannel*>& channels) {
  constexpr std::size_t MOST = 12;
  std::string text;
  for (std::size_t i = 0; i < channels.size() && i < MOST; ++i) {
    const FileChannel& c = *channels[i];
    text += (i ? ", " : "") + c.name + (c.unit.empty() ? "" : "[" + c.unit + "]");
  }
  if (channels.size() > MOST) text += ", ...";
  return channels.empty() ? "none" : text;
}

std::string listOf(const ChannelFile& file) {
  std::vector<const FileChannel*> channels;
  for (const FileChannel& channel : file.channels) channels.push_back(&channel);
  return listOf(channels);
}

class Mapper {
 public:
  Mapper(const ChannelFile& file, const ChannelChoices& choices, std::optional<TestKind> kind)
      : file_(file), choices_(choices), kind_(kind) {
    result_.record.file = file.file;
  }

  MappedRecord run(std::optional<double> sample_rate) {
    for (const Known& column : knownColumns()) find(column);
    takeTime(sample_rate);
    for (const auto& [column, channel] : found_) {
      if (column != "time") takeColumn(column, *channel);
    }
    needed();
    std::vector<const FileChannel*> unused;
    for (const FileChannel& channel : file_.channels) {
      const bool used = std::any_of(found_.begin(), found_.end(),
                                    [&](const auto& entry) { return entry.second == &channel; });
      if (!used) unused.push_back(&channel);
    }
    if (!unused.empty()) result_.report.push_back("not used: " + listOf(unused));
    if (result_.faults.empty() && result_.record.names.empty())
      fault("no channel is used; the file has " + listOf(file_));
    return std::move(result_);
  }

 private:
  void fault(const std::string& what) { result_.faults.push_back(what); }

  const ChannelChoice* choiceOf(const std::string& column) const {
    const auto at = choices_.find(column);
    return at == choices_.end() ? nullptr : &at->second;
  }

  std::string hint(const std::string& column, const FileChannel& channel, const std::string& what) const {
    return "channels." + column +
           (what == "scale" ? ".scale in import.yaml or --channels "
                            : ".unit in import.yaml or --channels ") +
           column + "=" + channel.name +
           (what == "scale" ? "[" + unitText(column, channel) + "]*SCALE" : "[UNIT]");
  }

  std::string unitText(const std::string& column, const FileChannel& channel) const {
    const ChannelChoice* choice = choiceOf(column);
    return choice && choice->unit ? *choice->unit : channel.unit;
  }

  void find(const Known& column) {
    const ChannelChoice* choice = choiceOf(column.column);
    std::vector<const FileChannel*> candidates;
    if (choice && choice->name) {
      for (const FileChannel& c : file_.channels)
        if (c.name == *choice->name) candidates.push_back(&c);
      if (candidates.empty()) {
        for (const FileChannel& c : file_.channels)
          if (lastPart(c.name) == *choice->name) candidates.push_back(&c);
      }
      if (candidates.empty())
        return fault("channel " + *choice->name + " (for " + column.column + ") is missing; the file has " +
                     listOf(file_));
    } else {
      for (const FileChannel& c : file_.channels) {
        const std::string plain = plainName(c.name);
        const bool named =
            std::find(column.names.begin(), column.names.end(), plain) != column.names.end() ||
            (std::string(column.column) == "hammer" && kind_ == TestKind::tap && plain == "force");
        if (named && !chosen(c)) candidates.push_back(&c);
      }
      if (candidates.empty() && choice)
        return fault(std::string("no channel is named like ") + column.column + " (channels." +
                     column.column + ".name); the file has " + listOf(file_));
    }
    if (candidates.size() > 1) {
      ambiguous_.insert(column.column);
      std::string names;
      for (const FileChannel* c : candidates) names += (names.empty() ? "" : ", ") + c->name;
      return fault(std::string(column.column) + " may be any of " + names + "; state one (channels." +
                   column.column + ".name in import.yaml or --channels " + column.column + "=NAME)");
    }
    if (candidates.empty()) return;
    for (const auto& [other, channel] : found_) {
      if (channel == candidates.front())
        return fault("channel " + channel->name + " is stated for " + other + " and for " + column.column);
    }
    found_[column.column] = candidates.front();
  }

  // Stated for some column by name.
  bool chosen(const FileChannel& channel) const {
    return std::any_of(choices_.begin(), choices_.end(), [&](const auto& entry) {
      return entry.second.name &&
             (*entry.second.name == channel.name || *entry.second.name == lastPart(channel.name));
    });
  }

  /// Factor to SI, or nothing and a fault.
  std::optional<double> factorOf(const Known& column, const FileChannel& channel) {
    const ChannelChoice* choice = choiceOf(column.column);
    const std::string text = unitText(column.column, channel);
    const double scale = choice && choice->scale ? *choice->scale : 1.0;
    const std::string expected =
        unitsFor(column.quantity) + (column.quantity == Quantity::time || column.quantity == Quantity::voltage
                                         ? ""
                                         : ", or V or mV with a scale");
    if (text.empty()) {
      if (column.quantity == Quantity::time && stepsAreRate(channel)) return scale;
      fault("channel " + channel.name + ": no unit; expected one of " + expected + " (" +
            hint(column.column, channel, "unit") + ")");
      return std::nullopt;
    }
    const std::optional<Unit> unit = unitOf(text);
    if (!unit) {
      fault("channel " + channel.name + ": unknown unit '" + text + "'; expected one of " + expected + " (" +
            hint(column.column, channel, "unit") + ")");
      return std::nullopt;
    }
    if (unit->quantity == column.quantity) return unit->si * scale;
    const bool sensor = unit->quantity == Quantity::voltage || unit->quantity == Quantity::full_scale;
    if (!sensor || column.quantity == Quantity::time) {
      fault("channel " + channel.name + ": unit " + text + " is not " + column.noun + "; expected one of " +
            expected + " for " + column.column);
      return std::nullopt;
    }
    if (!choice || !choice->scale) {
      const char* si = column.quantity == Quantity::voltage        ? "V"
                       : column.quantity == Quantity::force        ? "N"
                       : column.quantity == Quantity::acceleration ? "m/s2"
                       : column.quantity == Quantity::angle        ? "rad"
                                                                   : "m";
      fault("channel " + channel.name + ": unit " + text + " without a sensitivity; expected " + si +
            (unit->quantity == Quantity::voltage ? " per V (" : " at full scale (") +
            hint(column.column, channel, "scale") + ")");
      return std::nullopt;
    }
    return unit->si * scale;
  }

  // Times without a unit are seconds where the file's own sample rate says so.
  bool stepsAreRate(const FileChannel& time) const {
    if (!file_.sample_rate || time.values.size() < 2) return false;
    const double step =
        (time.values.back() - time.values.front()) / static_cast<double>(time.values.size() - 1);
    return std::abs(step * *file_.sample_rate - 1.0) <= SAME_RATE;
  }

  void report(const std::string& column, const FileChannel& channel, double factor) {
    const std::string text = unitText(column, channel);
    result_.report.push_back(column + " from channel " + channel.name +
                             (text.empty() ? "" : " [" + text + "]") +
                             (factor == 1.0 ? "" : formatted(" x %.10g", factor)));
  }

  /// All finite; the first that is not makes a fault.
  bool finite(const FileChannel& channel) {
    const auto bad = std::find_if(channel.values.begin(), channel.values.end(),
                                  [](double v) { return !std::isfinite(v); });
    if (bad == channel.values.end()) return true;
    fault("channel " + channel.name + ": value " + std::to_string(bad - channel.values.begin() + 1) +
          " is not a finite number");
    return false;
  }

  void takeTime(std::optional<double> stated) {
    double rate = 0.0;
    const auto entry = found_.find("time");
    if (entry != found_.end()) {
      const FileChannel& channel = *entry->second;
      const std::optional<double> factor = factorOf(known("time"), channel);
      length_ = channel.values.size();
      length_of_ = channel.name;
      if (!factor || !finite(channel)) return;
      if (channel.values.size() < 2) return fault("channel " + channel.name + ": fewer than two samples");
      std::vector<double> time = channel.values;
      for (double& t : time) t *= *factor;
      const auto stop = std::adjacent_find(time.begin(), time.end(), std::greater_equal<>());
      if (stop != time.end())
        return fault(formatted("channel %s: times must increase: %g s at sample %zu, %g s at the next",
                               channel.name.c_str(), stop[0],
                               static_cast<std::size_t>(stop - time.begin()) + 1, stop[1]));
      if (const std::optional<UnevenStep> step = unevenStep(time))
        return fault(formatted("channel %s: uneven time: a step of %g s after sample %zu, %g s expected",
                               channel.name.c_str(), step->step, step->sample + 1, step->usual));
      rate = static_cast<double>(time.size() - 1) / (time.back() - time.front());
      const double whole = std::round(rate);
      if (whole > 0.0 && std::abs(rate - whole) < WHOLE_RATE * rate) rate = whole;
      report("time", channel, *factor);
      if (time.front() != 0.0)
        result_.report.push_back(
            formatted("time begins at %g s in the file, at 0 in the record", time.front()));
      if (!same(rate, stated, "--sample-rate-hz or import.yaml") ||
          !same(rate, file_.sample_rate, file_.sample_rate_from))
        return;
    } else if (stated) {
      rate = *stated;
      if (!same(rate, file_.sample_rate, file_.sample_rate_from)) return;
    } else if (file_.sample_rate) {
      rate = *file_.sample_rate;
      result_.report.push_back(
          formatted("sample rate %.10g Hz from %s", rate, file_.sample_rate_from.c_str()));
    } else if (!choiceOf("time") || !choiceOf("time")->name) {
      return fault(
          "sample_rate_hz is missing: no channel of time and no rate in the file (expected in import.yaml or "
          "--sample-rate-hz)");
    }
    result_.sample_rate = rate;
  }

  bool same(double rate, const std::optional<double>& other, const std::string& from) {
    if (!other || std::abs(rate / *other - 1.0) <= SAME_RATE) return true;
    fault(formatted("sample rate: %.10g Hz from %s, %.10g Hz from %s", rate,
                    found_.count("time") ? "the times" : "--sample-rate-hz or import.yaml", *other,
                    from.c_str()));
    return false;
  }

  void takeColumn(const std::string& column, const FileChannel& channel) {
    if (length_ == 0) {
      length_ = channel.values.size();
      length_of_ = channel.name;
    }
    const std::optional<double> factor = factorOf(known(column), channel);
    if (channel.values.size() != length_)
      return fault("channel " + channel.name +
                   formatted(": %zu values, %zu expected as of channel ", channel.values.size(), length_) +
                   length_of_);
    if (!finite(channel) || !factor) return;
    if (length_ < 2) return fault("channel " + channel.name + ": fewer than two samples");
    std::vector<double>& values = result_.record.add(column);
    values = channel.values;
    for (double& v : values) v *= *factor;
    if (column == "spindle_angle") {
      for (double& v : values) v -= units::TWO_PI * std::floor(v / units::TWO_PI);
    }
    report(column, channel, *factor);
    if (!result_.record.time.empty() || result_.sample_rate <= 0.0) return;
    for (std::size_t i = 0; i < length_; ++i)
      result_.record.time.push_back(static_cast<double>(i) / result_.sample_rate);
  }

  void needed() {
    const auto has = [&](const char* column) {
      return found_.count(column) > 0 || ambiguous_.count(column) > 0 ||
             choices_.count(column) > 0;  // a choice without its channel is a fault already
    };
    if (!kind_) return;
    if (*kind_ == TestKind::tap) {
      if (!has("hammer"))
        fault(
            "no hammer channel; expected a name like hammer with a unit of force, or --channels "
            "hammer=NAME[N]; the file has " +
            listOf(file_));
      if (std::none_of(std::begin(RESPONSES), std::end(RESPONSES), has))
        fault(
            "no response channel; expected acceleration, displacement, tool_x, tool_y, fx, fy or fz, or "
            "--channels "
            "acceleration=NAME[m/s2]; the file has " +
            listOf(file_));
    } else if (!has("fx") && !has("fy") && !has("fz") && !has("load_meter")) {
      fault(
          "no force channel; expected fx, fy or fz with a unit of force, or --channels fx=NAME[N]; the file "
          "has " +
          listOf(file_));
    }
  }

  const ChannelFile& file_;
  const ChannelChoices& choices_;
  std::optional<TestKind> kind_;
  std::map<std::string, const FileChannel*> found_;
  std::set<std::string> ambiguous_;  // columns with several candidates, a fault each
  std::size_t length_ = 0;
  std::string length_of_;
  MappedRecord result_;
};

}  // namespace

MappedRecord mapChannels(const ChannelFile& file, const ChannelChoices& choices, std::optional<TestKind> kind,
                         std::optional<double> sample_rate) {
  return Mapper(file, choices, kind).run(sample_rate);
}

}  // namespace smartmill::recording
