// Work and precision of single collisions: how far restitution and spin are from those of a very small step.
#pragma once

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "bench/harness.h"
#include "core/simulation.h"

namespace platen::bench {

struct CollisionKind {
  std::string name;
  PairLaw law;
};

inline std::vector<CollisionKind> collision_kinds() {
  PairLaw smooth;
  smooth.k1 = smooth.k2 = 5e5, smooth.exponent = 1.5, smooth.restitution = 1.0;  // about 5e3 N/m at 0.1 mm
  PairLaw damped;
  damped.k1 = damped.k2 = 5e3, damped.restitution = 0.4, damped.friction = 0.5;
  PairLaw plastic;
  plastic.k1 = 5e3, plastic.k2 = 7.5e3, plastic.restitution = 0.9, plastic.friction = 0.3, plastic.rolling_friction = 0.001;
  PairLaw cohesive = plastic;
  cohesive.f0 = -0.005, cohesive.k_adh = 100.0;
  return {{"elastic, frictionless, exponent 3/2", smooth}, {"e = 0.4, friction", damped}, {"plastic, friction", plastic}, {"plastic, cohesive", cohesive}};
}

struct CollisionPoint {
  std::string kind;
  double share = 0.0;        // of dt_crit = 0.75 sqrt(m/k2)
  double restitution_error = 0.0, spin_error = 0.0;  // mean over the collisions; spin as R omega over the impact speed
  double seconds = 0.0;      // wall time of all collisions
};

namespace collision {

constexpr double R = 2.5e-3, density = 2000.0;
constexpr int count = 48;

// Restitution and R omega/v of sphere 0 in collision k.
inline std::array<double, 2> result(const PairLaw& law, int k, double dt) {
  const double v = 0.4 + 0.017 * k, t = 0.05 + 0.01 * k, gap = 1e-6 * (1.0 + 0.37 * k);
  SimulationSetup s;
  s.pair = law, s.gravity = 0.0;
  s.engine.instruction_set = available_instruction_sets().back();
  s.spheres = {{0, 1}, {R + gap, 0, 0, -R, 0, 0}, {-0.5 * v, t, 0, 0.5 * v, -t, 0}, {0, 0, 3.0 * k, 0, 0, 0}, {R, R}, {density, density}};
  Simulation sim(s);
  sim.set_time_step(dt);
  sim.advance(std::llround(2.5e-3 / dt));
  const ParticleFields p = sim.snapshot(false).particles;
  const double d[3] = {p.position[0] - p.position[3], p.position[1] - p.position[4], p.position[2] - p.position[5]};
  const double u[3] = {p.velocity[0] - p.velocity[3], p.velocity[1] - p.velocity[4], p.velocity[2] - p.velocity[5]};
  // Speed at infinity: after they part nothing changes it, so it does not matter when one looks.
  return {std::sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]) / v * (d[0] > 0.0 ? 1.0 : -1.0), R * p.angular_velocity[2] / v};
}

}  // namespace collision

inline std::vector<CollisionPoint> collision_points(const CollisionKind& kind, const std::vector<double>& shares, double finest) {
  const double m = 4.0 / 3.0 * 3.14159265358979323846 * std::pow(collision::R, 3) * collision::density;
  const double slope = kind.law.exponent == 1.0 ? kind.law.k2 : kind.law.exponent * kind.law.k2 * std::sqrt(1e-4);
  const double dt_crit = 0.75 * std::sqrt(m / slope);
  std::vector<std::array<double, 2>> exact;
  for (int k = 0; k < collision::count; ++k) exact.push_back(collision::result(kind.law, k, finest * dt_crit));
  std::vector<CollisionPoint> points;
  for (const double share : shares) {
    CollisionPoint p{kind.name, share, 0.0, 0.0, 0.0};
    p.seconds = seconds_of([&] {
      for (int k = 0; k < collision::count; ++k) {
        const auto r = collision::result(kind.law, k, share * dt_crit);
        p.restitution_error += std::fabs(r[0] - exact[static_cast<std::size_t>(k)][0]) / collision::count;
        p.spin_error += std::fabs(r[1] - exact[static_cast<std::size_t>(k)][1]) / collision::count;
      }
    });
    points.push_back(p);
  }
  return points;
}

// Slope of log(error) over log(share) up to 0.2 dt_crit, least squares; NaN where errors are at the level of rounding.
inline double slope_of(const std::vector<CollisionPoint>& points, double CollisionPoint::*error) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const CollisionPoint& p : points) {
    if (p.share > 0.2 || !(p.*error > 1e-12)) continue;
    const double a = std::log(p.share), b = std::log(p.*error);
    n += 1, x += a, y += b, xx += a * a, xy += a * b;
  }
  return n < 2 ? std::nan("") : (n * xy - x * y) / (n * xx - x * x);
}

}  // namespace platen::bench
