// From a case to a Simulation, and the time step that it starts with.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "protocol/experiment.h"
#include "protocol/stages/draw_radii.h"
#include "protocol/stages/grow.h"
#include "protocol/stages/rain.h"

namespace platen {

namespace {

SphereTable spheres_from(const ParticleTable& t) {
  SphereTable s;
  s.id = t.id, s.radius = t.radius, s.density = t.density;
  for (std::size_t k = 0; k < t.size(); ++k) {
    s.position.insert(s.position.end(), {t.x[k], t.y[k], t.z[k]});
    s.velocity.insert(s.velocity.end(), {t.vx[k], t.vy[k], t.vz[k]});
    s.spin.insert(s.spin.end(), {t.wx[k], t.wy[k], t.wz[k]});
  }
  return s;
}

SphereTable filled_spheres(const Case& c) try {
  const StageSpec& fill = c.stages.front();
  RandomSource random(c.seed);
  SphereTable s;
  s.radius = draw_radii(c.particles.sizes, c.particles.count, random);
  const auto n = s.radius.size();
  s.density.assign(n, c.particles.density);
  for (std::size_t k = 0; k < n; ++k) s.id.push_back(static_cast<std::int64_t>(k));
  const bool periodic = c.box.sides == Sides::periodic;
  if (fill.method == FillMethod::rain) {
    if (fill.duration) {
      const double z = outlet_of(c), column = rain_column(c, first_step(c).dt);
      double solid = 0.0;
      for (const double R : s.radius) solid += sphere_mass(R, 1.0);
      const double solid_fraction = std::min(rain_solid_fraction, solid / (c.box.width * c.box.depth * column));
      s.position = rain_positions(s.radius, c.box.width, c.box.depth, periodic, z, solid_fraction, random, z + column);
    } else {
      s.position = rain_positions(s.radius, c.box.width, c.box.depth, periodic, 0.0, rain_solid_fraction, random);
    }
    for (std::size_t k = 0; k < n; ++k) s.velocity.insert(s.velocity.end(), {0.0, 0.0, -fill.drop_speed});
  } else {
    GrownBed bed = grow_bed(s.radius, c.box.width, c.box.depth, periodic, *fill.porosity, random);
    if (!bed.reached)
      throw RunError(fmt::format("fill: a porosity of {:.4g} cannot be reached by growing these spheres: largest overlap left {:.3g} R; "
                                 "ask for a looser bed", *fill.porosity, bed.largest_overlap));
    s.position = std::move(bed.position);
  }
  return s;
} catch (const std::invalid_argument& error) {  // a box too narrow in a way that no check of the case knows
  throw RunError(std::string("fill: ") + error.what());
}

}  // namespace

FirstStep first_step(const Case& c) {
  const PairLaw& law = c.particles.law;
  // The smallest sphere rules; stiffnesses that grow with the overlap are taken at a tenth of its radius.
  double R = c.particles.sizes.smallest(), rho = c.particles.density;
  if (c.particles.table) {
    R = *std::min_element(c.particles.table->radius.begin(), c.particles.table->radius.end());
    rho = *std::min_element(c.particles.table->density.begin(), c.particles.table->density.end());
  }
  const double n = law.exponent, delta = n < 1.0 ? 1e-3 * R : 0.1 * R;
  const double m = sphere_mass(R, rho), slope = n == 1.0 ? 1.0 : n * std::pow(delta, n - 1.0);
  const double log_e = std::log(law.restitution), pi = std::numbers::pi;
  const double z = log_e * log_e / (pi * pi + log_e * log_e);
  const double beta_n = std::sqrt((n + 1.0) / (2.0 * n) * 4.0 * (0.5 * m) * law.k1 * slope * z);
  FirstStep first;
  first.limits = free_limits(m, law.k2 * slope, law.tangential_ratio * law.k1 * slope, beta_n,
                             beta_n * std::sqrt(law.tangential_ratio));
  if (c.time.step) {
    first.dt = *c.time.step;
    first.rule = "fixed by time.step";
    return first;
  }
  const double safety = c.time.safety;
  const double by_springs = safety * first.limits.dt_pairs, by_dashpots = 0.8 * first.limits.dt_limit;
  first.dt = floor_to_grid(std::min(by_springs, by_dashpots));
  first.rule = by_springs <= by_dashpots ? fmt::format("{:.3g} dt_crit", safety) : "0.8 dt_limit (dashpots)";
  return first;
}

void refuse_unstable_step(const Case& c) {
  if (!c.time.step || c.time.allow_unstable) return;
  const FirstStep first = first_step(c);
  if (*c.time.step <= 0.9 * first.limits.dt_limit) return;
  throw CaseError(fmt::format("{}: time.step: {:.4g} s is above 0.9 dt_limit = {:.4g} s (dt_crit {:.4g} s) of a dense bed; a smaller "
                              "step, \"auto\", or time.allow_unstable = true",
                              c.time.step_where.empty() ? c.file.string() : c.time.step_where, *c.time.step, 0.9 * first.limits.dt_limit, first.limits.dt_crit));
}

namespace {

SimulationSetup setup_of(const Case& c, SphereTable spheres, int threads, bool reproducible) {
  SimulationSetup setup;
  setup.pair = c.particles.law;
  setup.plate = c.plates.law;
  setup.spheres = std::move(spheres);
  setup.gravity = c.gravity;
  setup.width = c.box.width, setup.depth = c.box.depth;
  setup.periodic = c.box.sides == Sides::periodic;
  EngineOptions& engine = setup.engine;
  engine.skin = c.engine.skin.value_or(0.0);
  engine.inner_gap = c.engine.inner_gap.value_or(0.0);
  engine.batch = c.engine.batch.value_or(0);
  // Threads that would get less than a thousand spheres each cost more than they bring.
  const auto useful = std::max<std::int64_t>(1, static_cast<std::int64_t>(setup.spheres.id.size()) / 1000);
  engine.threads = static_cast<int>(std::min<std::int64_t>(threads, useful));
  engine.reproducible = reproducible;
  engine.energy = c.output.energy;
  engine.instruction_set = preferred_instruction_set();
  return setup;
}

}  // namespace

std::unique_ptr<Simulation> make_simulation(const Case& c, const Checkpoint& from, int threads) {
  SphereTable spheres;
  spheres.id = from.bed.id, spheres.radius = from.bed.radius, spheres.position = from.bed.position;
  spheres.density = from.density.size() == 1 ? std::vector<double>(spheres.id.size(), from.density.front()) : from.density;
  if (spheres.density.size() != spheres.id.size()) throw OutputError("the checkpoint has densities of other spheres");
  SimulationSetup setup = setup_of(c, std::move(spheres), threads, from.reproducible);
  if (!from.reproducible) {
    // Other kernels round differently: the run would go on, but not with the same bits.
    const auto sets = available_instruction_sets();
    const auto same = std::find_if(sets.begin(), sets.end(), [&](InstructionSet set) { return to_string(set) == from.instruction_set; });
    if (same == sets.end()) throw OutputError("the run was made with " + from.instruction_set + " kernels, which this processor does not have; only a run with --reproducible goes on anywhere");
    setup.engine.instruction_set = *same;
  }
  auto sim = std::make_unique<Simulation>(std::move(setup));
  try {
    sim->take_up(from.bed);
  } catch (const std::invalid_argument& error) {
    throw OutputError(std::string("the checkpoint does not fit the case: ") + error.what());
  }
  return sim;
}

std::unique_ptr<Simulation> make_simulation(const Case& c, int threads, bool reproducible) {
  auto sim = std::make_unique<Simulation>(setup_of(c, c.particles.table ? spheres_from(*c.particles.table) : filled_spheres(c), threads, reproducible));
  sim->set_time_step(first_step(c).dt);
  const auto plane = [&](int plate, double position) {
    PlaneMotion motion;
    motion.origin = position;
    sim->set_plane(plate, motion);
  };
  if (c.plates.bottom) plane(plate_bottom, 0.0);
  const bool raining = !c.particles.table && c.stages.front().method == FillMethod::rain;
  if (c.plates.top && !raining) plane(plate_top, std::max(c.box.height, c.particles.table ? 0.0 : sim->measure(false).highest_point));
  if (c.box.sides == Sides::walls) {
    plane(wall_x_low, 0.0), plane(wall_x_high, c.box.width);
    plane(wall_y_low, 0.0), plane(wall_y_high, c.box.depth);
  }
  sim->count_inserted();
  return sim;
}

}  // namespace platen
