#include "smartmill_core/model/effect_catalogue.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/mill.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

constexpr int DRAWS = 20;

// With modes, so that every effect is possible.
MachineModel vibratingMill(int teeth) {
  MachineModel m = mill(teeth);
  for (ModalModel& axis : m.force_sensor.axis) {
    axis.modes = {{1200.0, 0.03, 0.9}};
    axis.direct = 0.1;
  }
  m.tool_tip.x.modes = {{1100.0, 0.04, 1.0 / 30e6}};
  return m;
}

EffectScope scopeOf(const MachineModel& model) {
  EffectScope scope{model, {"fx", "fy", "fz", "load_meter"}, {"x", "y", "z"}};
  scope.cuts = scope.start_times = scope.cut_times = true;
  scope.largest_force = 600.0;
  return scope;
}

// Equal to the digits of files.
void expectSame(const EffectEntry& a, const EffectEntry& b, double tolerance) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.words, b.words) << a.name;
  const auto x = numbersOf(a), y = numbersOf(b);
  ASSERT_EQ(x.size(), y.size()) << a.name;
  for (std::size_t k = 0; k < x.size(); ++k) {
    EXPECT_EQ(x[k].first, y[k].first);
    EXPECT_NEAR(x[k].second, y[k].second, tolerance * std::max(1.0, std::abs(x[k].second)))
        << a.name << "." << x[k].first;
  }
}

TEST(EffectCatalogue, everyEntryIsComplete) {
  const MachineModel model = vibratingMill(4);
  std::set<std::string> names;
  for (const EffectKind& kind : effectCatalogue()) {
    EXPECT_TRUE(names.insert(kind.name).second) << kind.name << " occurs twice";
    EXPECT_EQ(findEffect(kind.name), &kind);
    EXPECT_FALSE(kind.description.empty()) << kind.name;
    EXPECT_FALSE(kind.title.empty()) << kind.name;
    EXPECT_EQ(kind.title.find('_'), std::string::npos)
        << kind.name << ": words of a shop, not a name of the program";
    EXPECT_FALSE(kind.advice.empty()) << kind.name;
    EXPECT_FALSE(kind.source.empty()) << kind.name;
    EXPECT_FALSE(kind.parameters.empty()) << kind.name;
    EXPECT_FALSE(formsOf(kind, scopeOf(model)).empty()) << kind.name;
    EXPECT_FALSE(missingNeed(kind, scopeOf(model))) << kind.name;
  }
  EXPECT_EQ(findEffect("magic"), nullptr);
  // In the order in which they act.
  EXPECT_TRUE(std::is_sorted(effectCatalogue().begin(), effectCatalogue().end(),
                             [](const EffectKind& a, const EffectKind& b) { return a.stage < b.stage; }));
}

// The names and keys that other programs use too.
TEST(EffectCatalogue, hasTheNamesThatOtherProgramsUse) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> contract{
      {"runout", {"offset_um", "angle_deg"}},
      {"edge_forces", {"Kte_n_per_mm", "Kre_n_per_mm", "Kae_n_per_mm"}},
      {"size_effect", {"exponent", "reference_chip_um"}},
      {"tool_wear", {"edge_growth_per_min"}},
      {"cutting_speed", {"exponent", "reference_m_per_min"}},
      {"uneven_pitch", {"pitch_deg"}},
      {"helix", {"helix_deg"}},
      {"tool_flexibility", {"x", "y"}},
      {"process_damping", {"coefficient_n_per_mm"}},
      {"extra_mode", {"axis", "frequency_hz", "damping_ratio", "gain"}},
      {"mass_loading", {"mass_ratio"}},
      {"speed_dependent_mode", {"softening_per_krpm"}},
      {"cross_talk", {"xy", "xz", "yx", "yz", "zx", "zy"}},
      {"charge_drift", {"rate_n_per_min", "y_ratio"}},
      {"mains_hum", {"frequency_hz", "amplitude_n", "y_ratio"}},
      {"unbalance", {"mass_eccentricity_g_mm", "angle_deg"}},
      {"channel_delay", {"channel", "delay_us"}},
      {"gain_error", {"channel", "gain"}},
      {"saturation", {"limit_n"}},
      {"stribeck_friction", {"breakaway_nm", "speed_rpm"}},
      {"friction_warmup", {"cold_ratio", "time_constant_s"}},
      {"load_meter_lag", {"bandwidth_hz"}},
      {"depth_tilt", {"slope_um_per_mm"}},
      {"feed_error", {"ratio"}},
      {"tooth_radius", {"offset_um"}},
      {"thermal_growth", {"growth_um", "time_constant_s"}},
      {"chip_coefficients", {"Ktc_n_per_mm2", "Krc_n_per_mm2", "Kac_n_per_mm2"}},
      {"edge_buildup", {"chip_um"}},
      {"spindle_order", {"order", "x_n", "y_n", "z_n", "x_deg", "y_deg", "z_deg"}},
      {"zero_offset", {"x_n", "y_n", "z_n"}}};
  for (const auto& [name, keys] : contract) {
    const EffectKind* kind = findEffect(name);
    ASSERT_NE(kind, nullptr) << name;
    std::vector<std::string> own;
    for (const EffectParameter& p : kind->parameters) own.push_back(p.key);
    EXPECT_EQ(own, keys) << name;
  }
  EXPECT_EQ(findEffect("saturation")->parameters.at(0).unit, "N");
}

TEST(EffectCatalogue, namesQuantitiesInWords) {
  EXPECT_EQ(parameterOf(*findEffect("runout"), "offset_um").quantity(), "tool axis off centre by");
  EXPECT_EQ(parameterOf(*findEffect("cross_talk"), "xy").quantity(), "share of fy in fx");
  EXPECT_EQ(parameterOf(*findEffect("thermal_growth"), "time_constant_s").quantity(), "time constant");
  EXPECT_EQ(parameterOf(*findEffect("spindle_order"), "z_n").quantity(), "amplitude along z");
}

TEST(EffectCatalogue, anglesHaveTheShorterDifference) {
  const EffectKind &order = *findEffect("spindle_order"), &runout = *findEffect("runout");
  EXPECT_NEAR(parameterOf(order, "y_deg").difference(359.0, 2.0), -3.0, 1e-12);
  EXPECT_NEAR(parameterOf(order, "y_deg").scale(10.0), 57.29577951308232, 1e-12);  // one radian
  EXPECT_EQ(parameterOf(order, "y_n").difference(359.0, 2.0), 357.0);
  EXPECT_EQ(parameterOf(order, "y_n").scale(10.0), 10.0);
  EXPECT_NEAR(parameterOf(runout, "angle_deg").difference(-170.0, 170.0), 20.0, 1e-12);
  // Names of reports belong to a key; a pitch is a width, not a direction.
  EXPECT_EQ(parameterOf(*findEffect("uneven_pitch"), "pitch_deg[1]").difference(359.0, 2.0), 357.0);
  EXPECT_EQ(parameterOf(*findEffect("tool_flexibility"), "x[0].frequency_hz").key, "x");
  EXPECT_THROW(parameterOf(runout, "offset"), Error);
}

// Modes found axis by axis equal those of the form of both axes.
TEST(EffectCatalogue, piecesEqualTheWhole) {
  const MachineModel model = vibratingMill(2);
  const std::vector<EffectForm> forms = formsOf(*findEffect("tool_flexibility"), scopeOf(model));
  const auto named = [&](const std::string& variant) -> const EffectForm& {
    return *std::find_if(forms.begin(), forms.end(),
                         [&](const EffectForm& f) { return f.variant == variant; });
  };
  const EffectForm::Values x{7.0, -3.0, 20.0}, y{7.2, -3.1, 30.0}, both{7.0, -3.0, 20.0, 7.2, -3.1, 30.0};
  const EffectForm& whole = named("xy");
  EXPECT_EQ(whole.pieces, (std::vector<std::string>{"x", "y"}));
  EXPECT_EQ(whole.pieceOf(both, 0), x);
  EXPECT_EQ(whole.pieceOf(both, 1), y);
  auto parts = numbersOf(named("x").entry(x));
  const auto other = numbersOf(named("y").entry(y));
  parts.insert(parts.end(), other.begin(), other.end());
  EXPECT_EQ(numbersOf(whole.entry(both)), parts);
  for (const EffectKind& kind : effectCatalogue()) {
    for (const EffectForm& form : formsOf(kind, scopeOf(model)))
      EXPECT_TRUE(form.pieces.empty() || kind.name == "tool_flexibility") << form.title();
  }
}

TEST(EffectCatalogue, probesLieInsideTheBounds) {
  for (const int teeth : {2, 3, 4}) {
    const MachineModel model = vibratingMill(teeth);
    for (const EffectKind& kind : effectCatalogue()) {
      for (const EffectForm& form : formsOf(kind, scopeOf(model))) {
        const std::string name = form.title();
        EXPECT_EQ(form.effect, kind.name);
        EXPECT_EQ(form.probes.empty(), form.strategy != EffectForm::SearchStrategy::none) << name;
        for (const Coordinate& c : form.coordinates) {
          EXPECT_LT(c.low, c.high) << name << " " << c.name;
          EXPECT_LE(c.low, c.null) << name << " " << c.name;
          EXPECT_GE(c.high, c.null) << name << " " << c.name;
          EXPECT_GT(c.prior_std, 0.0) << name << " " << c.name;
          EXPECT_GT(c.step, 0.0) << name << " " << c.name;
          EXPECT_LT(c.step, c.prior_std) << name << " " << c.name;
        }
        for (const EffectForm::Probe& probe : form.probes) {
          for (const EffectForm::Values& point : probe.points) {
            ASSERT_EQ(point.size(), form.coordinates.size()) << name;
            for (std::size_t c = 0; c < point.size(); ++c) {
              EXPECT_GE(point[c], form.coordinates[c].low) << name;
              EXPECT_LE(point[c], form.coordinates[c].high) << name;
            }
            // A probe is valid in files.
            const EffectEntry e = form.entry(point);
            EXPECT_NO_THROW(effectEntry(e.name, e.numbers, e.words, e.lists)) << name;
          }
        }
      }
    }
  }
}

// Drawn entries are valid in files and are read back as they were written.
TEST(EffectCatalogue, drawnEntriesAreReadBack) {
  const TemporaryFolder folder;
  EffectKind::Random random(7);
  for (const int teeth : {2, 3, 4}) {
    for (const EffectKind& kind : effectCatalogue()) {
      for (int k = 0; k < DRAWS / 4; ++k) {
        MachineModel model = vibratingMill(teeth);
        const EffectEntry drawn = drawEffect(kind.name, model, random);
        EXPECT_NO_THROW(effectEntry(drawn.name, drawn.numbers, drawn.words, drawn.lists)) << kind.name;
        model.effects = {drawn};
        writeMachineModel(model, folder.file("drawn.yaml"));
        const MachineModel read = readMachineModel(folder.file("drawn.yaml"));
        ASSERT_EQ(read.effects.size(), 1u);
        expectSame(read.effects.front(), drawn, 1e-9);
      }
    }
  }
}

// Every drawn entry has coordinates inside the bounds of some form of the effect; coordinates and entry are
// inverse to each other.
TEST(EffectCatalogue, coordinatesAndEntriesAreInverse) {
  EffectKind::Random random(11);
  for (const int teeth : {2, 3, 4, 6}) {
    const MachineModel model = vibratingMill(teeth);
    for (const EffectKind& kind : effectCatalogue()) {
      const std::vector<EffectForm> forms = formsOf(kind, scopeOf(model));
      for (int k = 0; k < DRAWS; ++k) {
        const EffectEntry drawn = drawEffect(kind.name, model, random);
        bool possible = false;
        for (const EffectForm& form : forms) {
          if (form.entry(form.values(drawn)).words != drawn.words) continue;
          const EffectForm::Values values = form.values(drawn);
          bool inside = true;
          for (std::size_t c = 0; c < values.size(); ++c)
            inside = inside && values[c] >= form.coordinates[c].low && values[c] <= form.coordinates[c].high;
          const auto again = numbersOf(form.entry(values)), numbers = numbersOf(drawn);
          bool same = inside && again.size() == numbers.size();
          for (std::size_t n = 0; same && n < numbers.size(); ++n)
            same = std::abs(again[n].second - numbers[n].second) <
                   1e-8 * std::max(1.0, std::abs(numbers[n].second));
          if (!same) continue;  // another frequency, another axis
          possible = true;
          const EffectForm::Values back = form.values(form.entry(values));
          for (std::size_t c = 0; c < values.size(); ++c)
            EXPECT_NEAR(back[c], values[c], 1e-9 * std::max(1.0, std::abs(values[c]))) << form.title();
        }
        EXPECT_TRUE(possible) << kind.name << " with " << teeth << " teeth";
      }
    }
  }
}

// Closed forms of the coordinates.
TEST(EffectCoordinates, equalTheirClosedForms) {
  EffectForm vector({planar("size", "angle_deg", 10.0, 1e-3, 1.0)});
  EXPECT_NEAR(vector.entry({-3.0, -4.0}).numbers.at("size"), 5.0, 1e-12);
  EXPECT_NEAR(vector.entry({0.0, -4.0}).numbers.at("angle_deg"), 270.0, 1e-12);

  // At the middle only the level counts, whatever the exponent: (x / reference)^-exponent = exp(level).
  EffectForm power({powerLaw("exponent", "reference", 60.0, 1.0, 3000.0)});
  for (const double exponent : {0.1, 0.4}) {
    const EffectEntry e = power.entry({exponent, 0.05});
    EXPECT_NEAR(std::pow(60.0 / e.numbers.at("reference"), -e.numbers.at("exponent")), std::exp(0.05), 1e-12);
  }

  // Contrasts are orthonormal and independent of the mean.
  for (const int teeth : {2, 3, 5}) {
    const EffectForm list({contrasts("offset", teeth, {-10.0, 10.0, 1e-3, 1.0})});
    ASSERT_EQ(list.coordinates.size(), static_cast<std::size_t>(teeth - 1));
    for (std::size_t a = 0; a < list.coordinates.size(); ++a) {
      EffectForm::Values values(list.coordinates.size(), 0.0);
      values[a] = 2.0;
      double sum = 0.0, squares = 0.0;
      const EffectEntry e = list.entry(values);
      for (const double v : e.lists.at("offset")) {
        sum += v;
        squares += v * v;
      }
      EXPECT_NEAR(sum, 0.0, 1e-12);
      EXPECT_NEAR(squares, 4.0, 1e-12);
    }
    EffectEntry level;
    level.lists["offset"].assign(static_cast<std::size_t>(teeth), 3.0);
    for (const double v : list.values(level)) EXPECT_NEAR(v, 0.0, 1e-12);
  }

  const EffectForm pitch({pitches("pitch_deg", *vibratingMill(3).tool, {-30.0, 30.0, 1e-3, 5.0})});
  const std::vector<std::pair<std::string, double>> degrees = numbersOf(pitch.entry({4.0, -1.0}));
  ASSERT_EQ(degrees.size(), 3u);
  EXPECT_EQ(degrees[2].first, "pitch_deg[2]");
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(degrees[k].second, (std::array<double, 3>{{124.0, 119.0, 117.0}})[k], 1e-9);
}

TEST(EffectCatalogue, givesTheReasonWhyAnEffectIsNotTried) {
  MachineModel model = vibratingMill(1);
  model.tool_tip = {};
  EffectScope scope = scopeOf(model);
  scope.start_times = scope.cut_times = false;
  const auto lacking = [&](const char* name) { return missingNeed(*findEffect(name), scope); };
  EXPECT_EQ(lacking("tool_wear").value(), "cut_time_before_s is not stated");
  EXPECT_EQ(lacking("friction_warmup").value(), "start_time_s is not stated");
  EXPECT_EQ(lacking("process_damping").value(), "the model's tool is rigid");
  EXPECT_EQ(lacking("uneven_pitch").value(), "");  // one tooth
  EXPECT_FALSE(lacking("runout"));
  scope.cuts = false;
  EXPECT_EQ(lacking("tool_wear").value(), "");  // no reason for an effect that is not measured
}

TEST(EffectEntry, isChecked) {
  EXPECT_THROW(effectEntry("coolant", {}), Error);
  EXPECT_THROW(effectEntry("runout", {{"offset_um", 3.0}}), Error);
  EXPECT_THROW(effectEntry("runout", {{"offset_um", -3.0}, {"angle_deg", 0.0}}), Error);
  EXPECT_THROW(effectEntry("runout", {{"offset_um", 3.0}, {"angle_deg", 0.0}, {"exponent", 1.0}}), Error);
  EXPECT_THROW(effectEntry("gain_error", {{"gain", 1.0}}, {{"channel", "fq"}}), Error);
  EXPECT_THROW(effectEntry("mains_hum", {{"frequency_hz", 55.0}, {"amplitude_n", 1.0}, {"y_ratio", 1.0}}),
               Error);
  EXPECT_THROW(effectEntry("uneven_pitch", {}), Error);
  EXPECT_THROW(effectEntry("uneven_pitch", {}, {}, {{"pitch_deg", {-90.0, 450.0}}}), Error);
  EXPECT_THROW(drawEffect("coolant", vibratingMill(2), *std::make_unique<EffectKind::Random>(1)), Error);
}

// docs/effects.md is generated from the catalogue: rosrun smartmill_studies sim_effect_table docs/effects.md
TEST(EffectTable, equalsThatOfTheDocument) {
  std::ifstream file(SMARTMILL_DOCS_FOLDER "/effects.md");
  ASSERT_TRUE(file.good());
  std::ostringstream text;
  text << file.rdbuf();
  EXPECT_EQ(withEffectTable(text.str()), text.str());
  EXPECT_THROW(withEffectTable("no table"), Error);
}

}  // namespace
}  // namespace smartmill
