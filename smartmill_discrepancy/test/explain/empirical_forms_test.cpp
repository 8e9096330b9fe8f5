// Every empirical form, added to the records: identified by stage, form, size and sentence if it is
// reproducible.
#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "explain/hidden_cause_campaign.h"

namespace smartmill::discrepancy {
namespace {

// The cause is found in that form, with a residual of noise.
void expectBuilt(const Explanation& e, const char* form, const char* sentence) {
  expectGapClosed(e);
  ASSERT_EQ(e.effects.size(), 1u);
  EXPECT_EQ(e.effects[0].name, std::string("empirical:") + form);
  EXPECT_NE(e.sentence.find(sentence), std::string::npos) << e.sentence;
}

using Extra = std::function<double(const CampaignTest&, double time, std::uint64_t seed)>;

// Adds a signal to a channel.
Explanation withExtra(const TemporaryFolder& folder, const char* channel, const Extra& extra) {
  return explained(
      [&](const CampaignTest& test, std::uint64_t seed) {
        Record record = pure(test, 1.0, seed);
        std::vector<double>& f = record.add(channel);
        for (std::size_t i = 0; i < f.size(); ++i) f[i] += extra(test, record.time[i], seed);
        addNoise(record, seed);
        return record;
      },
      folder.file("."), quickly());
}

// Chip force of one helical tooth, by slices with chip thickness c sin(phi).
void addTooth(const CampaignTest& test, int tooth, double share, Record& record) {
  const MachineModel machine = real();
  const CuttingCoefficients& k = *machine.cutting;
  constexpr int SLICES = 400;
  const double dz = test.engagement->axial_depth / SLICES, radius = machine.tool->radius();
  std::array<std::vector<double>*, 3> force{{&record.add("fx"), &record.add("fy"), &record.add("fz")}};
  for (std::size_t i = 0; i < record.size(); ++i) {
    if (record.time[i] < *test.engage_time) continue;
    const double tip = record.column("spindle_angle")[i] + units::TWO_PI / 4.0 * tooth;
    for (int s = 0; s < SLICES; ++s) {
      const double phi = tip - std::tan(machine.tool->helix) / radius * (s + 0.5) * dz;
      const double sn = std::sin(phi), cs = std::cos(phi);
      const double h = share * dz * test.engagement->feed_per_tooth * sn;
      if (h <= 0.0) continue;
      (*force[0])[i] += -k.ktc * h * cs - k.krc * h * sn;
      (*force[1])[i] += k.ktc * h * sn - k.krc * h * cs;
      (*force[2])[i] += k.kac * h;
    }
  }
}

TEST(EmpiricalForms, ToothFactor) {
  const TemporaryFolder folder;
  const Explanation e = explained(
      [](const CampaignTest& test, std::uint64_t seed) {
        Record record = pure(test, 1.0, seed);
        addTooth(test, 2, 0.25, record);
        addNoise(record, seed);
        return record;
      },
      folder.file("."), quickly());
  expectBuilt(e, "tooth_factor",
              "one tooth differs from the others: the cutting force of tooth 3 is 25 % more");
  EXPECT_NEAR(valueOf(e.effects[0], "factor[2]"), 1.25, 0.01);
}

/// A record with noise whose forces are multiplied by a factor. @param factor_at of the time of the record
/// [s]
template <class FactorAt>
Record multiplied(const CampaignTest& test, std::uint64_t seed, const FactorAt& factor_at) {
  Record record = pure(test, 1.0, seed);
  for (std::size_t i = 0; i < record.size(); ++i) {
    const double factor = factor_at(record.time[i]);
    for (const char* channel : FORCES_SHOWN) record.add(channel)[i] *= factor;
  }
  addNoise(record, seed);
  return record;
}

// A spot of the work 0.3 mm wide, at the same place of each cut: force of a rigid tool times 1.3.
TEST(EmpiricalForms, HardSpot) {
  const TemporaryFolder folder;
  const Explanation e = explained(
      [](const CampaignTest& test, std::uint64_t seed) {
        const double feed =
            test.engagement->feed_per_tooth * 4.0 * test.spindle_speed / units::TWO_PI / units::MM;
        return multiplied(test, seed, [&](double time) {
          const double off = (feed * (time - *test.engage_time) - 0.7) / 0.15;
          return 1.0 + 0.3 * std::exp(-0.5 * off * off);
        });
      },
      folder.file("."), quickly());
  expectBuilt(e, "force_course", "the cutting force changes along the feed");
  EXPECT_EQ(e.effects[0].words.at("over"), "path");
}

// Heat: the force falls with the time in cut, to 0.8 at 40 ms and back to 1 at 80 ms.
TEST(EmpiricalForms, ForceOverTimeInCut) {
  const TemporaryFolder folder;
  const Explanation e = explained(
      [](const CampaignTest& test, std::uint64_t seed) {
        return multiplied(test, seed, [&](double time) {
          const double t = time - *test.engage_time;
          return 1.0 - 0.2 * std::max(0.0, 1.0 - std::abs(t - 0.04) / 0.04);
        });
      },
      folder.file("."), quickly());
  expectBuilt(e, "force_course", "the cutting force changes with the time in cut");
  EXPECT_EQ(e.effects[0].words.at("over"), "time");
}

// Another place in each cut: not reproducible.
TEST(EmpiricalForms, RejectsHardSpotsAtRandomPlaces) {
  const TemporaryFolder folder;
  const Explanation e = explained(
      [](const CampaignTest& test, std::uint64_t seed) {
        const double place = 0.025 + 0.012 * static_cast<double>(seed * seed % 5);
        return multiplied(test, seed, [&](double time) {
          const double off = (time - place) / 0.004;
          return 1.0 + (seed % 2 ? 0.2 : -0.2) * std::exp(-0.5 * off * off);
        });
      },
      folder.file("."), quickly());
  EXPECT_EQ(e.verdict, Verdict::unknown_effect);
  EXPECT_TRUE(e.effects.empty()) << e.sentence;
}

TEST(EmpiricalForms, EdgeRunIn) {
  const TemporaryFolder folder;
  const Explanation e = explained(
      [](const CampaignTest& test, std::uint64_t seed) {
        const double factor = 1.0 + 0.35 * (1.0 - std::exp(-*test.cut_time_before / 45.0));
        Record record = pure(test, factor, seed);
        addNoise(record, seed);
        return record;
      },
      folder.file("."), quickly());
  expectBuilt(e, "edge_life", "exponentially with a time constant");
  EXPECT_NEAR(valueOf(e.effects[0], "time_constant_s"), 45.0, 8.0);
}

TEST(EmpiricalForms, StepInEachRecord) {
  const TemporaryFolder folder;
  const Explanation e = withExtra(folder, "fz", [](const CampaignTest&, double time, std::uint64_t) {
    return time > 0.0613 ? 9.0 : 0.0;
  });
  expectBuilt(e, "step", "s after the start of each record");
  EXPECT_NEAR(valueOf(e.effects[0], "amplitude"), 9.0, 0.1);
}

TEST(EmpiricalForms, Drift) {
  const TemporaryFolder folder;
  const Explanation e =
      withExtra(folder, "fz", [](const CampaignTest&, double time, std::uint64_t) { return -160.0 * time; });
  expectBuilt(e, "ramp", "linear like charge_drift");
  EXPECT_NEAR(valueOf(e.effects[0], "per_min"), -9600.0, 100.0);
}

// The zero of each record is another one; only the part before the engagement shows it.
TEST(EmpiricalForms, ZeroOfEachRecord) {
  const TemporaryFolder folder;
  const Explanation e = withExtra(folder, "fz", [](const CampaignTest&, double, std::uint64_t seed) {
    return 3.0 * static_cast<double>(seed * seed * 7 % 11) - 15.0;
  });
  expectBuilt(e, "zero", "the zero of fz differs from record to record");
  EXPECT_NEAR(valueOf(e.effects[0], "share"), 1.0, 0.02);
}

TEST(EmpiricalForms, WarmUp) {
  const TemporaryFolder folder;
  const Explanation e = withExtra(folder, "fz", [](const CampaignTest& test, double time, std::uint64_t) {
    return 9.0 * (1.0 - std::exp(-(*test.start_time + time) / 240.0));
  });
  expectBuilt(e, "approach", "exponentially with a time constant of 4 min");
  EXPECT_NEAR(valueOf(e.effects[0], "amplitude"), 9.0, 0.5);
}

TEST(EmpiricalForms, Bursts) {
  const TemporaryFolder folder;
  const Explanation e = withExtra(folder, "fy", [](const CampaignTest&, double time, std::uint64_t seed) {
    const double period = 0.0173, since = std::fmod(time + 0.0047 * static_cast<double>(seed), period);
    return 30.0 * std::exp(-since / 1.5e-3) * std::sin(units::TWO_PI * 1320.0 * since);
  });
  expectBuilt(e, "bursts", "fy rings every 0.0173 s");
  EXPECT_NEAR(valueOf(e.effects[0], "frequency_hz"), 1320.0, 5.0);
  EXPECT_NEAR(valueOf(e.effects[0], "amplitude"), 30.0, 0.6);
}

// A record simulated at a 16 times higher rate, changed, and decimated.
Record finely(const CampaignTest& test, std::uint64_t seed,
              const std::function<void(Record&, double step)>& change) {
  constexpr std::size_t FINE = 16;
  CampaignTest finer = test;
  finer.sample_rate *= FINE;
  Record fine = pure(finer, 1.0, seed), record;
  change(fine, 1.0 / finer.sample_rate);
  for (std::size_t i = 0; i < fine.size(); i += FINE) record.time.push_back(fine.time[i]);
  for (const std::string& name : fine.names) {
    std::vector<double>& values = record.add(name);
    for (std::size_t i = 0; i < fine.size(); i += FINE) values.push_back(fine.column(name)[i]);
  }
  addNoise(record, seed);
  return record;
}

// First-order low pass by its own recursion.
TEST(EmpiricalForms, LowPass) {
  const TemporaryFolder folder;
  const Explanation e = explained(
      [](const CampaignTest& test, std::uint64_t seed) {
        return finely(test, seed, [](Record& record, double step) {
          const double share = units::TWO_PI * 320.0 * step;
          double low = 0.0, last = 0.0;
          for (double& value : record.add("fy")) {
            low += share * (0.5 * (last + value) - low) / (1.0 + 0.5 * share);
            last = value;
            value = low;
          }
        });
      },
      folder.file("."), quickly());
  expectBuilt(e, "transfer", "like behind a first-order low pass");
  EXPECT_NEAR(valueOf(e.effects[0], "corner_hz"), 320.0, 5.0);
}

// By the recursion of a mode from fx to fz.
TEST(EmpiricalForms, ResonanceBetweenForces) {
  const TemporaryFolder folder;
  const Explanation e = explained(
      [](const CampaignTest& test, std::uint64_t seed) {
        return finely(test, seed, [](Record& record, double step) {
          const std::vector<double> fx = record.column("fx");
          std::vector<double>& fz = record.add("fz");
          const double w = units::TWO_PI * 870.0;
          double x = 0.0, v = 0.0;
          constexpr int INNER = 8;
          const double dt = step / INNER;
          for (std::size_t i = 1; i < fz.size(); ++i) {
            for (int k = 0; k < INNER; ++k) {
              const double f = fx[i - 1] + (fx[i] - fx[i - 1]) * (k + 0.5) / INNER;
              x += 0.5 * dt * v;
              v = (v * (1.0 - 0.03 * w * dt) + dt * w * w * (0.3 * f - x)) / (1.0 + 0.03 * w * dt);
              x += 0.5 * dt * v;
            }
            fz[i] += x;
          }
        });
      },
      folder.file("."), quickly());
  expectBuilt(e, "resonance", "fz has a resonance excited by fx at 8");
  EXPECT_NEAR(valueOf(e.effects[0], "frequency_hz"), 870.0, 1.0);
  EXPECT_NEAR(valueOf(e.effects[0], "gain"), 0.3, 0.01);
}

// Each record jumps at another time: not reproducible.
TEST(EmpiricalForms, RejectsStepsAtRandomTimes) {
  const TemporaryFolder folder;
  const Explanation e = withExtra(folder, "fz", [](const CampaignTest&, double time, std::uint64_t seed) {
    return (seed % 2 ? 4.0 : -4.0) * (time > 0.03 + 0.013 * static_cast<double>(seed * seed % 5) ? 1.0 : 0.0);
  });
  EXPECT_EQ(e.verdict, Verdict::unknown_effect);
  EXPECT_TRUE(e.effects.empty()) << e.sentence;
}

// Another tooth in each cut.
TEST(EmpiricalForms, RejectsAnotherToothInEachCut) {
  const TemporaryFolder folder;
  const Explanation e = explained(
      [](const CampaignTest& test, std::uint64_t seed) {
        Record record = pure(test, 1.0, seed);
        addTooth(test, static_cast<int>(seed % 4), 0.25, record);
        addNoise(record, seed);
        return record;
      },
      folder.file("."), quickly());
  EXPECT_EQ(e.verdict, Verdict::unknown_effect);
  EXPECT_TRUE(e.effects.empty()) << e.sentence;
}

}  // namespace
}  // namespace smartmill::discrepancy
