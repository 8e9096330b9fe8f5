#include "smartmill_loadmeter/motor/motor_chain.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "../session.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_loadmeter/identification/identification_pipeline.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;

TEST(StandardCuts, errorsAreNamed) {
  const TemporaryFolder folder;
  const auto standard = [&](const std::string& text) {
    return readStandardCuts(folder.write("s.csv", text));
  };
  const auto currents = [&](const std::string& text) {
    return readMachineCurrents(folder.write("c.csv", text));
  };
  EXPECT_THAT(errorOf([&] { standard("cut,force_x[kN]\na,1\n"); }),
              HasSubstr("s.csv: line 1: column 'force_x[kN]' is unknown"));
  EXPECT_THAT(errorOf([&] { standard("cut,force_x[N]\na,lots\n"); }),
              HasSubstr("s.csv: line 2: column force_x[N]: 'lots' is not a number"));
  EXPECT_THAT(errorOf([&] { standard("cut,force_x[N]\na,1\na,2\n"); }),
              HasSubstr("line 3: cut 'a' is repeated"));
  EXPECT_THAT(errorOf([&] { standard("cut,force_x[N]\n"); }), HasSubstr("no cut in the table"));
  EXPECT_THAT(errorOf([&] { currents("cut,current_x[A],air_x[A]\na,1,\n"); }),
              HasSubstr("line 2: air_x[A]: empty"));
  EXPECT_THAT(errorOf([&] { currents("cut,current_spindle[A],air_spindle[A]\na,1,1\n"); }),
              HasSubstr("spindle_speed[rpm]: expected > 0"));
  EXPECT_THAT(errorOf([&] { readStandardCuts("/nowhere.csv"); }), HasSubstr("/nowhere.csv: cannot be read"));
  EXPECT_THAT(errorOf([&] {
                calibrateMotors(standard("cut,force_x[N]\na,1\nb,2\n"),
                                currents("cut,current_x[A],air_x[A]\na,1,0\nb,2,0\nc,3,0\n"), 100.0);
              }),
              HasSubstr("expected an axis or the spindle with three"));
  // Forces without a rise of the current indicate other air cuts.
  const MotorCalibration c = calibrateMotors(
      standard("cut,force_x[N]\na,110\nb,201\nc,299\nd,401\n"),
      currents("cut,current_x[A],air_x[A]\na,1.0,1.0\nb,1.5,1.0\nc,2.0,1.0\nd,2.5,1.0\n"), 100.0);
  ASSERT_EQ(c.notes.size(), 1u);
  EXPECT_THAT(c.notes[0], HasSubstr("axis x: force 10"));
}

struct MotorSession {
  Session session{5, 2e-4};
  std::vector<MotorForce> forces;
  std::vector<IdentifyResult> results;
  IdentificationParameters parameters;
  MotorCalibration calibration;

  MotorSession() {
    session.cutting = {953e6, 420e6, 100e6, 17.3e3, 21e3, 1e3};
    parameters.motor.phase_per_metre = {Session::PHASE_PER_METRE, Session::PHASE_PER_METRE, 0.0};
    DriveCalibration drive;
    drive.newton_per_ampere = {Session::X_NEWTON_PER_AMPERE, 1.0};
    drive.scatter = 1.0;
    drive.cuts = 30;
    calibration.drive[0] = calibration.drive[1] = drive;
  }
  template <typename Identification>
  void feed(Identification& to, LoadMeterIdentification& from) {
    from.forces().setMotors(calibration);
    from.outputs().motor_force = [this](const MotorForce& f) { forces.push_back(f); };
    from.outputs().result = [this](const IdentifyResult& r) { results.push_back(r); };
    const auto put = [&to](const auto& input) {
      if constexpr (std::is_same_v<Identification, IdentificationPipeline>) {
        to.push(input);
      } else {
        to.handle(input);
      }
    };
    session.state = put;
    session.load = put;
    session.condition = put;
    session.currents = put;
    for (const double rpm : {2000.0, 6000.0, 12000.0}) session.air(rpm, 2.0);
    session.slot(6000.0, 6e-5, 4.0);  // before any air pass
    for (const double f : {3e-5, 6e-5, 1e-4}) session.airPass(6000.0, f, 4.0);
    for (const double f : {3e-5, 6e-5, 1e-4}) session.slot(6000.0, f, 4.0);
    put(IdentifyGoal{session.now(), "", "", false, 0});
  }
};

TEST(MotorChain, forceOfAMovingAxisIsObservableAndOfARestingOneIsNot) {
  MotorSession m;
  LoadMeterIdentification identification(model(), m.parameters);
  m.feed(identification, identification);
  ASSERT_EQ(m.forces.size(), 4u);
  EXPECT_FALSE(m.forces[0].force[0]);
  EXPECT_THAT(m.forces[0].text(), HasSubstr("Fx not observable: no air cut of this axis"));
  const double feeds[] = {3e-5, 6e-5, 1e-4};
  for (std::size_t i = 0; i < 3; ++i) {
    const MotorForce& f = m.forces[i + 1];
    const ToolGeometry tool{3, 0.012, units::radFromDeg(35.0), {}};
    const double truth =
        MechanisticForce(tool, m.session.cutting, {0.0, units::PI, 0.002, feeds[i]}).mean().fx;
    ASSERT_TRUE(f.force[0]);
    EXPECT_LT(f.force[0]->value, 0.0);  // it opposes the motion along +X
    EXPECT_NEAR(f.force[0]->value, truth, 4.0 * f.force[0]->std_dev);
    // Channel y has a constant current of 3 A, without information at rest.
    EXPECT_FALSE(f.force[1]);
    EXPECT_FALSE(f.force[2]);
    EXPECT_THAT(f.text(), HasSubstr("Fy not observable: the axis is at rest"));
  }
  ASSERT_EQ(m.results.size(), 1u);
  const CoefficientSet& k = m.results[0].coefficients;
  EXPECT_NEAR(k.value.ktc, 953e6, 0.01 * 953e6);
  EXPECT_NEAR(k.value.krc, 420e6, 0.1 * 420e6);  // required: 10 %
  EXPECT_NEAR(k.value.krc, 420e6, 4.0 * k.std_dev.krc);
  EXPECT_NEAR(k.value.kre, 21e3, 4.0 * k.std_dev.kre);
  EXPECT_TRUE(std::isnan(k.value.kac) && std::isnan(k.value.kae));
  EXPECT_EQ(k.source, "load_meter and motor_current");
  EXPECT_THAT(m.results[0].message, HasSubstr("not observable from the axes that moved: Kac, Kae"));
}

TEST(MotorChain, thePipelineAgreesWithDirectInput) {
  MotorSession direct, sorted;
  LoadMeterIdentification identification(model(), direct.parameters);
  direct.feed(identification, identification);
  IdentificationPipeline sorter(model(), sorted.parameters, 0.05);
  sorted.feed(sorter, sorter.identification());
  sorter.flush();
  ASSERT_EQ(direct.results.size(), 1u);
  ASSERT_EQ(sorted.results.size(), 1u);
  EXPECT_EQ(direct.results[0].message, sorted.results[0].message);
  EXPECT_NEAR(direct.results[0].coefficients.value.krc, sorted.results[0].coefficients.value.krc,
              1e-3 * 420e6);
  ASSERT_EQ(direct.forces.size(), sorted.forces.size());
}

TEST(MotorChain, wrongParametersAreNamed) {
  MotorParameters p;
  p.phase_per_metre[1] = -1.0;
  EXPECT_THAT(errorOf([&] { p.validate(); }), HasSubstr("motor_phase_per_metre: -1 is out of range"));
}

}  // namespace
}  // namespace smartmill::loadmeter
