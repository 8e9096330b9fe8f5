#pragma once

#include <vector>

#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// Speed [rad/s] within a share of the stated one at which the lines of the tooth passing stand out most in
/// the forces.
double refinedSpeed(const TestData& test, int teeth, double share);

/// Gives every cut without spindle angle one: the speed from the lines of the tooth passing, the phase at
/// which the nominal forces fit best. The nominal model of an even tool does not know which tooth is which:
/// records are turned by whole teeth, air cuts by any angle, so that their lines of once a revolution agree.
/// @return a note a record
std::vector<std::string> estimatePhases(Dataset& data);

/// What of a record nobody has stated exactly, beside where it was: phase and speed, about its middle, where
/// they have least to do with each other, and when its cut begins.
struct Turn {
  double middle = 0.0;  ///< [rad] there
  double end = 0.0;     ///< [rad] that its end turns further (and its beginning less): the speed
  double entry = 0.0;   ///< [samples] that the force of the cut comes on earlier
};

/// One value of a Turn that is free in a record.
struct TurnFreedom {
  double Turn::*value;
  double prior_std;  ///< of an entry about 0; else of a step
  double step;       ///< of tangents
};

/// Phase and speed of a record without spindle angle; the entry of a cut that begins within its record, which
/// no stated time tells better than a part of a sample.
std::vector<TurnFreedom> turnFreedoms(const TestData& test);

/// Of a record against the same record as it was.
Turn turnBetween(const TestData& before, const TestData& now);
/// Phase at the first sample and speed of a test's record when it is turned.
double turnedPhase(double phase, const Turn& by);
double turnedSpeed(const TestData& test, double speed, const Turn& by);
/// Lays a record elsewhere.
void turnRecord(TestData& test, const Turn& by);

/// Turns the records without spindle angle, tooth and speed included, to where the lines of a model's forces
/// say, wherever the model then fits better: a model with effects knows which tooth is which, and lines of
/// once a revolution in air.
/// @param least [rad] smaller turns are left alone
/// @return the largest change of an angle [rad], 0 where every record has its angle
double turnPhases(Dataset& data, const MachineModel& model, double least = 0.0);

}  // namespace smartmill::discrepancy
