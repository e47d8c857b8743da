// Closed forms and limits of single contacts over ranges of speed and size, rest, and the order of convergence, through
// class Simulation. The worked examples of tests/data are in test_library_reference.cpp, beds in
// test_verification_bed.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/simulation.h"
#include "tests/verification_table.h"

namespace platen {
namespace {

using verification::Figure;
using verification::heading;
using verification::text;

constexpr double density = 2000.0;
double mass_of(double R) { return 4.0 / 3.0 * std::numbers::pi * R * R * R * density; }

SimulationSetup nothing_around(const PairLaw& law) {
  SimulationSetup s;
  s.pair = law, s.gravity = 0.0;
  s.engine.instruction_set = available_instruction_sets().back();
  return s;
}

void add(SimulationSetup& s, const std::array<double, 3>& x, const std::array<double, 3>& v, double R) {
  s.spheres.id.push_back(static_cast<std::int64_t>(s.spheres.id.size()));
  s.spheres.position.insert(s.spheres.position.end(), x.begin(), x.end());
  s.spheres.velocity.insert(s.spheres.velocity.end(), v.begin(), v.end());
  s.spheres.spin.insert(s.spheres.spin.end(), {0.0, 0.0, 0.0});
  s.spheres.radius.push_back(R), s.spheres.density.push_back(density);
}

struct HeadOn {
  bool separated = false;
  double restitution = 0.0, delta_max = 0.0;
};

// Two equal spheres, just touching, at a relative speed v.
HeadOn head_on(const PairLaw& law, double R, double v, int steps_per_contact = 4000) {
  SimulationSetup setup = nothing_around(law);
  add(setup, {R, 0, 0}, {-0.5 * v, 0, 0}, R);
  add(setup, {-R, 0, 0}, {0.5 * v, 0, 0}, R);
  Simulation sim(setup);
  // Time scale of a power-law spring: overlap where the energy is used up, over the speed.
  const double m_eff = 0.5 * mass_of(R), n = law.exponent;
  const double deepest = std::pow(0.5 * (n + 1.0) * m_eff * v * v / law.k1, 1.0 / (n + 1.0));
  const double dt = 3.0 * deepest / v / steps_per_contact;
  sim.set_time_step(dt);
  HeadOn r;
  for (int k = 0; k < 40 * steps_per_contact; ++k) {
    sim.advance(1);
    const auto& s = sim.state();
    const std::vector<std::int32_t> places = s.places();
    const auto i = static_cast<std::size_t>(places[0]), j = static_cast<std::size_t>(places[1]);
    const double overlap = 2.0 * R - (s.x[i] - s.x[j]);
    r.delta_max = std::max(r.delta_max, overlap);
    if (overlap > 0.0) continue;
    r.separated = true;
    r.restitution = (s.vx[i] - s.vx[j]) / v;
    break;
  }
  return r;
}

TEST(Verification, RestitutionOverSpeedAndSize) {
  heading("Restitution of elastic pairs with dashpot, over speed and size");
  for (const double n : {1.0, 1.5, 2.0}) {
    Figure f(text("restitution, exponent %g", n), "");
    for (const double e : {0.05, 0.4, 0.9, 1.0})
      for (const double R : {1e-5, 2.5e-3, 0.1})
        for (const double v : {1e-3, 0.1, 3.0}) {
          PairLaw law;
          law.exponent = n, law.restitution = e;
          law.k1 = law.k2 = 2e7 * std::pow(R, 2.0 - n);  // the same overlap over R for all sizes
          f.check(text("e = %g", e) + text(", R = %g m", R) + text(", v = %g m/s", v), head_on(law, R, v).restitution, e, 0.003);
        }
  }
}

TEST(Verification, PlasticRestitution) {
  heading("Restitution of plastic and adhesive pairs without dashpot");
  const double R = 2.5e-3, m_eff = 0.5 * mass_of(R);
  PairLaw law;
  law.k1 = 5e3, law.restitution = 1.0;
  {
    Figure plastic("restitution sqrt(k1/k2)", ""), adhesive("restitution with k_adh", "");
    for (const double ratio : {1.0, 2.0, 5.0, 30.0, 100.0})
      for (const double v : {0.01, 0.3, 2.0}) {
        law.k2 = ratio * law.k1, law.k_adh = 0.0;
        const std::string at = text("k2/k1 = %g", ratio) + text(", v = %g m/s", v);
        plastic.check(at, head_on(law, R, v).restitution, std::sqrt(1.0 / ratio), 0.01 * std::sqrt(1.0 / ratio));
        law.k_adh = 0.02 * law.k1;
        const double e2 = 1.0 / ratio - law.k_adh * std::pow(law.k2 - law.k1, 2) / (law.k1 * law.k2 * (law.k2 + law.k_adh));
        const HeadOn r = head_on(law, R, v);
        if (e2 > 0.0)
          adhesive.check(at, r.restitution, std::sqrt(e2), 0.01 * std::sqrt(e2));
        else
          EXPECT_FALSE(r.separated) << at;
      }
  }
  // A constant pull: it sticks below a speed that is known.
  Figure deepest("largest overlap with f0", "m"), pulled("restitution with f0", "");
  law.k2 = 5.0 * law.k1, law.k_adh = 0.0, law.f0 = -0.4;
  const double sticking = 2.0 * 0.4 * std::sqrt(law.k2 * (law.k2 - law.k1) / (std::pow(law.k1, 3) * m_eff));
  EXPECT_FALSE(head_on(law, R, 0.95 * sticking, 16000).separated);
  for (const double v : {1.05 * sticking, 1.2 * sticking, 1.6 * sticking, 3.0 * sticking}) {
    const double d = (0.4 + std::sqrt(0.16 + m_eff * law.k1 * v * v)) / law.k1;
    const double e2 = (law.k1 * law.k1 / (2.0 * law.k2) * d * d - 0.4 * d) / (0.5 * law.k1 * d * d - 0.4 * d);
    const HeadOn r = head_on(law, R, v, 16000);
    const std::string at = text("v = %.3g m/s", v);
    deepest.check(at, r.delta_max, d, 0.001 * d);
    pulled.check(at, r.restitution, std::sqrt(e2), 0.01 * std::sqrt(e2));
  }
}

TEST(Verification, SlideToRoll) {
  heading("A sphere thrown along a plate: sliding to rolling");
  Figure time("time until it rolls", "s"), speed("speed when it rolls, over v0", ""), braking("deceleration while rolling / (5/7 mu_r g)", "");
  struct Row {
    double R, v0, mu, mu_r;
  };
  for (const Row& row : {Row{2.5e-3, 0.1, 0.3, 0.0}, Row{2.5e-3, 1.0, 0.3, 0.0}, Row{0.05, 1.0, 0.1, 0.0}, Row{2.5e-3, 0.3, 0.3, 0.01},
                         Row{2.5e-3, 0.3, 0.5, 0.1}}) {
    PairLaw law;
    law.k1 = law.k2 = 5e3;
    SimulationSetup setup = nothing_around(law);
    setup.gravity = 9.81;
    // The dashpot acts until the spring has reached its limit, one step at least: a blow of c_t v_0 dt that the closed
    // form does not know. With e = 0.9 it is small.
    setup.plate.friction = row.mu, setup.plate.rolling_friction = row.mu_r, setup.plate.restitution = 0.9;
    const double E = 1.0 / ((1.0 - 0.09) / 2.6e8 + (1.0 - 0.0625) / 2.5e10), m = mass_of(row.R);
    const double rest = std::pow(0.75 * m * 9.81 / (E * std::sqrt(row.R)), 2.0 / 3.0);
    add(setup, {0, 0, row.R - rest}, {row.v0, 0, 0}, row.R);
    Simulation sim(setup);
    const double t = row.v0 / (row.mu * 9.81 + 2.5 * (row.mu - row.mu_r) * 9.81), v = row.v0 - row.mu * 9.81 * t;
    // Stiff against its weight: the step comes from the contact at rest, 1/100 of its critical one.
    const double dt = 0.02 * std::sqrt(m / (2.0 * E * std::sqrt(row.R * rest)));
    sim.set_time_step(dt);
    sim.set_plane(plate_bottom, {});
    const std::string at = text("R = %g m", row.R) + text(", v0 = %g m/s", row.v0) + text(", mu = %g", row.mu) + text(", mu_r = %g", row.mu_r);
    const auto slip = [&](const ParticleFields& p) { return p.velocity[0] - (row.R - rest) * p.angular_velocity[1]; };
    ParticleFields p = sim.snapshot(false).particles;
    double v_before = row.v0, t_before = 0.0;
    const auto chunk = static_cast<std::int64_t>(std::max(1.0, t / dt / 2000.0));
    while (slip(p) > 0.002 * row.v0 && sim.time() < 2.0 * t) {
      v_before = slip(p), t_before = sim.time();
      sim.advance(chunk);
      p = sim.snapshot(false).particles;
    }
    // Where the slip goes through zero, from the last chunk.
    const double now = slip(p), end = t_before + (sim.time() - t_before) * std::min(1.0, v_before / (v_before - now));
    time.check(at, end, t, 0.01 * t);
    speed.check(at, p.velocity[0] / row.v0, v / row.v0, 0.005 * v / row.v0);
    if (row.mu_r == 0.0) continue;
    sim.advance(2000 * chunk);  // the elastic slip rings out
    const double v1 = sim.snapshot(false).particles.velocity[0], t1 = sim.time();
    sim.advance(2000 * chunk);
    const double v2 = sim.snapshot(false).particles.velocity[0];
    braking.check(at, (v1 - v2) / (sim.time() - t1) / (5.0 / 7.0 * row.mu_r * 9.81), 1.0, 0.01);
  }
}

TEST(Verification, StackComesToRest) {
  heading("A stack of six spheres, let go just touching");
  PairLaw law;
  law.k1 = law.k2 = 5e3, law.restitution = 0.3, law.friction = 0.5;
  SimulationSetup setup = nothing_around(law);
  setup.gravity = 9.81;
  setup.plate.restitution = 0.3;
  const double R = 2.5e-3, weight = mass_of(R) * 9.81;
  constexpr int count = 6;
  for (int k = 0; k < count; ++k) add(setup, {0, 0, (2 * k + 1) * R}, {0, 0, 0}, R);
  Simulation sim(setup);
  sim.set_time_step(4e-6);
  sim.set_plane(plate_bottom, {});
  sim.advance(150000);
  const Snapshot s = sim.snapshot();
  const Measures m = sim.measure();
  ASSERT_EQ(s.contacts.size(), static_cast<std::size_t>(count - 1));
  Figure pairs("overlap of a pair", "m"), plate("overlap with the plate", "m"), force("support force / weight", ""),
      kinetic("kinetic / potential energy", ""), sideways("largest speed sideways", "m/s");
  for (std::size_t k = 0; k + 1 < count; ++k) {
    const double d = static_cast<double>(count - 1 - k) * weight / law.k1;
    pairs.check(text("pair %.0f from below", static_cast<double>(k + 1)), s.contacts.overlap[k], d, 1e-6 * d);
  }
  const double E = 1.0 / ((1.0 - 0.09) / 2.6e8 + (1.0 - 0.0625) / 2.5e10);
  const double d = std::pow(0.75 * count * weight / (E * std::sqrt(R)), 2.0 / 3.0);
  plate.check("plate", s.plate_contacts.overlap[0], d, 1e-6 * d);
  force.check("0.6 s", m.support_force / m.weight, 1.0, 1e-6);
  kinetic.check_below("0.6 s", m.kinetic_energy / m.potential_energy, 1e-14);
  for (std::size_t k = 0; k < count; ++k) sideways.check_below("0.6 s", std::fabs(s.particles.velocity[3 * k]), 1e-15);
}

// A contact under a constant pull that hovers about zero overlap gets a kick of |f0| dt/m* at each touch: it must not
// gain energy beyond that of one kick.
TEST(Verification, CohesivePairDoesNotHeat) {
  heading("A pair held by f0 alone");
  const double R = 2.5e-3, m_eff = 0.5 * mass_of(R), dt = 1e-5;
  Figure hovering("largest kinetic energy / (f0^2/(2 k1) + that of one kick)", ""), resting("kinetic energy at the end / (f0^2/(2 k1))", ""),
      equilibrium("force at the end / f0", "");
  for (const double f0 : {-0.02, -0.4, -1.6})
    for (const double e : {0.1, 0.4, 0.9}) {
      PairLaw law;
      law.k1 = 5e3, law.k2 = 2.5e4, law.f0 = f0, law.restitution = e, law.friction = 0.5;
      SimulationSetup setup = nothing_around(law);
      add(setup, {R, 0, 0}, {-1e-6, 0, 0}, R);
      add(setup, {-R, 0, 0}, {1e-6, 0, 0}, R);
      Simulation sim(setup);
      sim.set_time_step(dt);
      const std::string at = text("f0 = %g N", f0) + text(", e = %g", e);
      // Released at zero overlap it swings through f0^2/(2 k1) of kinetic energy once and never again.
      const double scale = f0 * f0 / (2.0 * law.k1), kick = m_eff * std::pow(f0 * dt / m_eff, 2);
      double largest = 0.0;
      for (int k = 0; k < 2000; ++k) {
        sim.advance(1);
        largest = std::max(largest, sim.measure(false).kinetic_energy);
      }
      hovering.check_below(at, largest / (scale + kick), 1.05);
      sim.advance(100000);
      resting.check_below(at, sim.measure(false).kinetic_energy / scale, 1e-10);
      const Snapshot s = sim.snapshot();
      ASSERT_EQ(s.contacts.size(), 1u) << at;
      equilibrium.check_below(at, s.contacts.normal_force[0] / f0, 1e-4);
    }
}

// Undamped, k1 = k2, at the edge of touching: every swing goes through making and breaking.
TEST(Verification, UndampedChatterStaysBounded) {
  heading("An undamped pair held by f0 that touches and parts again in a periodic box");
  const double R = 2.5e-3, m_eff = 0.5 * mass_of(R), f0 = -0.4;
  Figure gain("energy above that at the start / (f0 v dt, per root of touches)", "");
  for (const double dt : {1e-5, 2.5e-6})
    for (const double v : {0.02, 0.2, 1.0}) {
      PairLaw law;
      law.k1 = law.k2 = 5e3, law.f0 = f0, law.restitution = 1.0;
      SimulationSetup setup = nothing_around(law);
      setup.periodic = true, setup.width = setup.depth = 12.0 * R;
      add(setup, {4.2 * R, 6.0 * R, 0}, {0.5 * v, 0, 0}, R);
      add(setup, {7.8 * R, 6.0 * R, 0}, {-0.5 * v, 0, 0}, R);
      Simulation sim(setup);
      sim.set_time_step(dt);
      const double start = 0.5 * m_eff * v * v;
      double most = 0.0;
      int touches = 0;
      bool before = false;
      for (int k = 0; k < 200000; ++k) {
        sim.advance(1);
        const bool touching = sim.measure(false).contacts > 0;
        if (before && !touching) {
          ++touches;
          most = std::max(most, sim.measure(false).kinetic_energy - start);
        }
        before = touching;
      }
      // Each touch is off by at most the pull times the way of one step, at random; speeds stay near that of the start.
      const double per_touch = std::fabs(f0) * (v + std::fabs(f0) * dt / m_eff) * dt;
      gain.check_below(text("dt = %g s", dt) + text(", v = %g m/s", v), most / (per_touch * std::sqrt(std::max(touches, 1))), 4.0);
    }
}

// Slope of the error over the step, from dt, dt/2, dt/4 against each other: log2 |y(dt) - y(dt/2)| / |y(dt/2) - y(dt/4)|.
template <class Run>
double order(const Run& run, double dt) {
  const double a = run(dt), b = run(0.5 * dt), c = run(0.25 * dt);
  return std::log2(std::fabs(a - b) / std::fabs(b - c));
}

TEST(Verification, OrderOfConvergence) {
  heading("Order of convergence in the time step");
  const double R = 2.5e-3;
  Figure smooth("order, smooth contact without dashpot (position after 20 ms)", ""), damped("order, smooth contact with dashpot", "");
  for (const double n : {1.0, 1.5, 2.0})
    for (const double e : {1.0, 0.5}) {
      PairLaw law;  // a pair that a constant pull keeps together; it swings and slides without slipping
      law.exponent = n, law.k1 = law.k2 = 5e3 * std::pow(1e-4, 1.0 - n), law.f0 = -0.5, law.restitution = e, law.friction = 1e6;
      const auto run = [&](double dt) {
        SimulationSetup setup = nothing_around(law);
        const double d = 0.8e-4;
        add(setup, {R - 0.5 * d, 0, 0}, {0.02, 0.03, 0.0}, R);
        add(setup, {-R + 0.5 * d, 0, 0}, {-0.02, -0.03, 0.0}, R);
        Simulation sim(setup);
        sim.set_time_step(dt);
        sim.advance(std::llround((e < 1.0 ? 2e-3 : 2e-2) / dt));
        EXPECT_EQ(sim.measure(false).contacts, 1);
        const auto x = sim.snapshot(false).particles.position;
        return std::hypot(x[0] - x[3], x[1] - x[4]);
      };
      const std::string at = text("exponent %g", n) + text(", e = %g", e);
      if (e == 1.0)
        smooth.check(at, order(run, 4e-6), 2.0, 0.15);
      else
        damped.check(at, order(run, 4e-6), 1.0, 0.15);
    }
}

// All branches, stick and slip, making and breaking: the error falls with dt at least as fast as its first power. One
// event can be lucky, so it is the mean error over many collisions that counts.
TEST(Verification, OrderOverEvents) {
  heading("Mean error of plastic, adhesive, sliding collisions over the step");
  PairLaw law;
  law.k1 = 5e3, law.k2 = 2.5e4, law.k_adh = 50.0, law.f0 = -0.002, law.restitution = 0.8, law.friction = 0.3, law.rolling_friction = 0.01;
  const double R = 2.5e-3, finest = 2.5e-8;
  const auto velocities = [&](int k, double dt) {
    const double v = 0.3 + 0.07 * k, t = 0.05 + 0.08 * k;
    SimulationSetup setup = nothing_around(law);
    add(setup, {R + 1e-6 * (1 + k), 0, 0}, {-0.5 * v, 0.5 * t, 0.1}, R);
    add(setup, {-R, 0, 0}, {0.5 * v, -0.5 * t, 0.0}, R);
    Simulation sim(setup);
    sim.set_time_step(dt);
    sim.advance(std::llround(2e-3 / dt));
    EXPECT_EQ(sim.measure(false).contacts, 0) << "collision " << k << " sticks";
    return sim.snapshot(false).particles.velocity;
  };
  constexpr int collisions = 8;
  std::vector<std::vector<double>> exact;
  for (int k = 0; k < collisions; ++k) exact.push_back(velocities(k, finest));
  std::vector<double> errors;
  Figure error("mean error of the velocities over the impact speed", "");
  for (const double dt : {8e-6, 4e-6, 2e-6, 1e-6}) {
    double sum = 0.0;
    for (int k = 0; k < collisions; ++k) {
      const auto v = velocities(k, dt);
      double largest = 0.0;
      for (std::size_t c = 0; c < v.size(); ++c) largest = std::max(largest, std::fabs(v[c] - exact[static_cast<std::size_t>(k)][c]));
      sum += largest / (0.3 + 0.07 * k) / collisions;
    }
    errors.push_back(sum);
    error.check_below(text("dt = %g s", dt), sum, 0.05 * dt / 8e-6);
  }
  Figure slope("order over dt = 8 to 1 us", "");
  slope.check("8 collisions", std::log2(errors.front() / errors.back()) / 3.0, 1.0, 0.3);
}

}  // namespace
}  // namespace platen
