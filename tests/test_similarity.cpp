// Exact similarity: lengths times L, stiffnesses times K, densities as they are. With times times sqrt(L^3 / K), forces
// times K L, plate moduli times K / L and gravity times K / L^2 the equations are the same. Where every factor is a power of
// two the bits are too; else what rounding leaves.
//
// S1: K = L, the scaling law itself, stresses as they are. S2: K = 1, stiffness not scaled: the same strain at 1 / L of the
// stress. S3: f0 ~ R or ~ R^3 is the scaled law with a reference's f0 that is L times weaker or stronger.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "protocol/scaling.h"
#include "tests/reference_data.h"
#include "tests/scenes.h"

namespace platen {
namespace {

struct Case {
  SimulationSetup setup;
  double dt = 0.0, z_top = 0.0, top_velocity = 0.0;
};

struct Factors {
  double length = 2.0, stiffness = 2.0;  // L, K
  double tolerance = 0.0;                // of the largest value; 0: to the bit
  double time() const { return std::sqrt(length * length * length / stiffness); }
  double speed() const { return length / time(); }
  double force() const { return stiffness * length; }
  double stress() const { return stiffness / length; }
};

constexpr Factors doubled{};

// Everything but the law of pairs, which a test may take from somewhere else.
Case scaled_scene(const Case& c, const Factors& by) {
  Case d = c;
  for (double& x : d.setup.spheres.position) x *= by.length;
  for (double& R : d.setup.spheres.radius) R *= by.length;
  for (double& v : d.setup.spheres.velocity) v *= by.speed();
  for (double& w : d.setup.spheres.spin) w /= by.time();
  d.setup.plate.particle_young_modulus *= by.stress(), d.setup.plate.young_modulus *= by.stress();
  d.setup.gravity *= by.speed() / by.time();
  d.setup.width *= by.length, d.setup.depth *= by.length;
  d.dt *= by.time(), d.z_top *= by.length, d.top_velocity *= by.speed();
  return d;
}

Case scaled(const Case& c, const Factors& by) {
  Case d = scaled_scene(c, by);
  PairLaw& law = d.setup.pair;
  law.k1 *= by.stiffness, law.k2 *= by.stiffness, law.k_adh *= by.stiffness, law.f0 *= by.force();
  return d;
}

Simulation& start(Simulation& sim, const Case& c) {
  sim.set_time_step(c.dt);
  scenes::add_plates(sim, c.z_top, c.top_velocity);
  sim.count_inserted();
  return sim;
}

void expect_scaled(const char* what, const std::vector<double>& small, const std::vector<double>& large, double factor, double tolerance) {
  ASSERT_EQ(small.size(), large.size()) << what;
  double largest = 0.0;
  for (const double x : large) largest = std::max(largest, std::fabs(x));
  for (std::size_t k = 0; k < small.size(); ++k) {
    if (tolerance == 0.0) {
      ASSERT_EQ(factor * small[k], large[k]) << what << ", number " << k;
    } else {
      ASSERT_NEAR(factor * small[k], large[k], tolerance * largest) << what << ", number " << k;
    }
  }
}

void compare(Simulation& small, Simulation& large, const Factors& by) {
  const auto expect = [&](const char* what, const std::vector<double>& a, const std::vector<double>& b, double factor) {
    expect_scaled(what, a, b, factor, by.tolerance);
  };
  const Snapshot a = small.snapshot(), b = large.snapshot();
  ASSERT_EQ(a.particles.image, b.particles.image);
  expect("position", a.particles.position, b.particles.position, by.length);
  expect("velocity", a.particles.velocity, b.particles.velocity, by.speed());
  expect("spin", a.particles.angular_velocity, b.particles.angular_velocity, 1.0 / by.time());
  ASSERT_EQ(a.contacts.pair, b.contacts.pair);
  if (by.tolerance == 0.0) {  // else rounding decides where two branches meet
    ASSERT_EQ(a.contacts.branch, b.contacts.branch);
  }
  expect("overlap", a.contacts.overlap, b.contacts.overlap, by.length);
  expect("plastic overlap", a.contacts.plastic_overlap, b.contacts.plastic_overlap, by.length);
  expect("normal force", a.contacts.normal_force, b.contacts.normal_force, by.force());
  expect("damping force", a.contacts.damping_force, b.contacts.damping_force, by.force());
  expect("tangential force", a.contacts.tangential_force, b.contacts.tangential_force, by.force());
  ASSERT_EQ(a.plate_contacts.id, b.plate_contacts.id);
  expect("plate force", a.plate_contacts.force, b.plate_contacts.force, by.force());
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
  expect("sums of forces and torques", sums(small), sums(large), by.force());

  const Measures m = small.measure(), n = large.measure();
  expect("stress", {m.stress_top, m.stress_bottom}, {n.stress_top, n.stress_bottom}, by.stress());
  expect("porosity", {m.porosity}, {n.porosity}, 1.0);
  EXPECT_EQ(m.contacts, n.contacts);
  expect("height", {m.height}, {n.height}, by.length);
  const Ledger &l = m.ledger, &k = n.ledger;
  expect("energies",
         {m.kinetic_energy, m.potential_energy, l.elastic_energy, l.adhesion_energy, l.tangential_energy, l.plate_energy,
          l.plastic_dissipation, l.viscous_dissipation, l.sliding_dissipation, l.rolling_dissipation,
          l.plate_model_work, l.plate_work, l.inserted_energy},
         {n.kinetic_energy, n.potential_energy, k.elastic_energy, k.adhesion_energy, k.tangential_energy, k.plate_energy,
          k.plastic_dissipation, k.viscous_dissipation, k.sliding_dissipation, k.rolling_dissipation,
          k.plate_model_work, k.plate_work, k.inserted_energy},
         by.force() * by.length);
}

// `d` is `c` scaled by `by`; so it stays.
void follow_both(Case c, Case d, const Factors& by, int steps, int block) {
  for (const InstructionSet set : available_instruction_sets())
    for (const bool reproducible : {false, true}) {
      SCOPED_TRACE(std::string(to_string(set)) + (reproducible ? " reproducible" : ""));
      for (EngineOptions* engine : {&c.setup.engine, &d.setup.engine}) engine->instruction_set = set, engine->reproducible = reproducible;
      Simulation small(c.setup), large(d.setup);
      start(small, c), start(large, d);
      for (int done = 0; done <= steps; done += block) {
        if (done > 0) small.advance(block), large.advance(block);
        compare(small, large, by);
        if (::testing::Test::HasFatalFailure()) return;
      }
      // The critical step scales as well; its iterations stop at a tolerance, hence not to the bit.
      const StepLimits a = small.step_limits(), b = large.step_limits();
      EXPECT_NEAR(b.dt_limit / a.dt_limit, by.time(), 1e-9 * by.time());
    }
}

void follow(const Case& c, int steps, int block, const Factors& by = doubled) { follow_both(c, scaled(c, by), by, steps, block); }

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

Case bed_of_a_thousand() {
  scenes::BedOptions o;
  o.nx = o.ny = o.nz = 10, o.speed = 0.4;
  return {scenes::bed(o, scenes::full_law(), {}), 1e-5, scenes::height_of(o) + 5e-5, -0.3};
}

TEST(Similarity, BedOfAThousand) { follow(bed_of_a_thousand(), 1000, 200); }

TEST(Similarity, UnequalSpheresWithRelativeRolling) {
  scenes::BedOptions o;
  o.nx = o.ny = 5, o.nz = 6, o.spread = 0.5;
  PairLaw law = scenes::full_law();
  law.exponent = 1.0, law.rolling_model = RollingModel::relative, law.rolling_friction = 0.05;
  Case c{scenes::bed(o, law, {}), 5e-6, scenes::height_of(o) + 5e-5, -0.3};
  follow(c, 400, 100);
}

// S1 at a factor that is no power of two: over the first 1000 steps to 1e-9, before rounding has grown. A bed at rest, since
// collisions multiply differences.
TEST(Similarity, OtherFactorsUpToRounding) {
  scenes::BedOptions o;
  o.nx = o.ny = 4, o.nz = 5, o.speed = 0.05, o.spacing = 1.98;
  const Case c{scenes::bed(o, scenes::full_law(), {}), 1e-5, scenes::height_of(o) + 5e-5, -0.05};
  follow(c, 1000, 100, {1.5, 1.5, 1e-9});
}

// S2: stiffness and pull of a contact per R as nobody scaled them, L = 4 for powers of two: a quarter of the stress.
TEST(Similarity, UnscaledStiffnessStrainsAlikeAtTheStressOverL) { follow(bed_of_a_thousand(), 1000, 200, {4.0, 1.0}); }

// S3, by the program's own scaling: at twice the size f0 ~ R is the quadratic law of half the reference's f0, f0 ~ R^3 that
// of twice as much.
TEST(Similarity, LinearAndCubicPullAreAWeakerAndAStrongerReference) {
  for (const double power : {1.0, 3.0}) {
    SCOPED_TRACE(power);
    const Case named = bed_of_a_thousand();
    Case reference = named, coarse = scaled_scene(named, doubled);
    reference.setup.pair.f0 *= std::pow(2.0, power - 2.0);
    coarse.setup.pair = scaled_law(named.setup.pair, {.stiffness = 1.0, .adhesion = power}, 2.0);
    follow_both(reference, coarse, doubled, 600, 200);
  }
}

// A wrong factor is noticed.
TEST(Similarity, OnlyWithTheRightFactors) {
  scenes::BedOptions o;
  Case c{scenes::bed(o, scenes::full_law(), {}), 1e-5, scenes::height_of(o) + 5e-5, -0.3}, d = scaled(c, doubled);
  d.setup.pair.f0 *= 0.5;  // linear instead of quadratic
  Simulation small(c.setup), large(d.setup);
  start(small, c).advance(20), start(large, d).advance(20);
  EXPECT_NE(2.0 * small.snapshot().particles.position[0], large.snapshot().particles.position[0]);
}

}  // namespace
}  // namespace platen
