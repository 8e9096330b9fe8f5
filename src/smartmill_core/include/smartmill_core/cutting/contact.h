#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "smartmill_core/cutting/chip_rule.h"
#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_core/math/sine_cosine.h"

// Where an edge is in contact, and with which of the earlier surfaces: the smallest of several ChipShapes
// over an interval of immersion angles, split where another shape becomes the smallest or the chip begins or
// ends.

namespace smartmill {

/// An interval of immersion angles, by middle and half width.
struct AngleInterval {
  double middle, half;  ///< [rad]
  SineCosine at;        ///< of the middle

  static AngleInterval between(double from, double to) {
    const double middle = 0.5 * (from + to);
    return {middle, 0.5 * (to - from), sineCosine(middle)};
  }
  double low() const { return middle - half; }
  double high() const { return middle + half; }
};

/// [m] Lower and upper bound of a shape over an interval.
struct ChipBounds {
  double low, high;
};
inline ChipBounds bounds(const ChipShape& shape, double bend, const AngleInterval& over) {
  const double value = shape.at(over.at.sine, over.at.cosine);
  const double reach =
      over.half * (std::abs(shape.slope(over.at.sine, over.at.cosine)) + 0.5 * bend * over.half);
  return {value - reach, value + reach};
}
inline ChipBounds bounds(const ChipShape& shape, const AngleInterval& over) {
  return bounds(shape, shape.bend(), over);
}

constexpr double WIDEST_CELL =
    0.2;  ///< [rad] of one cell; two-point Gauss has an error of 4e-7 of a smooth force

namespace contact_detail {

constexpr double STRAIGHT =
    0.015;  // [rad] half width so small that a difference of two chips has at most one zero

/// Zero of a shape whose end values `left` and `right` differ in sign.
inline double zeroOf(const ChipShape& shape, const AngleInterval& over, double left, double right) {
  double low = over.low(), high = over.high(), at = 0.0;
  const bool rises = right > left;
  at = low + (high - low) * left / (left - right);
  for (int i = 0; i < 8; ++i) {
    const SineCosine e = turned(over.at, at - over.middle);
    const double value = shape.at(e.sine, e.cosine), slope = shape.slope(e.sine, e.cosine);
    (rises == (value > 0.0) ? high : low) = at;
    double next = slope != 0.0 ? at - value / slope : low;
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const bool close = std::abs(next - at) < 1e-5;  // the next step converges quadratically
    at = next;
    if (close) break;
  }
  return at;
}

/// Whether the end values determine the sign in between, for a function with a bounded second derivative: it
/// deviates from its chord by at most bend half^2 / 2, and has one zero when the end values differ in sign.
inline bool chordDeterminesSign(double left, double right, double bend, double half) {
  const double most = 2.0 * bend * half * half;
  if (left * right < 0.0) return std::abs(left - right) >= most;
  return std::max(std::abs(left), std::abs(right)) >= most;
}

/// The segments of an interval in which one shape is positive.
template <class Visit>
void positive(const ChipShape& shape, const AngleInterval& over, Visit&& visit) {
  const double bend = shape.bend();
  const ChipBounds b = bounds(shape, bend, over);
  if (b.high <= 0.0) return;
  if (b.low > 0.0) {
    visit(shape, over);
    return;
  }
  const SineCosine l = turned(over.at, -over.half), r = turned(over.at, over.half);
  const double left = shape.at(l.sine, l.cosine), right = shape.at(r.sine, r.cosine);
  if (!chordDeterminesSign(left, right, bend, over.half) && over.half > STRAIGHT) {
    positive(shape, AngleInterval::between(over.low(), over.middle), visit);
    positive(shape, AngleInterval::between(over.middle, over.high()), visit);
  } else if (left * right < 0.0) {
    const double zero = zeroOf(shape, over, left, right);
    visit(shape,
          right > 0.0 ? AngleInterval::between(zero, over.high()) : AngleInterval::between(over.low(), zero));
  } else if (left + right > 0.0) {
    visit(shape, over);
  }
}

}  // namespace contact_detail

/// Calls visit(shape, interval) for each interval of a cell in which that shape is the smallest of all and
/// positive. Reorders the shapes. @param count >= 1 @param over no wider than WIDEST_CELL
template <class Visit>
void leastPositive(ChipShape* shapes, std::size_t count, const AngleInterval& over, Visit&& visit) {
  // First the smallest at the middle, then those that are smaller somewhere.
  const double s = over.at.sine, c = over.at.cosine;
  double least = shapes[0].at(s, c);
  for (std::size_t k = 1; k < count; ++k) {
    const double value = shapes[k].at(s, c);
    if (value >= least) continue;
    least = value;
    std::swap(shapes[0], shapes[k]);
  }
  std::size_t near = 1;
  for (std::size_t k = 1; k < count; ++k) {
    if (bounds(shapes[k] - shapes[0], over).low < 0.0) std::swap(shapes[near++], shapes[k]);
  }
  if (near == 1) {
    contact_detail::positive(shapes[0], over, visit);
    return;
  }
  if (bounds(shapes[0], over).high <= 0.0) return;
  // The smallest shape at the left end is replaced by the smallest at the right end.
  const SineCosine l = turned(over.at, -over.half), r = turned(over.at, over.half);
  std::size_t first = 0, last = 0;
  for (std::size_t k = 1; k < near; ++k) {
    if (shapes[k].at(l.sine, l.cosine) < shapes[first].at(l.sine, l.cosine)) first = k;
    if (shapes[k].at(r.sine, r.cosine) < shapes[last].at(r.sine, r.cosine)) last = k;
  }
  const ChipShape change = first == last ? shapes[1 - std::min<std::size_t>(first, 1)] - shapes[first]
                                         : shapes[last] - shapes[first];
  const double left = change.at(l.sine, l.cosine), right = change.at(r.sine, r.cosine);
  const bool sure = near == 2 && contact_detail::chordDeterminesSign(left, right, change.bend(), over.half);
  if (!sure && over.half > contact_detail::STRAIGHT) {
    leastPositive(shapes, near, AngleInterval::between(over.low(), over.middle), visit);
    leastPositive(shapes, near, AngleInterval::between(over.middle, over.high()), visit);
  } else if (first == last || right >= 0.0) {
    contact_detail::positive(shapes[first], over, visit);
  } else if (left <= 0.0) {
    contact_detail::positive(shapes[last], over, visit);
  } else {
    const double at = contact_detail::zeroOf(change, over, left, right);
    contact_detail::positive(shapes[first], AngleInterval::between(over.low(), at), visit);
    contact_detail::positive(shapes[last], AngleInterval::between(at, over.high()), visit);
  }
}

/// Calls cell(interval) for intervals no wider than WIDEST_CELL that cover the immersion angles from..to
/// [rad, 0..4 pi].
template <class Cell>
void forEachCell(double from, double to, Cell&& cell) {
  if (to - from <= WIDEST_CELL) {
    cell(AngleInterval::between(from, to));
    return;
  }
  const int cells = static_cast<int>(std::ceil((to - from) / WIDEST_CELL));
  const double width = (to - from) / cells;
  for (int n = 0; n < cells; ++n) cell(AngleInterval::between(from + n * width, from + (n + 1) * width));
}

/// leastPositive() over the immersion angles from..to.
template <class Visit>
void forEachContact(ChipShape* shapes, std::size_t count, double from, double to, Visit&& visit) {
  forEachCell(from, to, [&](const AngleInterval& cell) { leastPositive(shapes, count, cell, visit); });
}

/// Two-point Gauss: point(weight [rad], sine, cosine).
template <class Point>
void gauss(const AngleInterval& over, Point&& point) {
  const SineCosine aside = turned({0.0, 1.0}, over.half * 0.57735026918962576);
  const double s = over.at.sine * aside.cosine, c = over.at.cosine * aside.cosine;
  const double across = over.at.cosine * aside.sine, along = over.at.sine * aside.sine;
  point(over.half, s - across, c + along);
  point(over.half, s + across, c - along);
}

}  // namespace smartmill
