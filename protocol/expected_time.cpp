#include "protocol/expected_time.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>

#include "protocol/experiment.h"
#include "protocol/stages/rain.h"
#include "protocol/stages/random_source.h"

namespace platen {
namespace {

constexpr std::int64_t largest_bed = 40'000;
constexpr double measuring_time = 0.25;  // [s], after some steps to warm up
constexpr std::int64_t warm_up_steps = 64;

// The same case with a dense bed in place of its own: a cubic lattice whose neighbours overlap by 1.5 % of a diameter on
// average, which has about the contacts of a compressed bed.
Case dense_case(const Case& c, std::int64_t count, bool equal, double dt) {
  Case dense = c;
  const double R = c.particles.table ? c.particles.table->radius.front()
                                     : 0.5 * (c.particles.sizes.smallest() + c.particles.sizes.largest());
  const double rho = c.particles.table ? c.particles.table->density.front() : c.particles.density;
  const auto n = std::max<std::int64_t>(3, std::llround(std::cbrt(static_cast<double>(count))));
  const double a = 1.97 * R;
  const double edge = a * static_cast<double>(n);
  const double apart = 1.01 * R - 0.5 * a;  // plates may be far stiffer than the springs: they begin without a push
  ParticleTable bed;
  RandomSource random(1);
  const auto place = [&](std::int64_t cell) {
    return (static_cast<double>(cell) + 0.5) * a + 0.01 * R * (2.0 * random.uniform() - 1.0);
  };
  for (std::int64_t k = 0; k < n * n * n; ++k) {
    bed.id.push_back(k);
    bed.x.push_back(place(k % n)), bed.y.push_back(place(k / n % n)), bed.z.push_back(apart + place(k / (n * n)));
    bed.radius.push_back(R);
    bed.density.push_back(rho);
  }
  // A hair heavier, so that the engine takes the kernels for unequal spheres.
  if (!equal) bed.density.front() *= 1.0 + 1e-9;
  const std::vector<double> still(bed.size(), 0.0);
  bed.vx = bed.vy = bed.vz = bed.wx = bed.wy = bed.wz = still;
  dense.particles.table = std::move(bed);
  dense.particles.count = n * n * n;
  dense.plates.top = dense.plates.bottom = true;
  // Adhesion that would pull this bed together costs no more than less of it.
  PairLaw& law = dense.particles.law;
  law.f0 = std::max(law.f0, -0.5 * law.k1 * std::pow(2.0 * R - a, law.exponent));
  dense.box = {true, edge, edge, edge + 2.0 * apart, Sides::periodic};
  dense.time.step = dt;
  return dense;
}

// A porosity that rain leaves, from own runs: 0.42 without adhesion, 0.49 where f0 is 200 times a sphere's weight; with
// k_adh, contacts that were pressed by the fall stick too.
double free_porosity(double bond, bool sticky) {
  return std::clamp(0.42 + 0.013 * std::log1p(bond), sticky ? 0.50 : 0.42, 0.75);
}

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// As a run goes on: so many steps, then a look at the bed.
double steps_per_second(Simulation& sim, std::int64_t steps) {
  const auto go_on = [&] {
    sim.advance(steps);
    sim.measure(false);
  };
  while (sim.step() < warm_up_steps) go_on();
  const std::int64_t first = sim.step();
  const auto begin = std::chrono::steady_clock::now();
  double elapsed = 0.0;
  do go_on();
  while ((elapsed = seconds_since(begin)) < measuring_time);
  return static_cast<double>(sim.step() - first) / elapsed;
}

}  // namespace

EngineSpeed measure_speed(const Case& c, std::int64_t count, bool equal, double dt, int threads) {
  // Large enough to give every thread something to do.
  const std::int64_t most = std::max<std::int64_t>(largest_bed, 1000 * static_cast<std::int64_t>(threads));
  EngineSpeed speed;
  speed.threads = static_cast<int>(std::min<std::int64_t>(threads, std::max<std::int64_t>(1, count / 1000)));
  // Plates may be so much stiffer than the springs that the step of the springs is none for them. A step costs the same, however long.
  for (const double step : {dt, 0.1 * dt, 0.01 * dt, 0.001 * dt}) try {
      const auto sim = make_simulation(dense_case(c, std::min(count, most), equal, step), threads, false);
      speed.scene = built_scenes[static_cast<std::size_t>(sim->kernels().scene)].name;
      speed.instruction_set = to_string(sim->kernels().instruction_set);
      speed.particle_steps_per_second = steps_per_second(*sim, c.engine.check_every) * sim->particles();
      // More spheres than fit into the caches: 20, 15, 12 M/s were measured at 35,000, 280,000, 1,000,000 spheres.
      if (count > sim->particles())
        speed.particle_steps_per_second *= std::pow(static_cast<double>(sim->particles()) / static_cast<double>(count), 0.15);
      break;
    } catch (const RunError&) {  // of a bed that nobody asked for
    }
  return speed;
}

std::optional<BedGuess> guess_bed(const Case& c, const SphereFacts& f) {
  const double area = c.box.width * c.box.depth;
  if (!(area > 0.0) || c.stages.empty()) return std::nullopt;
  const StageSpec& start = c.stages.front();
  BedGuess bed;
  bed.porosity = start.kind == StageKind::fill && start.porosity ? *start.porosity
                                                                 : free_porosity(bond_number(c, f).value_or(0.0), c.particles.law.k_adh > 0.0);
  bed.height = f.solid_volume / (area * (1.0 - bed.porosity));
  bed.rain_height = f.solid_volume / (area * rain_solid_fraction);
  return bed;
}

std::vector<ExpectedStage> expected_stages(const Case& c, const BedGuess& bed, std::int64_t count, double dt,
                                           double particle_steps_per_second) {
  // Guesses that fit own runs of the shipped cases within a third: at 40 kPa a plate leaves a porosity of 0.37 behind, more where
  // the bed was loose, at other stresses in proportion; a fifth of that way comes back; a bed fails or gives up at about 12 % strain.
  const double pressed = 0.37 + 0.25 * (bed.porosity - 0.42);
  const double by_pressing = std::max(0.02, 1.0 - (1.0 - bed.porosity) / (1.0 - pressed)), by_unloading = 0.2 * by_pressing;
  constexpr double by_crushing = 0.12, to_land = 0.15, guessed_at = 40e3;  // [Pa]
  const auto to_rest = [](const StageSpec& s) { return 0.1 + 4.0 * s.until.window; };
  // Falling spheres have few contacts.
  constexpr double cost_of_rain = 0.8;
  double height = bed.height, plate = std::max(c.box.height, bed.height);
  double pressed_by = 0.0;  // strain of the load steps so far
  std::vector<ExpectedStage> stages;
  for (const StageSpec& s : c.stages) {
    ExpectedStage e{s.name, s.kind, 0.0, 0.0, 0.0};
    double cost = 1.0;
    // How far the plate goes until the strain that ends the stage, through empty space first.
    const auto press = [&](double strain) {
      const double empty = s.start_gap ? std::min(*s.start_gap, plate - height) : plate - height;
      double way = std::max(0.0, empty) + strain * height;
      height *= 1.0 - strain;
      if (s.until.displacement) way = std::min(way, *s.until.displacement);
      plate = height;
      return way / s.speed;
    };
    switch (s.kind) {
      case StageKind::fill: {
        const double v = s.drop_speed;
        const double fall = std::max(0.0, s.duration ? outlet_of(c) - bed.height : bed.rain_height - 0.5 * bed.height);
        e.simulated = s.method == FillMethod::grow ? 0.0 : s.duration.value_or(0.0) + (std::sqrt(v * v + 2.0 * c.gravity * fall) - v) / c.gravity + to_land;
        cost = cost_of_rain;
        break;
      }
      case StageKind::settle: e.simulated = to_rest(s); break;
      case StageKind::release: e.simulated = to_rest(s), plate = height + 1e-3; break;
      case StageKind::compress: {
        const double at_stress = by_pressing * std::clamp(s.until.stress.value_or(guessed_at) / guessed_at, 0.05, 2.0);
        const double strain = std::max(pressed_by, std::min({at_stress, s.until.strain.value_or(at_stress), 0.5}));
        e.simulated = press(strain - pressed_by);
        pressed_by = strain;
        break;
      }
      case StageKind::crush: e.simulated = press(std::min(by_crushing, s.until.strain.value_or(by_crushing))); break;
      case StageKind::unload:
        e.simulated = std::min(by_unloading * height, s.until.displacement.value_or(by_unloading * height)) / s.speed;
        break;
      case StageKind::vibrate:
      case StageKind::hold:
      case StageKind::run: e.simulated = s.duration.value_or(0.0); break;
    }
    if (s.until.duration) e.simulated = std::min(e.simulated, *s.until.duration);
    e.needed = e.simulated;
    e.simulated = std::min(e.simulated, s.max_duration);
    e.wall = cost * e.simulated / dt * static_cast<double>(count) / particle_steps_per_second;
    stages.push_back(e);
  }
  return stages;
}

double expected_particle_steps(const Case& c) {
  const SphereFacts f = sphere_facts(c);
  double sum = 0.0;
  for (const ExpectedStage& s : expected_stages(c, guess_bed(c, f).value_or(BedGuess{}), f.count, first_step(c).dt, 1.0)) sum += s.wall;
  return sum;
}

}  // namespace platen
