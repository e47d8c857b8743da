// Exact similarity: all lengths times 2, stiffnesses times 2, constant pull times 4, gravity and spins by 2, time step
// times 2, densities, moduli and speeds as they are. The equations are then the same, and as every factor is a power of
// two the bits are too: positions times 2, forces and energies times 4 and 8.
#include <gtest/gtest.h>

#include "tests/reference_data.h"
#include "tests/scenes.h"

namespace platen {
namespace {

struct Case {
  SimulationSetup setup;
  double dt = 0.0, z_top = 0.0, top_velocity = 0.0;
};

Case doubled(const Case& c) {
  Case d = c;
  PairLaw& law = d.setup.pair;
  law.k1 *= 2.0, law.k2 *= 2.0, law.k_adh *= 2.0, law.f0 *= 4.0;
  for (double& x : d.setup.spheres.position) x *= 2.0;
  for (double& R : d.setup.spheres.radius) R *= 2.0;
  for (double& w : d.setup.spheres.spin) w *= 0.5;
  d.setup.gravity *= 0.5;
  d.setup.width *= 2.0, d.setup.depth *= 2.0;
  d.dt *= 2.0, d.z_top *= 2.0;
  return d;
}

Simulation& start(Simulation& sim, const Case& c) {
  sim.set_time_step(c.dt);
  scenes::add_plates(sim, c.z_top, c.top_velocity);
  sim.count_inserted();
  return sim;
}

void expect_scaled(const char* what, const std::vector<double>& small, const std::vector<double>& large, double factor) {
  ASSERT_EQ(small.size(), large.size()) << what;
  for (std::size_t k = 0; k < small.size(); ++k) ASSERT_EQ(factor * small[k], large[k]) << what << ", number " << k;
}

void compare(Simulation& small, Simulation& large) {
  const Snapshot a = small.snapshot(), b = large.snapshot();
  ASSERT_EQ(a.particles.image, b.particles.image);
  expect_scaled("position", a.particles.position, b.particles.position, 2.0);
  expect_scaled("velocity", a.particles.velocity, b.particles.velocity, 1.0);
  expect_scaled("spin", a.particles.angular_velocity, b.particles.angular_velocity, 0.5);
  ASSERT_EQ(a.contacts.pair, b.contacts.pair);
  ASSERT_EQ(a.contacts.branch, b.contacts.branch);
  expect_scaled("overlap", a.contacts.overlap, b.contacts.overlap, 2.0);
  expect_scaled("plastic overlap", a.contacts.plastic_overlap, b.contacts.plastic_overlap, 2.0);
  expect_scaled("normal force", a.contacts.normal_force, b.contacts.normal_force, 4.0);
  expect_scaled("damping force", a.contacts.damping_force, b.contacts.damping_force, 4.0);
  expect_scaled("tangential force", a.contacts.tangential_force, b.contacts.tangential_force, 4.0);
  ASSERT_EQ(a.plate_contacts.id, b.plate_contacts.id);
  expect_scaled("plate force", a.plate_contacts.force, b.plate_contacts.force, 4.0);
  // What the step adds up, spheres in the order of ids.
  const auto sums = [](const Simulation& sim) {
    std::vector<double> all(static_cast<std::size_t>(sim.state().count) * record_size);
    for (const Batch& batch : sim.batches())
      for (std::int32_t m = 0; m < batch.count && batch.first + m < sim.state().count; ++m)
        for (std::size_t field = 0; field < record_size; ++field)
          all[record_size * static_cast<std::size_t>(sim.state().rank[static_cast<std::size_t>(batch.first + m)]) + field] =
              batch.sum[record_size * static_cast<std::size_t>(m) + field];
    return all;
  };
  expect_scaled("sums of forces and torques", sums(small), sums(large), 4.0);

  const Measures m = small.measure(), n = large.measure();
  EXPECT_EQ(m.stress_top, n.stress_top);
  EXPECT_EQ(m.stress_bottom, n.stress_bottom);
  EXPECT_EQ(m.porosity, n.porosity);
  EXPECT_EQ(m.contacts, n.contacts);
  EXPECT_EQ(2.0 * m.height, n.height);
  const Ledger &l = m.ledger, &k = n.ledger;
  expect_scaled("energies",
                {m.kinetic_energy, m.potential_energy, l.elastic_energy, l.adhesion_energy, l.tangential_energy, l.plate_energy,
                 l.plastic_dissipation, l.viscous_dissipation, l.sliding_dissipation, l.rolling_dissipation,
                 l.plate_model_work, l.plate_work, l.inserted_energy},
                {n.kinetic_energy, n.potential_energy, k.elastic_energy, k.adhesion_energy, k.tangential_energy, k.plate_energy,
                 k.plastic_dissipation, k.viscous_dissipation, k.sliding_dissipation, k.rolling_dissipation,
                 k.plate_model_work, k.plate_work, k.inserted_energy},
                8.0);
}

void follow(Case c, int steps, int block) {
  for (const InstructionSet set : available_instruction_sets())
    for (const bool reproducible : {false, true}) {
      SCOPED_TRACE(std::string(to_string(set)) + (reproducible ? " reproducible" : ""));
      c.setup.engine.instruction_set = set, c.setup.engine.reproducible = reproducible;
      const Case d = doubled(c);
      Simulation small(c.setup), large(d.setup);
      start(small, c), start(large, d);
      for (int done = 0; done <= steps; done += block) {
        if (done > 0) small.advance(block), large.advance(block);
        compare(small, large);
        if (::testing::Test::HasFatalFailure()) return;
      }
      // The critical step doubles as well; its iterations stop at a tolerance, hence not to the bit.
      const StepLimits a = small.step_limits(), b = large.step_limits();
      EXPECT_NEAR(b.dt_limit / a.dt_limit, 2.0, 1e-9);
    }
}

TEST(Similarity, ManyBodyRecord) {
  for (const reference::Record& r : reference::read_records("many_body")) {
    SCOPED_TRACE(r.id);
    const reference::Json &in = r.inputs, &law = in.at("law"), &plate = in.at("plate");
    Case c;
    SimulationSetup& s = c.setup;
    s.pair.k1 = law.at("k1"), s.pair.k2 = law.at("k2"), s.pair.k_adh = law.at("kadh"), s.pair.f0 = law.at("f0");
    s.pair.restitution = law.at("e"), s.pair.friction = law.at("mu"), s.pair.rolling_friction = law.at("mu_r");
    s.plate.particle_young_modulus = plate.at("E").at(0), s.plate.young_modulus = plate.at("E").at(1);
    s.plate.friction = plate.at("mu"), s.plate.rolling_friction = law.at("mu_r");
    s.gravity = in.at("g"), s.width = in.at("Lx"), s.depth = in.at("Ly"), s.periodic = true;
    for (std::size_t k = 0; k < in.at("x").size(); ++k) {
      s.spheres.id.push_back(static_cast<std::int64_t>(k));
      for (std::size_t axis = 0; axis < 3; ++axis) {
        s.spheres.position.push_back(in.at("x").at(k).at(axis));
        s.spheres.velocity.push_back(in.at("v").at(k).at(axis));
        s.spheres.spin.push_back(in.at("w").at(k).at(axis));
      }
      s.spheres.radius.push_back(in.at("R"));
      s.spheres.density.push_back(in.at("density"));
    }
    c.dt = in.at("dt"), c.z_top = in.at("z_top"), c.top_velocity = -in.at("plate_speed_down").get<double>();
    follow(c, 2000, 250);
  }
}

TEST(Similarity, BedOfAThousand) {
  scenes::BedOptions o;
  o.nx = o.ny = o.nz = 10, o.speed = 0.4;
  Case c{scenes::bed(o, scenes::full_law(), {}), 1e-5, scenes::height_of(o) + 5e-5, -0.3};
  follow(c, 1000, 200);
}

TEST(Similarity, UnequalSpheresWithRelativeRolling) {
  scenes::BedOptions o;
  o.nx = o.ny = 5, o.nz = 6, o.spread = 0.5;
  PairLaw law = scenes::full_law();
  law.exponent = 1.0, law.rolling_model = RollingModel::relative, law.rolling_friction = 0.05;
  Case c{scenes::bed(o, law, {}), 5e-6, scenes::height_of(o) + 5e-5, -0.3};
  follow(c, 400, 100);
}

// A wrong factor is noticed.
TEST(Similarity, OnlyWithTheRightFactors) {
  scenes::BedOptions o;
  Case c{scenes::bed(o, scenes::full_law(), {}), 1e-5, scenes::height_of(o) + 5e-5, -0.3}, d = doubled(c);
  d.setup.pair.f0 *= 0.5;  // linear instead of quadratic
  Simulation small(c.setup), large(d.setup);
  start(small, c).advance(20), start(large, d).advance(20);
  EXPECT_NE(2.0 * small.snapshot().particles.position[0], large.snapshot().particles.position[0]);
}

}  // namespace
}  // namespace platen
