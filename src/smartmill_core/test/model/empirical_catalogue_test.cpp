// Empirical effects: their entries in files and their coordinates.

#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/mill.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill {
namespace {

const std::set<std::string> CHANNELS{"fx", "fy", "fz", "load_meter"};

// A form away from its null, as after a fit.
EffectEntry someEntry(const EffectForm& form) {
  EffectForm::Values values;
  for (const Coordinate& c : form.coordinates)
    values.push_back(std::min(c.null + 0.3 * std::min(c.prior_std, c.high - c.null), c.high));
  EffectEntry e = form.entry(values);
  if (e.name == "empirical:order") e.numbers["order"] = 1.5;
  return e;
}

TEST(EmpiricalCatalogue, noneIsPartOfTheCatalogue) {
  for (const EffectKind& kind : effectCatalogue()) EXPECT_FALSE(kind.empirical()) << kind.name;
  for (const EffectKind& kind : empiricalCatalogue()) {
    EXPECT_TRUE(kind.empirical());
    EXPECT_EQ(kind.name, "empirical:" + kind.form);
    EXPECT_EQ(findEffect(kind.name), &kind);
    EXPECT_EQ(findEmpirical(kind.form_stage, kind.form), &kind);
  }
  EXPECT_EQ(findEmpirical("channel", "chip_thickness"), nullptr);
}

TEST(EmpiricalCatalogue, entriesAreReadBackUnderOneName) {
  const TemporaryFolder folder;
  const std::string file = folder.file("model.yaml");
  const MachineModel nominal = mill(4, 30.0);
  for (const EffectKind& kind : empiricalCatalogue()) {
    for (const EffectForm& form : formsOf(kind, {nominal, CHANNELS})) {
      MachineModel model = nominal;
      model.effects = {someEntry(form)};
      for (const auto& [key, value] : numbersOf(model.effects.front()))
        model.effects.front().std_devs[key] = 0.25;
      writeMachineModel(model, file);
      const std::string text = readText(file);
      EXPECT_NE(text.find("- name: empirical\n  stage: " + kind.form_stage + "\n  form: " + kind.form),
                std::string::npos)
          << text;
      const MachineModel read = readMachineModel(file);
      ASSERT_EQ(read.effects.size(), 1u);
      const EffectEntry &a = model.effects.front(), &b = read.effects.front();
      EXPECT_EQ(a.name, b.name);
      EXPECT_EQ(a.words, b.words);
      EXPECT_EQ(a.std_devs, b.std_devs);
      const auto x = numbersOf(a), y = numbersOf(b);
      ASSERT_EQ(x.size(), y.size()) << kind.name;
      for (std::size_t k = 0; k < x.size(); ++k)
        EXPECT_NEAR(x[k].second, y[k].second, 1e-8 * std::abs(x[k].second));
      // The entry is read back into the coordinates of the fit.
      const EffectForm::Values values = form.values(b), again = form.values(form.entry(values));
      for (std::size_t k = 0; k < values.size(); ++k) EXPECT_NEAR(values[k], again[k], 1e-6) << form.title();
    }
  }
}

TEST(EmpiricalCatalogue, rejectsUnknownForms) {
  const TemporaryFolder folder;
  const std::string file = folder.file("model.yaml");
  const auto refuses = [&](const std::string& effect, const char* reason) {
    writeText(file, "format: smartmill-model/1\neffects: [" + effect + "]\n");
    try {
      readMachineModel(file);
      ADD_FAILURE() << effect;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find(reason), std::string::npos) << e.what();
    }
  };
  refuses("{name: empirical, stage: chip, form: magic}", "'magic'");
  refuses("{name: empirical, stage: chip, form: tone}", "'tone'");
  refuses("{name: 'empirical:tone', channel: fx, frequency_hz: 36, amplitude: 2}", "not an effect");
  refuses("{name: empirical, stage: channel, form: tone, channel: fx, while: always, amplitude: 2}",
          "frequency_hz");
}

// For any coordinates the force rises with the chip.
TEST(EmpiricalCatalogue, chipTimesFactorRises) {
  const MachineModel nominal = mill(4, 30.0);
  for (const EffectForm& form : formsOf(*findEffect("empirical:chip_thickness"), {nominal, CHANNELS})) {
    for (int corner = 0; corner < 1 << form.coordinates.size(); ++corner) {
      EffectForm::Values values;
      for (std::size_t k = 0; k < form.coordinates.size(); ++k)
        values.push_back(corner >> k & 1 ? form.coordinates[k].high : form.coordinates[k].low);
      const EffectEntry e = form.entry(values);
      const std::vector<double>&h = e.lists.at("h_um"), &factor = e.lists.at("factor");
      ASSERT_EQ(h.size(), factor.size());
      for (std::size_t k = 1; k < h.size(); ++k) EXPECT_GT(h[k] * factor[k], h[k - 1] * factor[k - 1]);
    }
  }
}

}  // namespace
}  // namespace smartmill
