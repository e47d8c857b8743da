// The scenes of the benches, and a Simulation of one of them on a bed.
#include <cmath>
#include <stdexcept>

#include "bench/beds.h"
#include "protocol/stages/random_source.h"

namespace platen::bench {

PairLaw full_law() {
  PairLaw law;
  law.k1 = 5e3, law.k2 = 2.5e4, law.k_adh = 1e3, law.f0 = -0.02;
  law.restitution = 0.4, law.friction = 0.5, law.rolling_friction = 0.001;
  return law;
}

PairLaw linear_law() {
  PairLaw law = full_law();
  law.k2 = law.k1, law.k_adh = law.f0 = law.rolling_friction = 0.0;
  return law;
}

std::vector<BenchScene> bench_scenes() {
  std::vector<BenchScene> all;
  const auto add = [&](const char* name, const PairLaw& law, const auto& change) {
    BenchScene scene;
    scene.name = name, scene.law = law;
    change(scene);
    all.push_back(scene);
  };
  const auto as_it_is = [](BenchScene&) {};
  const PairLaw full = full_law();
  add("full", full, as_it_is);
  // Neither spheres nor plates brake spins: as LAMMPS's deck has it [bench/peers/lammps.in].
  const auto no_rolling = [](BenchScene& s) { s.plate.rolling_friction = 0.0; };
  add("linear", linear_law(), no_rolling);
  PairLaw cohesionless = full;
  cohesionless.k_adh = cohesionless.f0 = 0.0;
  add("no_adhesion", cohesionless, as_it_is);
  PairLaw elastic = full;
  elastic.k2 = elastic.k1;
  add("no_plasticity", elastic, as_it_is);
  PairLaw not_rolling = full;
  not_rolling.rolling_friction = 0.0;
  add("no_rolling", not_rolling, as_it_is);
  add("no_energy", full, [](BenchScene& s) { s.energy = false; });
  add("linear_no_energy", linear_law(), [&](BenchScene& s) { s.energy = false, no_rolling(s); });
  add("no_plates", full, [](BenchScene& s) { s.plates = false, s.gravity = 0.0; });
  add("open", full, [](BenchScene& s) { s.periodic = false; });
  add("walls", full, [](BenchScene& s) { s.periodic = false, s.walls = true; });
  // Radii so little apart that the contacts stay what they are: the cost of the columns, not of another bed.
  add("unequal_radii", full, [](BenchScene& s) { s.spread = 1e-4; });
  // Stiffnesses for the same force at an overlap of R/50.
  const double root = std::sqrt(0.02 * bench_radius);
  PairLaw hertzian = full;
  hertzian.exponent = 1.5;
  hertzian.k1 /= root, hertzian.k2 /= root, hertzian.k_adh /= root;
  add("three_halves", hertzian, as_it_is);
  PairLaw any = full;
  any.exponent = 1.3;
  const double power = std::pow(0.02 * bench_radius, 0.3);
  any.k1 /= power, any.k2 /= power, any.k_adh /= power;
  add("any_exponent", any, as_it_is);
  PairLaw relative = full;
  relative.rolling_model = RollingModel::relative;
  add("relative_rolling", relative, as_it_is);
  add("reproducible", full, [](BenchScene& s) { s.reproducible = true; });
  const auto rain = [&](BenchScene& s) { s.top = false, no_rolling(s); };
  add("rain", linear_law(), rain);
  add("rain_no_energy", linear_law(), [&](BenchScene& s) { rain(s), s.energy = false; });
  add("rain_full", full, [](BenchScene& s) { s.top = false; });
  return all;
}

BenchScene bench_scene(const std::string& name) {
  std::string known;
  for (const BenchScene& scene : bench_scenes()) {
    if (scene.name == name) return scene;
    known += " " + scene.name;
  }
  throw std::invalid_argument("no scene '" + name + "'; there are" + known);
}

std::unique_ptr<Simulation> make_simulation(const Bed& bed, const BenchScene& scene, const BenchEngine& engine) {
  SimulationSetup setup;
  setup.pair = scene.law, setup.plate = scene.plate;
  setup.gravity = scene.gravity;
  setup.width = bed.width, setup.depth = bed.depth;
  setup.periodic = scene.periodic;
  setup.engine.instruction_set = engine.set;
  setup.engine.threads = engine.threads;
  setup.engine.batch = engine.batch;
  setup.engine.skin = engine.skin, setup.engine.inner_gap = engine.gap;
  if (engine.cache > 0.0) setup.engine.cache = engine.cache;
  if (engine.unroll > 0) setup.engine.unroll = engine.unroll;
  setup.engine.executor = engine.executor;
  setup.engine.fused = engine.fused;
  setup.engine.energy = scene.energy;
  setup.engine.reproducible = scene.reproducible;
  SphereTable& s = setup.spheres;
  s.position = bed.position, s.velocity = bed.velocity, s.spin = bed.spin;
  RandomSource random(7);
  for (std::size_t k = 0; k < bed.size(); ++k) {
    s.id.push_back(static_cast<std::int64_t>(k));
    s.radius.push_back(bed.R * (1.0 - scene.spread * random.uniform()));
    s.density.push_back(bed.density);
  }
  auto sim = std::make_unique<Simulation>(std::move(setup));
  sim->set_time_step(bench_step_size);
  const auto plane = [&](int plate, double position, double velocity) {
    PlaneMotion motion;
    motion.origin = position, motion.velocity = velocity;
    sim->set_plane(plate, motion);
  };
  if (scene.plates) {
    plane(plate_bottom, 0.0, 0.0);
    if (scene.top) plane(plate_top, bed.height, -0.01);
  }
  if (scene.walls) {  // a radius away, because the bed's faces are cut through spheres
    plane(wall_x_low, -bed.R, 0.0), plane(wall_x_high, bed.width + bed.R, 0.0);
    plane(wall_y_low, -bed.R, 0.0), plane(wall_y_high, bed.depth + bed.R, 0.0);
  }
  sim->count_inserted();
  return sim;
}

}  // namespace platen::bench
