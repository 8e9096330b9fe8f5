#pragma once

#include <vector>

#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// Speed [rad/s] within a share of the stated one that maximises the tooth passing lines of the forces.
double refinedSpeed(const TestData& test, int teeth, double share);

/// Estimates the spindle angle of every record that has none: speed from the tooth passing lines, phase from
/// the best fit of the nominal forces. Teeth of an even tool are indistinguishable in the nominal model: cuts
/// are rotated by whole teeth and air cuts by any angle until their first-order lines agree.
/// @return one note per record
std::vector<std::string> estimatePhases(Dataset& data);

/// [rad] Rotation over the samples of a spindle angle, which may omit whole revolutions.
double rotationOf(const std::vector<double>& angle);

/// Alignment of a record relative to its state when loaded: phase and speed about the record's middle, where
/// they are least correlated, and the start of the cut.
struct RecordAlignment {
  double phase = 0.0;  ///< [rad] at the middle of the record
  double drift = 0.0;  ///< [rad] additional phase at the end of the record (and minus it at the beginning):
                       ///< the speed error
  double entry = 0.0;  ///< [samples] by which the cutting force starts earlier
};

/// One free value of a RecordAlignment.
struct AlignmentFreedom {
  double RecordAlignment::*value;
  double prior_std;  ///< entry: about 0; phase, drift: of a step
  double step;       ///< of the numerical derivative
};

/// Phase and speed of a record without spindle angle; entry of a cut that starts within its record, whose
/// stated time is accurate to a fraction of a sample only.
std::vector<AlignmentFreedom> alignmentFreedoms(const TestData& test);

/// Alignment that moves `before` to `now`, two versions of one record.
RecordAlignment alignmentBetween(const TestData& before, const TestData& now);
/// Phase at the first sample and speed of a record after an alignment.
double alignedPhase(double phase, const RecordAlignment& by);
double alignedSpeed(const TestData& test, double speed, const RecordAlignment& by);
/// Applies an alignment to a record.
void alignRecord(TestData& test, const RecordAlignment& by);

/// Aligns the records without spindle angle, tooth and speed included, with the lines of a model's forces,
/// where this reduces the residual. A model with effects distinguishes the teeth and has first-order lines in
/// air cuts.
/// @param least [rad] smaller rotations are not applied
/// @return largest change of an angle [rad]; 0 if every record has its angle
double alignPhases(Dataset& data, const MachineModel& model, double least = 0.0);

}  // namespace smartmill::discrepancy
