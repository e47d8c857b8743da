// The engine against the brute-force reference, step by step: every law, every instruction set.
#include <gtest/gtest.h>

#include "tests/reference_bed.h"
#include "tests/scenes.h"

namespace platen {
namespace {

using scenes::BedOptions;

struct Variant {
  const char* name;
  PairLaw law;
  BedOptions bed;
};

reference::Bed reference_of(const SimulationSetup& s, double z_top, double top_velocity) {
  reference::Bed bed;
  bed.pair_law = {s.pair.k1, s.pair.k2, s.pair.k_adh, s.pair.f0, s.pair.exponent, s.pair.restitution, s.pair.friction,
                  s.pair.rolling_friction, s.pair.tangential_ratio,
                  s.pair.friction_limit == FrictionLimit::normal, s.pair.rolling_model == RollingModel::relative};
  bed.plate_law = {s.plate.particle_young_modulus, s.plate.particle_poisson_ratio, s.plate.young_modulus,
                   s.plate.poisson_ratio, s.plate.restitution, s.plate.friction, s.plate.rolling_friction};
  bed.g = s.gravity;
  bed.periodic = s.periodic;
  bed.Lx = s.width, bed.Ly = s.depth;
  const auto vec = [](const std::vector<double>& v, std::size_t k) { return reference::Vec3{v[3 * k], v[3 * k + 1], v[3 * k + 2]}; };
  for (std::size_t k = 0; k < s.spheres.id.size(); ++k)
    bed.add(vec(s.spheres.position, k), vec(s.spheres.velocity, k), vec(s.spheres.spin, k), s.spheres.radius[k], s.spheres.density[k]);
  bed.add_bottom();
  bed.add_top(z_top, top_velocity);
  return bed;
}

std::vector<Variant> variants() {
  std::vector<Variant> list;
  const PairLaw full = scenes::full_law();
  list.push_back({"full", full, {}});
  PairLaw elastic = full;
  elastic.k2 = elastic.k1, elastic.k_adh = elastic.f0 = elastic.rolling_friction = 0.0;
  list.push_back({"elastic", elastic, {}});
  PairLaw cohesionless = full;
  cohesionless.k_adh = cohesionless.f0 = 0.0;
  list.push_back({"cohesionless", cohesionless, {}});
  BedOptions wide;
  wide.spread = 0.4;
  list.push_back({"unequal", full, wide});
  PairLaw hertzian = full;
  hertzian.exponent = 1.5, hertzian.k1 = 5e5, hertzian.k2 = 2e6, hertzian.k_adh = 2e5;
  list.push_back({"three_halves", hertzian, wide});
  PairLaw square = full;
  square.exponent = 2.0, square.k1 = 5e7, square.k2 = 2e8, square.k_adh = 2e7;
  list.push_back({"square", square, {}});
  PairLaw soft = full;
  soft.exponent = 0.8, soft.k1 = 1e3, soft.k2 = 4e3, soft.k_adh = 500;
  list.push_back({"exponent_0.8", soft, {}});
  PairLaw plain_limit = full;
  plain_limit.friction_limit = FrictionLimit::normal;
  list.push_back({"plain_limit", plain_limit, {}});
  PairLaw relative = full;
  relative.rolling_model = RollingModel::relative, relative.rolling_friction = 0.05;
  list.push_back({"relative_rolling", relative, wide});
  return list;
}

// Rounding differs between the two, and collisions amplify it: over 200 steps at dt = 2e-6 s (a fraction of a collision)
// from 1e-16 to below 1e-10 of a radius. A wrong term in the law shows at 1e-4.
TEST(Engine, FollowsTheReferenceStepByStep) {
  const double dt = 2e-6;
  for (const InstructionSet set : available_instruction_sets())
    for (const bool reproducible : {false, true})
      for (const Variant& variant : variants()) {
        SCOPED_TRACE(std::string(to_string(set)) + " " + variant.name + (reproducible ? " reproducible" : ""));
        EngineOptions engine;
        engine.instruction_set = set, engine.reproducible = reproducible;
        engine.batch = 16;
        const SimulationSetup setup = scenes::bed(variant.bed, variant.law, engine);
        const double R = variant.bed.R, z_top = 4 * 1.9 * R + 0.02 * R;
        reference::Bed reference = reference_of(setup, z_top, -0.3);
        Simulation sim(setup);
        sim.set_time_step(dt);
        scenes::add_plates(sim, z_top, -0.3);
        reference.start();
        for (int block = 0; block <= 4; ++block) {
          if (block > 0) {
            for (int step = 0; step < 50; ++step) reference.advance(dt);
            sim.advance(50);
          }
          const Snapshot s = sim.snapshot();
          ASSERT_EQ(s.particles.size(), reference.spheres.size());
          double worst_x = 0.0, worst_v = 0.0, worst_w = 0.0;
          for (std::size_t k = 0; k < s.particles.size(); ++k) {
            const double L[3] = {setup.width, setup.depth, 0.0};
            const reference::Body& b = reference.spheres[k];
            const double x[3] = {b.x.x, b.x.y, b.x.z};
            const auto rv = reference.velocity(k), rw = reference.spin(k);
            const double v[3] = {rv.x, rv.y, rv.z}, w[3] = {rw.x, rw.y, rw.z};
            for (std::size_t axis = 0; axis < 3; ++axis) {
              const double image = axis < 2 ? s.particles.image[2 * k + axis] * L[axis] : 0.0;
              worst_x = std::max(worst_x, std::fabs(s.particles.position[3 * k + axis] + image - x[axis]));
              worst_v = std::max(worst_v, std::fabs(s.particles.velocity[3 * k + axis] - v[axis]));
              worst_w = std::max(worst_w, std::fabs(s.particles.angular_velocity[3 * k + axis] - w[axis]) * R);
            }
          }
          EXPECT_LT(worst_x, 1e-9 * R) << "block " << block;
          EXPECT_LT(worst_v, 1e-9) << "block " << block;
          EXPECT_LT(worst_w, 1e-9) << "block " << block;
          const Measures m = sim.measure();
          EXPECT_EQ(static_cast<std::size_t>(m.contacts), reference.pair_contacts());
          const reference::Energy e = reference.energy();
          const double scale = e.kinetic + e.elastic + e.dissipated() + 1e-9;
          EXPECT_NEAR(m.kinetic_energy, e.kinetic, 1e-8 * scale);
          EXPECT_NEAR(m.ledger.elastic_energy, e.elastic, 1e-8 * scale);
          EXPECT_NEAR(m.ledger.adhesion_energy, e.adhesion, 1e-8 * scale);
          EXPECT_NEAR(m.ledger.tangential_energy, e.tangential, 1e-8 * scale);
          EXPECT_NEAR(m.ledger.plate_energy, e.plate, 1e-8 * scale);
        }
      }
}

// What a snapshot says of a sliding contact is what the kernel used, for both friction limits.
TEST(Engine, ASlidingContactHasTheForceOfItsLimit) {
  for (const FrictionLimit kind : {FrictionLimit::adhesive, FrictionLimit::normal}) {
    PairLaw law = scenes::full_law();
    law.friction = 0.01, law.friction_limit = kind;  // most slide
    EngineOptions engine;
    BedOptions options;
    Simulation sim(scenes::bed(options, law, engine));
    sim.set_time_step(2e-6);
    sim.advance(100);
    const ContactFields c = sim.snapshot().contacts;
    ASSERT_GT(c.size(), 60u);
    std::size_t sliding = 0;
    for (std::size_t k = 0; k < c.size(); ++k) {
      const double* t = &c.tangential_force[3 * k];
      const double force = std::sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
      const double height = kind == FrictionLimit::normal ? c.normal_force[k] : c.normal_force[k] - law.f0 + law.k_adh * c.overlap[k];
      sliding += std::fabs(force - law.friction * std::fabs(height)) < 1e-12;
    }
    EXPECT_GT(sliding, c.size() * 3 / 4) << sliding << " of " << c.size();
  }
}

}  // namespace
}  // namespace platen
