#include "smartmill_core/modal/hit_check.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

constexpr double RATE = 25600.0;
constexpr std::size_t BEGIN = 256;

// A half-sine hit of 0.3 ms and the acceleration of two modes, with noise.
Hit simulatedHit(unsigned seed, const std::function<double(double)>& second = {}) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  ModalModel model;
  model.modes = {{900.0, 0.02, 1e-8}, {2300.0, 0.015, 4e-9}};
  ModalFilter filter(model, RATE, Hold::first_order);
  Hit hit;
  hit.sample_rate = RATE;
  hit.pre_trigger = BEGIN;
  const double peak = 100.0 + 20.0 * normal(random);
  for (std::size_t i = 0; i < 5120; ++i) {
    const double t = (static_cast<double>(i) - static_cast<double>(BEGIN)) / RATE;
    double f = t > 0.0 && t < 0.3e-3 ? peak * std::sin(units::PI * t / 0.3e-3) : 0.0;
    if (second) f += peak * second(t);
    filter.step(f);
    hit.force.push_back(f + 0.2 * normal(random));
    hit.response.push_back(filter.acceleration() + 0.02 * normal(random));
  }
  return hit;
}

TEST(HitCheck, AcceptsCleanHits) {
  for (unsigned seed = 1; seed <= 100; ++seed) EXPECT_EQ(hitFault(simulatedHit(seed), {}).text, "") << seed;
}

// A structure that hardly decays within the record, which begins with the hit: its ringing is not noise.
TEST(HitCheck, AcceptsHitsOfLongDecay) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  Hit hit;
  hit.sample_rate = RATE;
  hit.pre_trigger = 10;
  for (std::size_t i = 0; i < 25600; ++i) {
    const double t = (static_cast<double>(i) - 10.0) / RATE;
    hit.force.push_back((t > 0.0 && t < 0.3e-3 ? 13.0 * std::sin(units::PI * t / 0.3e-3) : 0.0) +
                        0.01 * normal(random));
    hit.response.push_back((t > 0.0 ? 20.0 * std::exp(-0.2 * t) * std::sin(units::TWO_PI * 320.0 * t) : 0.0) +
                           0.02 * normal(random));
  }
  EXPECT_EQ(hitFault(hit, {}).text, "");
  EXPECT_NEAR(noiseUnderRinging({hit.response.end() - 2560, hit.response.end()}), 0.02, 0.004);
}

TEST(HitCheck, RejectsDoubleHits) {
  for (unsigned seed = 1; seed <= 60; ++seed) {
    std::mt19937 random(seed);
    const double size = std::uniform_real_distribution<double>(0.2, 0.6)(random);
    const double gap = std::uniform_real_distribution<double>(0.5e-3, 3e-3)(random);
    const Hit hit = simulatedHit(seed, [&](double t) {
      return t > gap && t < gap + 0.3e-3 ? size * std::sin(units::PI * (t - gap) / 0.3e-3) : 0.0;
    });
    EXPECT_NE(hitFault(hit, {}).text.find("double hit"), std::string::npos)
        << seed << " " << size << " " << gap;
  }
}

TEST(HitCheck, NamesEachFault) {
  const auto reason = [](const std::function<void(Hit&)>& spoil, HitCheckOptions options = {}) {
    Hit hit = simulatedHit(7);
    spoil(hit);
    return hitFault(hit, options).text;
  };
  const auto contains = [](const std::string& text, const char* word) {
    return text.find(word) != std::string::npos;
  };
  const auto largest = [](const std::vector<double>& v) { return *std::max_element(v.begin(), v.end()); };
  EXPECT_PRED2(contains, reason([&](Hit& h) {
                 const double top = 0.6 * largest(h.force);
                 for (double& f : h.force) f = std::min(f, top);
               }),
               "clipped");
  EXPECT_PRED2(contains, reason([&](Hit& h) {
                 const double top = 0.4 * largest(h.response);
                 for (double& r : h.response) r = std::clamp(r, -top, top);
               }),
               "clipped");
  EXPECT_PRED2(contains, reason([&](Hit& h) { h.response[2000] += largest(h.response); }), "dropout");
  EXPECT_PRED2(contains, reason([&](Hit& h) {
                 for (std::size_t i = BEGIN; i < h.force.size(); ++i)
                   h.force[i] += 0.08 * largest(h.force) * static_cast<double>(i - BEGIN) / 4864.0;
               }),
               "baseline");
  EXPECT_PRED2(contains, reason([](Hit& h) {
                 std::fill(h.response.begin() + 290, h.response.begin() + 330, h.response[290]);
               }),
               "stuck");
  EXPECT_PRED2(contains, reason([&](Hit& h) {
                 const double size = 0.8 * largest(h.response);
                 for (std::size_t i = 3800; i < 4300; ++i)
                   h.response[i] += size * std::sin(0.3 * static_cast<double>(i));
               }),
               "late bump");
  EXPECT_PRED2(contains,
               reason(
                   [](Hit& h) {
                     for (double& f : h.force) f *= 0.1;
                   },
                   {20.0, 0.1, 0.0, 0.0}),
               "weak");
  EXPECT_PRED2(contains, reason([](Hit& h) {
                 for (std::size_t i = 0; i < h.force.size(); i += 2) h.force[i] += 30.0;
               }),
               "weak");
  EXPECT_PRED2(contains, reason([](Hit&) {}, {0.0, 0.1, 0.0, 9000.0}), "dull");
  EXPECT_EQ(reason([](Hit&) {}, {0.0, 0.1, 0.0, 2000.0}), "");
}

TEST(HitCheck, ComparesHits) {
  std::vector<Hit> hits;
  for (unsigned seed = 1; seed <= 5; ++seed) hits.push_back(simulatedHit(seed));
  const std::vector<bool> all(5, true);
  for (const HitFault& fault : faultsAmongHits(hits, all)) EXPECT_EQ(fault.text, "");
  for (double& r : hits[3].response) r *= 1.3;
  EXPECT_NE(faultsAmongHits(hits, all)[3].text.find("gain jump"), std::string::npos);
  for (double& r : hits[3].response) r /= 1.3;
  std::rotate(hits[1].response.begin(), hits[1].response.end() - 2, hits[1].response.end());
  EXPECT_NE(faultsAmongHits(hits, all)[1].text.find("skew"), std::string::npos);
}

}  // namespace
}  // namespace smartmill
