#include "program/production_force.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;
using units::MM;
using units::PI;
using units::TWO_PI;
using units::UM;

constexpr double STEP = 1.0 / ProductionForce::RATE;
constexpr double AIR = 5.0 * MM;  // before and after a cut, at feed
constexpr double SLICE = 0.2;     // [rad] of helix lag
constexpr double MISSING = -1.0;  // [m] radius of a tooth that is broken off
constexpr int CONTACT_EVERY = 5;  // samples
// Mean times between events of cutting [s].
constexpr double OVERRIDES = 20.0, SPINDLE = 60.0, HOLDS = 120.0, CHATTER = 60.0, LOST = 120.0;

}  // namespace

ProductionMachine drawMachine(std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const auto between = [&](double low, double high) { return low + (high - low) * unit(random); };
  ProductionMachine m;
  m.tool.teeth = static_cast<int>(between(2.0, 7.0));
  m.tool.diameter = between(8.0, 20.0) * MM;
  m.tool.helix = units::radFromDeg(between(0.0, 45.0));
  CuttingCoefficients& k = m.sharp;
  k.ktc = between(600.0, 2500.0) * units::N_PER_MM2;
  k.krc = k.ktc * between(0.2, 0.5);
  k.kte = between(12.0, 35.0) * units::N_PER_MM;
  k.kre = k.kte * between(0.7, 1.3);
  m.runout = between(0.0, 10.0) * UM;
  m.runout_angle = between(0.0, TWO_PI);
  m.speed = units::radPerSecFromRpm(between(2000.0, 9000.0));
  m.acceleration = between(1.0, 5.0);
  m.spindle_acceleration = between(50.0, 500.0);
  m.ripple = between(0.0, 5e-3);
  m.ripple_frequency = between(0.5, 30.0);
  m.noise = between(0.5, 4.0);
  m.angle_noise = between(0.0, 3e-3);
  m.edge_growth = between(0.2, 1.0) / 3600.0;
  return m;
}

ProductionForce::ProductionForce(const ProductionMachine& machine, std::uint64_t seed)
    : machine_(machine), random_(seed), speed_(machine.speed), speed_target_(machine.speed) {
  for (int j = 0; j < machine.tool.teeth; ++j)
    radius_.push_back(machine.runout * std::cos(machine.runout_angle - machine.tool.toothAngle(j)));
  drawCut();
}

void ProductionForce::breakTooth(int tooth) {
  broken_ = tooth;
  broken_from_ = turned_;
}

double ProductionForce::logUniform(double low, double high) {
  return low * std::pow(high / low, unit_(random_));
}

double ProductionForce::feedPerTooth() const {
  return feed_ / speed_ * TWO_PI / machine_.tool.teeth;
}

bool ProductionForce::chance(double mean_time) {
  return unit_(random_) * mean_time < STEP;
}

void ProductionForce::drawCut() {
  const double immersion = unit_(random_) < 0.25 ? 1.0 : logUniform(0.05, 1.0);  // of the diameter
  const double angle = std::acos(1.0 - 2.0 * immersion);
  if (unit_(random_) < 0.5) {
    entry_ = 0.0;  // up
    exit_ = angle;
  } else {
    entry_ = PI - angle;  // down
    exit_ = PI;
  }
  depth_ = logUniform(0.1, 1.0) * 0.5 * machine_.tool.diameter;
  chip_feed_ = logUniform(0.03, 0.2) * MM;
  const double feed = chip_feed_ * machine_.tool.teeth * machine_.speed / TWO_PI;
  length_ = std::clamp(uniform(1.0, 8.0) * feed, 20.0 * MM, 300.0 * MM);
  place_ = -0.5 * machine_.tool.diameter - AIR;
  direction_ = std::floor(uniform(0.0, 8.0)) * PI / 4.0;
  slices_ = std::clamp(static_cast<int>(std::ceil(machine_.tool.lag() * depth_ / SLICE)), 1, 8);
  override_ = 1.0;
  drawFeature();
  contact();
}

void ProductionForce::drawFeature() {
  feature_ = static_cast<Feature>(static_cast<int>(uniform(0.0, 6.0)));
  feature_at_ = uniform(0.3, 0.7) * length_;
  feature_length_ = uniform(2.0, 15.0) * MM;
  feature_size_ = unit_(random_);
}

void ProductionForce::addArc(double entry, double exit) {
  if (exit > entry + 1e-6) arcs_.push_back({entry, exit});
}

/// Faces are across the feed: at a distance s behind a face, the part |phi - 90 deg| < acos(1 - s / R) of the
/// front half of the tool has passed it.
void ProductionForce::contact() {
  until_contact_ = CONTACT_EVERY;
  arcs_.clear();
  const double radius = 0.5 * machine_.tool.diameter;
  const auto passed = [&](double s) { return std::acos(std::clamp(1.0 - s / radius, 0.0, 1.0)); };
  const double front = place_ + radius;  // of the tool
  double entry = entry_, exit = exit_;
  hardness_ = 1.0;
  stage_ = "steady";
  const double in_feature = front - feature_at_;
  if (feature_ == Feature::wider || feature_ == Feature::narrower || feature_ == Feature::corner) {
    // A corner opens the arc within the way of the tool and closes it again.
    const double way = std::clamp(in_feature / radius, 0.0, 1.0) -
                       (feature_ == Feature::corner ? std::clamp(in_feature / radius - 1.5, 0.0, 1.0) : 0.0);
    const double width = exit - entry;
    const double target = feature_ == Feature::narrower ? width * (0.2 + 0.6 * feature_size_)
                                                        : width + (PI - width) * feature_size_;
    const double now = width + way * (target - width);
    if (entry_ > 0.0) {
      entry = PI - now;
    } else {
      exit = now;
    }
    if (way > 0.0 && way < 1.0) stage_ = "change";
  } else if (feature_ == Feature::hard_spot && in_feature > 0.0 && in_feature < feature_length_) {
    hardness_ += 0.5 * feature_size_ * std::sin(PI * in_feature / feature_length_);
    stage_ = "hard spot";
  }
  // Parts of the front half circle that are in material: behind the first face, before the last; not in a
  // gap.
  const double begun = passed(front), ended = passed(front - length_);
  const double gap_begun = feature_ == Feature::gap ? passed(in_feature) : 0.0;
  const double gap_ended = feature_ == Feature::gap ? passed(in_feature - feature_length_) : 0.0;
  if ((begun > 0.0 && begun < 0.5 * PI)) stage_ = "entry";
  if (ended > 0.0 || gap_begun > gap_ended) stage_ = ended > 0.0 ? "exit" : "gap";
  const double middle = 0.5 * PI;
  const auto half = [&](double inner, double outer) {
    if (outer <= inner) return;
    addArc(std::max(entry, middle - outer), std::min(exit, middle - inner));
    addArc(std::max(entry, middle + inner), std::min(exit, middle + outer));
  };
  half(std::max(ended, gap_begun), begun);
  half(ended, std::min(begun, gap_ended));
  if (arcs_.empty()) stage_ = "air";
}

void ProductionForce::drawEvents() {
  if (chance(OVERRIDES)) override_ = std::floor(uniform(1.0, 13.0)) / 10.0;
  if (chance(SPINDLE)) speed_target_ = machine_.speed * std::floor(uniform(8.0, 13.0)) / 10.0;
  if (chance(HOLDS)) hold_until_ = time_ + uniform(0.2, 2.0);
  if (chance(LOST)) lost_until_ = time_ + logUniform(1e-3, 0.1);
  if (chatter_until_ + 1.0 <= time_ && chance(CHATTER)) {
    chatter_until_ = time_ + uniform(0.3, 2.0);
    chatter_size_ = uniform(0.2, 2.0) * mean_force_;
    chatter_ = 0.01 * mean_force_;
    chatter_growth_ = std::log(uniform(1.05, 1.5)) / TWO_PI;  // [1/rad]
    // One in four period doubling, else any ratio to the spindle.
    const double passing = machine_.tool.teeth;
    chatter_order_ =
        unit_(random_) < 0.25 ? passing * (std::floor(uniform(0.0, 3.0)) + 0.5) : uniform(0.3, 5.0) * passing;
    chatter_direction_ = uniform(0.0, PI);
  }
}

void ProductionForce::move() {
  const double ripple = machine_.ripple * std::sin(TWO_PI * machine_.ripple_frequency * time_);
  speed_ += std::clamp(speed_target_ - speed_, -machine_.spindle_acceleration * STEP,
                       machine_.spindle_acceleration * STEP);
  time_ += STEP;
  turned_ += speed_ * (1.0 + ripple) * STEP;
  const double programmed = chip_feed_ * machine_.tool.teeth * machine_.speed / TWO_PI;
  const double target = time_ < hold_until_ ? 0.0 : override_ * programmed;
  feed_ += std::clamp(target - feed_, -machine_.acceleration * STEP, machine_.acceleration * STEP);
  place_ += feed_ * STEP;
  if (--until_contact_ <= 0) contact();
  if (place_ > length_ + 0.5 * machine_.tool.diameter + AIR) drawCut();
}

double ProductionForce::radiusOf(int tooth, double turned) const {
  return tooth == broken_ && turned >= broken_from_ ? MISSING : radius_[static_cast<std::size_t>(tooth)];
}

/// In the frame of the feed, x + i y. Immersion angles are clockwise, so that a feed turned counterclockwise
/// by d has phi = angle of the machine + d.
Complex ProductionForce::cuttingForce(double turned) {
  const int teeth = machine_.tool.teeth;
  const double pitch = TWO_PI / teeth, height = depth_ / slices_;
  const double lag = machine_.tool.lag() * height;
  const double feed = feedPerTooth();
  const CuttingCoefficients& k = machine_.sharp;
  const double edge = 1.0 + worn_;
  Complex force = 0.0;
  for (int j = 0; j < teeth; ++j) {
    for (int z = 0; z < slices_; ++z) {
      const double phi = wrapped(turned + direction_ + j * pitch - (z + 0.5) * lag);
      if (phi >= PI) continue;
      bool in = false;
      for (const Arc& arc : arcs_) in = in || (phi >= arc.entry && phi < arc.exit);
      if (!in) continue;
      const double sine = std::sin(phi), cosine = std::cos(phi);
      const double own = radiusOf(j, turned);
      double chip = 1.0;
      for (int n = 1; n <= teeth; ++n)
        chip = std::min(chip, n * feed * sine + own - radiusOf((j + n) % teeth, turned - n * pitch));
      if (chip <= 0.0) continue;
      const double ft = height * (hardness_ * k.ktc * chip + edge * k.kte);
      const double fr = height * (hardness_ * k.krc * chip + edge * k.kre);
      force += Complex(-ft * cosine - fr * sine, ft * sine - fr * cosine);
    }
  }
  return force;
}

const ProductionForce::Sample& ProductionForce::next() {
  move();
  sample_.time = time_;
  sample_.revolutions = turned_ / TWO_PI;
  sample_.cutting = !arcs_.empty() && feed_ > 0.0;
  Complex force = 0.0;
  if (sample_.cutting) {
    // The converter averages over its interval.
    const double half = 0.25 * speed_ * STEP;
    force = 0.5 * (cuttingForce(turned_ - half) + cuttingForce(turned_ + half));
    drawEvents();
    cutting_time_ += STEP;
    worn_ += machine_.edge_growth * STEP;
  } else if (unit_(random_) < STEP / LOST) {
    lost_until_ = time_ + logUniform(1e-3, 0.1);
  }
  mean_force_ += (std::abs(force) - mean_force_) * STEP / 0.1;
  sample_.cut_force = force;
  if (chatter_ > 0.0 && sample_.cutting) {
    const double growth = time_ < chatter_until_ ? chatter_growth_ : -chatter_growth_;
    chatter_ = std::min(chatter_ * std::exp(growth * speed_ * STEP), chatter_size_);
    chatter_phase_ += chatter_order_ * speed_ * STEP;
    force += std::polar(chatter_ * std::cos(chatter_phase_), chatter_direction_);
  }
  force = force * std::polar(1.0, direction_) + machine_.noise * Complex(normal_(random_), normal_(random_));
  sample_.fx = force.real();
  sample_.fy = force.imag();
  sample_.turned = turned_ + machine_.angle_noise * normal_(random_);
  sample_.lost = time_ < lost_until_;
  return sample_;
}

}  // namespace smartmill
