#include "smartmill_stability/coupling/spindle.h"

#include <cmath>
#include <utility>

#include <Eigen/LU>

#include "smartmill_core/error.h"
#include "smartmill_core/require.h"

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;

/// Free gauge between its end t, the second point p and the flange b.
struct GaugeReceptances {
  Receptance tt, tp, pp, tb, pb, bt, bp, bb;
};

GaugeReceptances receptancesOf(const Gauge& gauge, double f) {
  BeamSegment front = gauge.segments.front(), rest = front;
  front.length = gauge.second_point;
  rest.length -= gauge.second_point;
  std::vector<BeamSegment> behind = gauge.segments;
  behind.front() = rest;
  const EndReceptances a = beamReceptances(front, f), b = beamReceptances(behind, f);
  const Receptance k = (a.r22 + b.r11).inverse();
  return {a.r11 - a.r12 * k * a.r21, a.r12 * k * b.r11, a.r22 * k * b.r11, a.r12 * k * b.r12,
          a.r22 * k * b.r12,         b.r21 * k * a.r21, b.r21 * k * a.r22, b.r22 - b.r21 * k * b.r12};
}

/// X from the three FRFs between the end and the second point.
Receptance flangeCompliance(const GaugeReceptances& r, Complex direct, Complex cross, Complex second) {
  Eigen::Matrix3cd m;
  Eigen::Vector3cd right;
  const auto row = [&](int i, const Receptance& to, const Receptance& from, Complex rigid, Complex measured) {
    const Complex r0 = to(0, 0), r1 = to(0, 1), q0 = from(0, 0), q1 = from(1, 0);
    m.row(i) << r0 * q0, r0 * q1 + r1 * q0, r1 * q1;
    right[i] = rigid - measured;
  };
  row(0, r.tb, r.bt, r.tt(0, 0), direct);
  row(1, r.tb, r.bp, r.tp(0, 0), cross);
  row(2, r.pb, r.bp, r.pp(0, 0), second);
  const Eigen::Vector3cd x = m.partialPivLu().solve(right);
  Receptance compliance;
  compliance << x[0], x[1], x[1], x[2];
  return compliance;
}

void checkLines(const FrequencyResponse& frf, const FrequencyResponse& reference) {
  if (frf.unit != "m/N") throw Error("FRF of the gauge: unit " + frf.unit + ": expected m/N");
  if (frf.frequency != reference.frequency || frf.value.size() != frf.frequency.size())
    throw Error("FRFs of the gauge: expected the same lines in all");
}

}  // namespace

void Gauge::validate() const {
  if (segments.empty()) throw Error("gauge: expected at least one segment");
  for (const BeamSegment& segment : segments) segment.validate();
  require("second point of the gauge [m]", second_point, Range::open(0.0, segments.front().length));
}

SpindleReceptances spindleReceptances(const Gauge& gauge, const GaugeTaps& taps, double low, double high) {
  gauge.validate();
  checkLines(taps.direct, taps.direct);
  checkLines(taps.cross, taps.direct);
  if (taps.second) checkLines(*taps.second, taps.direct);
  SpindleReceptances spindle;
  for (std::size_t i = 0; i < taps.direct.size(); ++i) {
    const double f = taps.direct.frequency[i];
    if (f < low || f > high || f <= 0.0) continue;
    const GaugeReceptances r = receptancesOf(gauge, f);
    const Complex h = taps.direct.value[i], cross = taps.cross.value[i];
    spindle.frequency.push_back(f);
    if (taps.second) {
      const Receptance x = flangeCompliance(r, h, cross, taps.second->value[i]);
      spindle.value.emplace_back(x.inverse() - r.bb);
    } else {
      const Complex n = (cross - h) / gauge.second_point;
      Receptance end;
      end << h, n, n, n * n / h;
      spindle.value.emplace_back(r.bt * (r.tt - end).inverse() * r.tb - r.bb);
    }
  }
  if (spindle.frequency.empty()) throw Error("FRFs of the gauge: no line within the band");
  return spindle;
}

}  // namespace smartmill::stability
