#include "smartmill_core/model/effect_form.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "smartmill_core/units.h"

namespace smartmill {

namespace {

Coordinate coordinate(const std::string& name, const FitRange& range, double null = 0.0) {
  return {name, null, range.low, range.high, range.step, range.prior_std};
}

// 0 where the file omits an optional key.
double valueOf(const EffectEntry& entry, const std::string& key) {
  const auto found = entry.numbers.find(key);
  return found == entry.numbers.end() ? 0.0 : found->second;
}

std::vector<double> listOf(const EffectEntry& entry, const std::string& key) {
  const auto found = entry.lists.find(key);
  return found == entry.lists.end() ? std::vector<double>{} : found->second;
}

// Contrast k (from 0) of a list: the first k + 1 values against the next one; of length 1, sum 0.
double contrast(std::size_t k, std::size_t item) {
  const double n = static_cast<double>(k) + 1.0;
  if (item > k + 1) return 0.0;
  return (item <= k ? 1.0 : -n) / std::sqrt(n * (n + 1.0));
}

}  // namespace

EffectCoordinates amplitude(const std::string& key, const FitRange& range, double null) {
  return {{coordinate(key, range, null)},
          [key](const double* v, EffectEntry& e) { e.numbers[key] = v[0]; },
          [key](const EffectEntry& e, double* v) { v[0] = valueOf(e, key); }};
}

EffectCoordinates logarithm(const std::string& key, const FitRange& range, double of, double null) {
  return {{coordinate("ln " + key, range, null)},
          [key, of](const double* v, EffectEntry& e) { e.numbers[key] = of * std::exp(v[0]); },
          [key, of](const EffectEntry& e, double* v) { v[0] = std::log(valueOf(e, key) / of); }};
}

EffectCoordinates logarithmOfOnePlus(const std::string& key, const FitRange& range) {
  return {{coordinate("ln 1 + " + key, range)},
          [key](const double* v, EffectEntry& e) { e.numbers[key] = std::expm1(v[0]); },
          [key](const EffectEntry& e, double* v) { v[0] = std::log1p(valueOf(e, key)); }};
}

EffectCoordinates planar(const std::string& size_key, const std::string& angle_key, double limit, double step,
                         double prior_std) {
  const FitRange range{-limit, limit, step, prior_std};
  return {{coordinate(size_key + " cos", range), coordinate(size_key + " sin", range)},
          [size_key, angle_key](const double* v, EffectEntry& e) {
            e.numbers[size_key] = std::hypot(v[0], v[1]);
            const double angle = units::degFromRad(std::atan2(v[1], v[0]));
            e.numbers[angle_key] = angle < 0.0 ? angle + 360.0 : angle;
          },
          [size_key, angle_key](const EffectEntry& e, double* v) {
            const double size = valueOf(e, size_key), angle = units::radFromDeg(valueOf(e, angle_key));
            v[0] = size * std::cos(angle);
            v[1] = size * std::sin(angle);
          }};
}

EffectCoordinates sizes(const std::string& key, const std::string& y_ratio_key, const FitRange& range) {
  return {{coordinate(key, range), coordinate("y " + key, range)},
          [key, y_ratio_key](const double* v, EffectEntry& e) {
            e.numbers[key] = v[0];
            e.numbers[y_ratio_key] = v[0] != 0.0 ? v[1] / v[0] : 0.0;
          },
          [key, y_ratio_key](const EffectEntry& e, double* v) {
            v[0] = valueOf(e, key);
            v[1] = v[0] * valueOf(e, y_ratio_key);
          }};
}

EffectCoordinates powerLaw(const std::string& exponent_key, const std::string& reference_key, double middle,
                           double low, double high) {
  return {{{exponent_key, 0.0, -1.0, 1.0, 5e-05, 0.3}, {"level", 0.0, -1.0, 1.0, 5e-05, 0.2}},
          [=](const double* v, EffectEntry& e) {
            e.numbers[exponent_key] = v[0];
            const double steep = std::abs(v[0]) > 1e-9 ? v[0] : 1e-9;
            e.numbers[reference_key] =
                std::clamp(middle * std::exp(std::clamp(v[1] / steep, -20.0, 20.0)), low, high);
          },
          [=](const EffectEntry& e, double* v) {
            v[0] = valueOf(e, exponent_key);
            v[1] = v[0] * std::log(valueOf(e, reference_key) / middle);
          }};
}

EffectCoordinates saturating(const std::string& size_key, const std::string& constant_key, double time,
                             const FitRange& range) {
  constexpr double LEAST = 1.0 / 30.0, MOST = 50.0, USUAL = 0.6;  // constants over the time
  const auto share = [](double constants) { return std::exp(-1.0 / constants); };
  return {{coordinate(size_key + " so far", range),
           {"share to come", share(USUAL), share(LEAST), share(MOST), 1e-4, 0.3}},
          [=](const double* v, EffectEntry& e) {
            e.numbers[size_key] = v[0] / (1.0 - v[1]);
            e.numbers[constant_key] = -time / std::log(v[1]);
          },
          [=](const EffectEntry& e, double* v) {
            v[1] = share(valueOf(e, constant_key) / time);
            v[0] = valueOf(e, size_key) * (1.0 - v[1]);
          }};
}

EffectCoordinates pitches(const std::string& key, const ToolGeometry& tool, const FitRange& range) {
  EffectCoordinates c;
  std::vector<double> nominal;
  for (int k = 0; k < tool.teeth; ++k) {
    nominal.push_back(units::degFromRad(tool.pitchOf(k)));
    if (k + 1 < tool.teeth) c.coordinates.push_back(coordinate("pitch " + std::to_string(k), range));
  }
  c.write = [key, nominal](const double* v, EffectEntry& e) {
    constexpr double LEAST = 1.0;  // [deg]
    std::vector<double>& pitch = e.lists[key];
    double rest = 360.0;
    for (std::size_t k = 0; k + 1 < nominal.size(); ++k) {
      pitch.push_back(std::max(nominal[k] + v[k], LEAST));
      rest -= pitch.back();
    }
    pitch.push_back(std::max(rest, LEAST));
  };
  c.read = [key, nominal](const EffectEntry& e, double* v) {
    const std::vector<double> pitch = listOf(e, key);
    for (std::size_t k = 0; k + 1 < nominal.size(); ++k)
      v[k] = k < pitch.size() ? pitch[k] - nominal[k] : 0.0;
  };
  return c;
}

EffectCoordinates contrasts(const std::string& key, int teeth, const FitRange& range) {
  EffectCoordinates c;
  const auto count = static_cast<std::size_t>(teeth);
  for (std::size_t k = 0; k + 1 < count; ++k)
    c.coordinates.push_back(coordinate("contrast " + std::to_string(k) + " of " + key, range));
  c.write = [key, count](const double* v, EffectEntry& e) {
    std::vector<double>& list = e.lists[key];
    list.assign(count, 0.0);
    for (std::size_t item = 0; item < count; ++item) {
      for (std::size_t k = 0; k + 1 < count; ++k) list[item] += v[k] * contrast(k, item);
    }
  };
  c.read = [key, count](const EffectEntry& e, double* v) {
    const std::vector<double> list = listOf(e, key);
    for (std::size_t k = 0; k + 1 < count; ++k) {
      v[k] = 0.0;
      for (std::size_t item = 0; item < std::min(list.size(), count); ++item)
        v[k] += list[item] * contrast(k, item);
    }
  };
  return c;
}

EffectCoordinates tipMode(char axis) {
  constexpr double UM_PER_KN = 1e-9;  // [m/N]
  const std::string name(1, axis);
  const double frequency = std::log(1200.0), damping_ratio = std::log(0.04);
  const auto modesOf = [axis](auto& entry) -> auto& {
    return (axis == 'x' ? entry.flexibility.x : entry.flexibility.y).modes;
  };
  return {{{"ln " + name + " frequency_hz", frequency, std::log(100.0), std::log(8000.0), 2.5e-5, 1.0},
           {"ln " + name + " damping_ratio", damping_ratio, std::log(0.003), std::log(0.4), 5e-4, 1.0},
           {name + " compliance_um_per_kn", 0.0, 0.0, 1000.0, 5e-3, 100.0}},
          [=](const double* v, EffectEntry& e) {
            if (v[2] <= 0.0) return;  // zero compliance: no mode
            Mode mode;
            mode.frequency = std::exp(v[0]);
            mode.damping_ratio = std::exp(v[1]);
            mode.gain = v[2] * UM_PER_KN;
            modesOf(e).push_back(mode);
          },
          [=](const EffectEntry& e, double* v) {
            const bool none = modesOf(e).empty();
            v[0] = none ? frequency : std::log(modesOf(e).front().frequency);
            v[1] = none ? damping_ratio : std::log(modesOf(e).front().damping_ratio);
            v[2] = none ? 0.0 : modesOf(e).front().gain / UM_PER_KN;
          }};
}

EffectForm::EffectForm(std::vector<EffectCoordinates> terms) : terms_(std::move(terms)) {
  for (const EffectCoordinates& t : terms_)
    coordinates.insert(coordinates.end(), t.coordinates.begin(), t.coordinates.end());
}

EffectForm& EffectForm::named(const std::string& name) {
  variant = name;
  return *this;
}

EffectForm& EffectForm::onlyAfter(const std::string& earlier) {
  after = earlier;
  return *this;
}

EffectForm& EffectForm::word(const std::string& key, const std::string& value) {
  fixed_.words[key] = value;
  return *this;
}

EffectForm& EffectForm::number(const std::string& key, double value) {
  fixed_.numbers[key] = value;
  return *this;
}

EffectForm& EffectForm::list(const std::string& key, const Values& values) {
  fixed_.lists[key] = values;
  return *this;
}

EffectForm& EffectForm::straight(const Values& reaches) {
  for (const double reach : reaches) {
    Probe probe{nulls(), {}, false};
    for (std::size_t k = 0; k < coordinates.size(); ++k) {
      probe.points.push_back(probe.null);
      probe.points.back()[k] += reach;
    }
    probes.push_back(std::move(probe));
  }
  return *this;
}

EffectForm& EffectForm::scaled(double reach, const Values& scales) {
  const double null = coordinates.front().null;
  for (const double s : scales) probes.push_back({{null, std::log(s)}, {{null + reach, std::log(s)}}, false});
  return *this;
}

EffectForm& EffectForm::probe(const Values& null, const std::vector<Values>& points) {
  probes.push_back({null, points, false});
  return *this;
}

EffectForm& EffectForm::startingAt(const Values& point) {
  probes.push_back({nulls(), {point}, true});
  return *this;
}

EffectForm& EffectForm::foundInEachRecord(int count) {
  found_in_each_record = count;
  return *this;
}

EffectForm& EffectForm::searchedBy(SearchStrategy how) {
  strategy = how;
  return *this;
}

EffectForm& EffectForm::of(const std::vector<std::string>& names) {
  pieces = names;
  return *this;
}

EffectForm::Values EffectForm::nulls() const {
  Values v;
  for (const Coordinate& c : coordinates) v.push_back(c.null);
  return v;
}

EffectEntry EffectForm::entry(const Values& values) const {
  EffectEntry e = fixed_;
  e.name = effect;
  const double* next = values.data();
  for (const EffectCoordinates& t : terms_) {
    t.write(next, e);
    next += t.coordinates.size();
  }
  return e;
}

EffectForm::Values EffectForm::values(const EffectEntry& entry) const {
  Values v(coordinates.size(), 0.0);
  double* next = v.data();
  for (const EffectCoordinates& t : terms_) {
    t.read(entry, next);
    next += t.coordinates.size();
  }
  return v;
}

EffectForm::Values EffectForm::pieceOf(const Values& values, std::size_t piece) const {
  auto first = values.begin();
  for (std::size_t k = 0; k < piece; ++k) first += static_cast<std::ptrdiff_t>(terms_[k].coordinates.size());
  return {first, first + static_cast<std::ptrdiff_t>(terms_[piece].coordinates.size())};
}

}  // namespace smartmill
