// Beds through class Simulation: plate and wall forces against the stress from contacts, momentum, the limit of the
// time step, rest of a cohesive bed.
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/simulation.h"
#include "core/stress_tensor.h"
#include "tests/scenes.h"
#include "tests/verification_table.h"

namespace platen {
namespace {

using verification::Figure;
using verification::heading;
using verification::text;

// 216 spheres; elastic ones start jammed, without friction too (solid fraction 0.67), plastic ones loose, to be pressed.
scenes::BedOptions packed(bool plastic) {
  scenes::BedOptions o;
  o.nx = o.ny = o.nz = 6;
  o.spacing = plastic ? 2.0 : 1.84, o.speed = 0.0;
  return o;
}

EngineOptions best() {
  EngineOptions engine;
  engine.instruction_set = available_instruction_sets().back();
  return engine;
}

double kinetic(Simulation& sim) { return sim.measure(false).kinetic_energy; }

// Advances until the kinetic energy is below `most` [J].
void come_to_rest(Simulation& sim, double most) {
  for (int k = 0; k < 100 && (k == 0 || kinetic(sim) > most); ++k) sim.advance(2000);
  ASSERT_LE(kinetic(sim), most);
}

// Drives the top plate down until it carries `stress` and stops there, again and again until the bed holds half of it.
void press(Simulation& sim, double stress) {
  for (int round = 0; round == 0 || (round < 40 && sim.stress(plate_top) < 0.5 * stress); ++round) {
    sim.advance(20);
    sim.set_plane_velocity(plate_top, -0.3);
    for (int k = 0; k < 2000 && sim.stress(plate_top) < stress; ++k) sim.advance(20);
    sim.set_plane_velocity(plate_top, 0.0);
    come_to_rest(sim, 1e-15);
  }
  ASSERT_GE(sim.stress(plate_top), 0.5 * stress);
}

TEST(VerificationBed, StressFromContactsAtRest) {
  heading("Plate and wall forces against the Love-Weber stress of 216 spheres at rest");
  Figure vertical("stress_zz from contacts / from the plates and the weight", ""), across("stress_xx, stress_yy from contacts / from the walls", ""),
      shear("asymmetry of the tensor / pressure", ""), trace("trace of the fabric tensor", ""),
      balance("(bottom - top plate + walls) / weight", "");
  struct Row {
    const char* name;
    double k2, gravity, mu, f0;
    bool walls;
  };
  for (const Row& row : {Row{"periodic, elastic, frictionless, no gravity", 5e3, 0.0, 0.0, 0.0, false},
                         Row{"periodic, plastic, friction, 10 g", 2.5e4, 98.1, 0.5, 0.0, false},
                         Row{"walls, plastic, friction, 10 g", 2.5e4, 98.1, 0.5, 0.0, true},
                         Row{"walls, plastic, friction, cohesive", 2.5e4, 9.81, 0.5, -0.2, true}}) {
    const scenes::BedOptions o = packed(row.k2 > 5e3);
    PairLaw law;
    law.k1 = 5e3, law.k2 = row.k2, law.f0 = row.f0, law.restitution = 0.1, law.friction = row.mu, law.rolling_friction = 0.001;
    SimulationSetup setup = scenes::bed(o, law, best());
    setup.periodic = !row.walls, setup.gravity = row.gravity;
    setup.plate.restitution = 0.1;
    if (row.walls) setup.plate.friction = 0.0;  // else walls carry a part of the vertical force, and plates of the others
    Simulation sim(setup);
    sim.set_time_step(5e-6);
    scenes::add_plates(sim, scenes::height_of(o), 0.0);
    PlaneMotion far;
    if (row.walls) {
      for (const int wall : {wall_x_low, wall_y_low}) sim.set_plane(wall, {});
      far.origin = setup.width, sim.set_plane(wall_x_high, far);
      far.origin = setup.depth, sim.set_plane(wall_y_high, far);
    }
    if (row.gravity > 0.0) press(sim, 30e3);
    else come_to_rest(sim, 1e-15);
    const Snapshot s = sim.snapshot();
    const BedStress b = bed_stress(s, setup.width, setup.depth);
    const Measures m = sim.measure();
    ASSERT_GT(b.pairs, 300) << row.name;
    ASSERT_TRUE(m.top_touches) << row.name;
    const double height = s.z_top - s.z_bottom, from_plates = m.stress_top + m.potential_energy / b.volume;
    vertical.check(row.name, b.stress[2][2] / from_plates, 1.0, 0.01);
    if (row.walls) {
      double force[2] = {0, 0};
      for (std::size_t k = 0; k < s.plate_contacts.size(); ++k) {
        if (s.plate_contacts.plate[k] == wall_x_high) force[0] -= s.plate_contacts.force[3 * k];
        if (s.plate_contacts.plate[k] == wall_y_high) force[1] -= s.plate_contacts.force[3 * k + 1];
      }
      across.check(std::string(row.name) + ", x", b.stress[0][0] / (force[0] / (setup.depth * height)), 1.0, 0.01);
      across.check(std::string(row.name) + ", y", b.stress[1][1] / (force[1] / (setup.width * height)), 1.0, 0.01);
    }
    double largest = 0.0;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < i; ++j) largest = std::max(largest, std::fabs(b.stress[i][j] - b.stress[j][i]));
    shear.check_below(row.name, largest / b.pressure, 0.01);
    trace.check(row.name, b.fabric[0][0] + b.fabric[1][1] + b.fabric[2][2], 1.0, 1e-12);
    EXPECT_NEAR(b.principal[0] + b.principal[1] + b.principal[2], 3.0 * b.pressure, 1e-9 * b.pressure);
    EXPECT_GE(b.principal[0], b.principal[2]);
    if (row.gravity > 0.0) balance.check(row.name, m.support_force / m.weight, 1.0, 0.01);
  }
}

// Turned at the start and turned back at the end: the same, whatever the law. 27 spheres that collide and stick, in open space.
TEST(VerificationBed, RotatedFrame) {
  heading("A turned frame: 27 spheres that collide in open space, 600 steps");
  Figure position("difference of positions / R", ""), velocity("difference of velocities / largest speed", ""), spin("difference of spins / largest spin", "");
  using Vector = Eigen::Vector3d;
  for (const scenes::LawCase& law : scenes::laws_of_scenes())
    for (const auto& [axis, angle] : {std::pair(Vector(1, 2, 3), 0.7), std::pair(Vector(-2, 1, 0.3), 2.9), std::pair(Vector(0.1, -1, 5), 4.4)}) {
      scenes::BedOptions o;
      o.nx = o.ny = o.nz = 3, o.spacing = law.spread > 0.0 ? 1.6 : 1.99, o.spread = law.spread, o.speed = 0.3, o.periodic = false;
      SimulationSetup setup = scenes::bed(o, law.law, best());
      setup.gravity = 0.0;
      SimulationSetup turned = setup;
      const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
      for (std::vector<double>* rows : {&turned.spheres.position, &turned.spheres.velocity, &turned.spheres.spin})
        for (std::size_t k = 0; k < rows->size(); k += 3) Eigen::Map<Vector>(rows->data() + k) = turn * Eigen::Map<Vector>(rows->data() + k).eval();
      std::size_t contacts = 0;
      const auto end_of = [&](SimulationSetup start) {
        Simulation sim(std::move(start));
        sim.set_time_step(2e-6);
        sim.advance(100);
        contacts = sim.snapshot().contacts.size();
        sim.advance(500);
        return sim.snapshot();
      };
      const Snapshot a = end_of(std::move(setup)), b = end_of(std::move(turned));
      ASSERT_GT(contacts, 10u) << law.name;
      const auto largest = [](const std::vector<double>& rows) {
        double most = 0.0;
        for (std::size_t k = 0; k < rows.size(); k += 3) most = std::max(most, Eigen::Map<const Vector>(rows.data() + k).norm());
        return most;
      };
      const auto apart = [&](const std::vector<double>& straight, const std::vector<double>& other) {
        double most = 0.0;
        for (std::size_t k = 0; k < straight.size(); k += 3)
          most = std::max(most, (turn * Eigen::Map<const Vector>(straight.data() + k) - Eigen::Map<const Vector>(other.data() + k)).norm());
        return most;
      };
      position.check_below(law.name, apart(a.particles.position, b.particles.position) / o.R, 1e-11);
      velocity.check_below(law.name, apart(a.particles.velocity, b.particles.velocity) / largest(a.particles.velocity), 1e-9);
      spin.check_below(law.name, apart(a.particles.angular_velocity, b.particles.angular_velocity) / largest(a.particles.angular_velocity), 1e-9);
    }
}

// A tensor that is known: two spheres in line along (1, 2, 2)/3, and a sphere pressed on a plate.
TEST(VerificationBed, StressOfKnownContacts) {
  Snapshot s;
  s.z_top = 0.1;
  s.particles.id = {3, 8};
  s.particles.radius = {0.01, 0.01};
  s.particles.mass = {1, 1};
  const double l = 0.019, n[3] = {1.0 / 3, 2.0 / 3, 2.0 / 3};
  s.particles.position = {0.05 + l * n[0], 0.05 + l * n[1] - 0.2, 0.05 + l * n[2], 0.05, 0.05, 0.05};  // the first beyond the face
  ContactFields& c = s.contacts;
  c.pair = {3, 8}, c.image = {0, -1}, c.overlap = {0.001}, c.plastic_overlap = {0}, c.normal_force = {9.0}, c.damping_force = {1.0};
  c.tangential_force = {2.0, -1.0, 0.0}, c.branch = {1};
  s.plate_contacts.id = {8}, s.plate_contacts.plate = {plate_bottom}, s.plate_contacts.overlap = {0.002}, s.plate_contacts.force = {0.5, 0, 3.0};
  const BedStress b = bed_stress(s, 0.1, 0.2);
  const double V = 0.1 * 0.2 * 0.1, F[3] = {10 * n[0] + 2, 10 * n[1] - 1, 10 * n[2]};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      double expected = F[i] * l * n[j];
      if (j == 2) expected += 0.008 * (i == 0 ? 0.5 : i == 2 ? 3.0 : 0.0);
      EXPECT_NEAR(b.stress[i][j], expected / V, 1e-9);
      EXPECT_NEAR(b.fabric[i][j], n[i] * n[j], 1e-12);
    }
  EXPECT_NEAR(b.fabric_deviator, 1.0, 1e-12);  // all contacts in one direction
  EXPECT_THROW(bed_stress(s, 0.0, 0.2), std::invalid_argument);
  EXPECT_DOUBLE_EQ(b.mean_overlap, 0.05);
  c.pair.insert(c.pair.end(), {3, 8}), c.image.insert(c.image.end(), {0, -1}), c.overlap.push_back(0.003), c.plastic_overlap.push_back(0.0);
  c.normal_force.push_back(0.0), c.damping_force.push_back(0.0), c.tangential_force.insert(c.tangential_force.end(), {0.0, 0.0, 0.0}), c.branch.push_back(1);
  EXPECT_DOUBLE_EQ(bed_stress(s, 0.1, 0.2).mean_overlap, 0.1);
  EXPECT_DOUBLE_EQ(bed_stress(s, 0.1, 0.2).largest_overlap, 0.15);
}

TEST(VerificationBed, Momentum) {
  heading("Momentum of 125 spheres that collide, without plates and gravity, after 2000 steps");
  Figure linear("largest component of the change of momentum / sum of all sizes", ""), angular("change of angular momentum / sum of all sizes", "");
  for (const scenes::LawCase& row : scenes::laws_of_scenes()) {
    PairLaw law = row.law;
    law.rolling_friction = 0.0;  // the absolute model gives no pair of torques
    for (const bool periodic : {true, false}) {
      scenes::BedOptions o;
      o.nx = o.ny = o.nz = 5;
      o.speed = 0.5, o.spacing = 2.02, o.periodic = periodic;
      SimulationSetup setup = scenes::bed(o, law, best());
      setup.gravity = 0.0;
      Simulation sim(setup);
      sim.set_time_step(5e-6);
      struct Sums {
        double p[3] = {0, 0, 0}, L[3] = {0, 0, 0}, p_size = 0.0, L_size = 0.0;
      };
      const auto sums = [&] {
        const ParticleFields f = sim.snapshot(false).particles;
        Sums out;
        for (std::size_t k = 0; k < f.size(); ++k) {
          const double *x = &f.position[3 * k], *v = &f.velocity[3 * k], *w = &f.angular_velocity[3 * k], m = f.mass[k];
          const double I = 0.4 * m * f.radius[k] * f.radius[k];
          for (std::size_t a = 0; a < 3; ++a) {
            const std::size_t b = (a + 1) % 3, c = (a + 2) % 3;
            out.p[a] += m * v[a];
            out.L[a] += m * (x[b] * v[c] - x[c] * v[b]) + I * w[a];
            out.p_size += m * std::fabs(v[a]), out.L_size += m * std::fabs(x[b] * v[c]);
          }
        }
        return out;
      };
      const Sums before = sums();
      sim.advance(2000);
      const Ledger ledger = sim.measure().ledger;
      ASSERT_GT(ledger.viscous_dissipation, 0.0) << row.name;  // they did collide
      ASSERT_GT(ledger.sliding_dissipation, 0.0) << row.name;
      const Sums after = sums();
      for (std::size_t a = 0; a < 3; ++a) {
        const std::string at = std::string(row.name) + (periodic ? ", periodic" : ", open");
        linear.check_below(at, std::fabs(after.p[a] - before.p[a]) / before.p_size, 1e-13);
        // The lever arms meet in one point where radii are equal.
        if (!periodic && row.spread == 0.0) angular.check_below(at, std::fabs(after.L[a] - before.L[a]) / before.L_size, 1e-12);
      }
    }
  }
}

// Brings a bed to rest, takes its limit of the step, then goes on at a share of it with what motion is left. Below the
// limit that motion stays what it is, above it the fastest mode takes over.
TEST(VerificationBed, LimitOfTheStep) {
  heading("Beds of 216 spheres at shares of dt_limit: kinetic energy over that at the start, largest within 20000 steps");
  Figure below("below (log10)", ""), above("above, bound reached (log10, from 5 on)", "");
  struct Row {
    const char* name;
    double k2, e, mu;
  };
  for (const Row& row : {Row{"undamped, k1 = k2", 5e3, 1.0, 1.0}, Row{"e = 0.4, k1 = k2", 5e3, 0.4, 1.0}, Row{"e = 0.05, k1 = k2", 5e3, 0.05, 1.0},
                         Row{"e = 0.4, k2/k1 = 5", 2.5e4, 0.4, 1.0}, Row{"e = 0.05, k2/k1 = 5", 2.5e4, 0.05, 1.0}}) {
    const scenes::BedOptions o = packed(row.k2 > 5e3);
    PairLaw law;
    law.k1 = 5e3, law.k2 = row.k2, law.restitution = 0.1;
    PlateLaw plate;
    plate.particle_young_modulus = 2e6, plate.restitution = 0.1;  // no stiffer than the pairs, so that these rule
    // Undamped springs never come to rest, so positions are found with dashpots and without friction. Without
    // hysteresis they and the overlaps are all of the state.
    SimulationSetup setup = scenes::bed(o, law, best());
    setup.gravity = 0.0;
    if (row.k2 == law.k1) {
      setup.plate = plate, setup.plate.friction = 0.0;
      Simulation relaxed(setup);
      relaxed.set_time_step(1e-5);
      scenes::add_plates(relaxed, scenes::height_of(o), 0.0);
      come_to_rest(relaxed, 1e-18);
      const ParticleFields p = relaxed.snapshot(false).particles;
      setup.spheres.position = p.position;
    }
    setup.pair.restitution = row.e, setup.pair.friction = row.mu;
    setup.plate = plate, setup.plate.restitution = row.e, setup.plate.friction = row.mu;
    scenes::Sequence random(7);
    for (double& v : setup.spheres.velocity) v = random.between(-1e-6, 1e-6);
    for (const double share : {0.95, 1.1}) {
      Simulation sim(setup);
      sim.set_time_step(2e-6);
      scenes::add_plates(sim, scenes::height_of(o), 0.0);
      if (row.k2 > law.k1) {
        press(sim, 100e3);
      }
      const StepLimits limits = sim.step_limits();
      if (row.e == 1.0) EXPECT_EQ(limits.dt_limit, limits.dt_crit);
      else EXPECT_LT(limits.dt_limit, 0.9 * limits.dt_crit);
      const double start = std::max(kinetic(sim), 1e-16);
      sim.set_time_step(share * limits.dt_limit);
      double most = 0.0;
      try {
        for (int k = 0; k < 200; ++k) {
          sim.advance(100);
          most = std::max(most, kinetic(sim));
          if (most > 1e8 * start) break;
        }
      } catch (const RunError&) {  // forces out of range: as unstable as can be
        most = INFINITY;
      }
      const std::string at = row.name + text(", %g dt_limit", share) + text(" (dt_limit/dt_crit = %.2f)", limits.dt_limit / limits.dt_crit);
      if (share < 1.0) below.check_below(at, std::max(0.0, std::log10(most / start)), 2.0);
      else above.check(at, std::min(5.0, std::log10(most / start)), 5.0, 1e-9);
    }
  }
}

TEST(VerificationBed, CohesiveBedStaysAtRest) {
  heading("A cohesive bed of 64 spheres at rest: f0 up to 300 times the weight, 100,000 steps");
  Figure energy("kinetic / potential energy at the end", ""), pairs("contacts lost or won", ""),
      ledger("energy dissipated at rest / all of before", "");
  for (const double f0 : {-0.02, -0.4}) {
    scenes::BedOptions o;
    o.spacing = 2.0, o.speed = 0.1;
    PairLaw law = scenes::full_law();
    law.f0 = f0, law.rolling_friction = 0.001;
    Simulation sim(scenes::bed(o, law, best()));
    sim.set_time_step(1e-5);
    sim.set_plane(plate_bottom, {});
    sim.advance(100000);
    const Measures before = sim.measure();
    ASSERT_GT(before.contacts, 64);
    sim.advance(100000);
    const Measures after = sim.measure();
    const std::string at = text("f0 = %g N", f0);
    energy.check_below(at, after.kinetic_energy / after.potential_energy, 1e-9);
    ledger.check_below(at, (after.ledger.dissipated() - before.ledger.dissipated()) / before.ledger.dissipated(), 1e-6);
    pairs.check_below(at, std::fabs(static_cast<double>(after.contacts - before.contacts)), 1.0);
  }
}

}  // namespace
}  // namespace platen
