#include "bench/beds.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "protocol/stages/grow.h"
#include "protocol/stages/rain.h"

namespace platen::bench {

namespace {

constexpr int bed_version = 2;            // of the recipe: part of the names in the cache
constexpr double wanted_contacts = 6.18;  // Z while settling; rest and load by the plate bring it to 6.2-6.3

void say(const std::string& text) { fmt::print(stderr, "  bed: {}\n", text); }

// Velocities die out: no friction, strong dashpots.
PairLaw settling_law() {
  PairLaw law = linear_law();
  law.friction = 0.0, law.restitution = 0.05;
  return law;
}

Bed taken_from(Simulation& sim, Bed bed) {
  const Snapshot state = sim.snapshot(false);
  bed.position = state.particles.position;
  bed.velocity = state.particles.velocity;
  bed.spin = state.particles.angular_velocity;
  return bed;
}

Bed at_rest(Bed bed) {
  bed.velocity.assign(bed.position.size(), 0.0);
  bed.spin.assign(bed.position.size(), 0.0);
  return bed;
}

// The bed after some steps of a law between plates that stand still; `contacts` becomes its Z.
Bed rested(const Bed& bed, const PairLaw& law, int steps, double* contacts = nullptr) {
  BenchScene scene;
  scene.law = law;
  scene.gravity = 0.0, scene.energy = false;
  BenchEngine engine;
  engine.set = available_instruction_sets().back();
  engine.threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));  // changes no bit of the bed
  const auto sim = make_simulation(bed, scene, engine);
  sim->set_plane_velocity(plate_top, 0.0);
  sim->advance(steps);
  if (contacts != nullptr) *contacts = sim->measure(false).coordination_number;
  return taken_from(*sim, bed);
}

void shrink(Bed& bed, double factor) {
  for (double& x : bed.position) x *= factor;
  bed.width *= factor, bed.depth *= factor, bed.height *= factor;
}

Bed packed(std::int64_t particles) {
  Bed bed;
  bed.R = bench_radius, bed.density = bench_density;
  const double porosity = 0.40, solid = static_cast<double>(particles) * sphere_mass(bed.R, 1.0);
  // A square base and a height of about its side.
  bed.width = bed.depth = std::cbrt(solid / (1.0 - porosity));
  RandomSource random(20160501);
  say(fmt::format("{} spheres, growing", particles));
  GrownBed grown = grow_bed(std::vector<double>(static_cast<std::size_t>(particles), bed.R), bed.width, bed.depth, true,
                            porosity, random);
  if (!grown.reached) throw std::runtime_error("the bench's bed could not be grown");
  bed.position = std::move(grown.position);
  bed.height = grown.height;
  bed = at_rest(std::move(bed));
  double contacts = 0.0;
  for (int round = 0; round < 200; ++round) {
    // Coarse while far from touching everywhere, fine near the goal.
    shrink(bed, contacts < 4.0 ? 1.0 - 2e-3 : contacts < 5.8 ? 1.0 - 1e-3 : 1.0 - 2.5e-4);
    bed = rested(bed, settling_law(), 150, &contacts);
    if (contacts < wanted_contacts) continue;
    bed = rested(at_rest(std::move(bed)), settling_law(), 600, &contacts);
    if (contacts >= wanted_contacts - 0.05) break;
  }
  bed = rested(at_rest(std::move(bed)), full_law(), 1000, &contacts);
  const double porosity_now = 1.0 - solid / (bed.width * bed.depth * bed.height);
  say(fmt::format("Z = {:.2f} at a porosity of {:.4f}", contacts, porosity_now));
  return at_rest(std::move(bed));
}

Bed tiled(const Bed& tile, int nx, int ny) {
  Bed bed = tile;
  bed.width *= nx, bed.depth *= ny;
  bed.position.clear();
  for (int b = 0; b < ny; ++b)
    for (int a = 0; a < nx; ++a)
      for (std::size_t k = 0; k < tile.position.size(); k += 3) {
        bed.position.push_back(tile.position[k] + a * tile.width);
        bed.position.push_back(tile.position[k + 1] + b * tile.depth);
        bed.position.push_back(tile.position[k + 2]);
      }
  // A push of a thousandth of the radius makes the copies differ; the steps that follow let them rest again.
  RandomSource random(5);
  for (double& x : bed.position) x += 1e-3 * bed.R * (random.uniform() - 0.5);
  bed = at_rest(std::move(bed));
  double contacts = 0.0;
  bed = rested(bed, full_law(), 400, &contacts);
  say(fmt::format("{} spheres in {} x {} tiles, Z = {:.2f}", bed.size(), nx, ny, contacts));
  return at_rest(std::move(bed));
}

// A cache file: seven numbers, then positions, velocities and spins, all doubles of this machine.
bool read_cached(const std::filesystem::path& file, Bed& bed) {
  std::ifstream in(file, std::ios::binary);
  double head[7];
  if (!in.read(reinterpret_cast<char*>(head), sizeof head)) return false;
  const auto n = static_cast<std::size_t>(head[0]);
  if (std::filesystem::file_size(file) != sizeof head + 9 * n * sizeof(double)) return false;
  bed.R = head[1], bed.density = head[2], bed.width = head[3], bed.depth = head[4], bed.height = head[5];
  for (auto* column : {&bed.position, &bed.velocity, &bed.spin}) {
    column->resize(3 * n);
    in.read(reinterpret_cast<char*>(column->data()), static_cast<std::streamsize>(3 * n * sizeof(double)));
  }
  return static_cast<bool>(in);
}

void write_cached(const std::filesystem::path& file, const Bed& bed) {
  const std::filesystem::path part = file.string() + ".part";
  {
    std::ofstream out(part, std::ios::binary);
    const double head[7] = {static_cast<double>(bed.size()), bed.R, bed.density, bed.width, bed.depth, bed.height, 0.0};
    out.write(reinterpret_cast<const char*>(head), sizeof head);
    for (const auto* column : {&bed.position, &bed.velocity, &bed.spin})
      out.write(reinterpret_cast<const char*>(column->data()),
                static_cast<std::streamsize>(column->size() * sizeof(double)));
    if (!out.flush()) throw std::runtime_error("cannot write " + part.string());
  }
  std::filesystem::rename(part, file);  // whole or not at all
}

template <class Make>
Bed cached(const std::string& name, const std::filesystem::path& cache, const Make& make) {
  std::filesystem::create_directories(cache);
  const std::filesystem::path file = cache / fmt::format("{}-v{}.bed", name, bed_version);
  Bed bed;
  if (read_cached(file, bed)) return bed;
  bed = make();
  write_cached(file, bed);
  return bed;
}

}  // namespace

Bed dense_bed(std::int64_t particles, const std::filesystem::path& cache) {
  return cached(fmt::format("dense-{}", particles), cache, [&] {
    if (particles == 280000) return tiled(dense_bed(35000, cache), 4, 2);
    if (particles == 1000000) return tiled(dense_bed(31250, cache), 8, 4);
    if (particles < 100 || particles > 50000)
      throw std::invalid_argument("dense beds have 280000, 1000000, or 100 to 50000 particles");
    return packed(particles);
  });
}

Bed rain_bed(std::int64_t particles, const std::filesystem::path& cache) {
  return cached(fmt::format("rain-{}", particles), cache, [&] {
    Bed bed;
    bed.R = bench_radius, bed.density = bench_density;
    bed.width = 0.15, bed.depth = 0.05;
    RandomSource random(20160502);
    bed.position = rain_positions(std::vector<double>(static_cast<std::size_t>(particles), bed.R), bed.width, bed.depth,
                                  true, 0.0, 0.25, random);
    for (std::size_t k = 0; k < bed.position.size(); ++k) {
      bed.velocity.push_back((k % 3 == 2 ? -1.0 : 0.0) + 0.3 * (2.0 * random.uniform() - 1.0));
      if (k % 3 == 2) bed.height = std::max(bed.height, bed.position[k] + 2.0 * bed.R);
    }
    bed.spin.assign(bed.position.size(), 0.0);
    return bed;
  });
}

void write_lammps(const Bed& bed, const std::filesystem::path& file) {
  std::ofstream out(file);
  out << fmt::format(
      "bed of a platen bench\n\n{} atoms\n1 atom types\n\n0 {:.17g} xlo xhi\n0 {:.17g} ylo yhi\n"
      "0 {:.17g} zlo zhi\n\nAtoms\n\n",
      bed.size(), bed.width, bed.depth, bed.height);
  for (std::size_t k = 0; k < bed.size(); ++k) {
    const double* x = &bed.position[3 * k];
    out << fmt::format("{} 1 {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n", k + 1, 2.0 * bed.R, bed.density, x[0], x[1],
                       x[2]);
  }
  out << "\nVelocities\n\n";
  for (std::size_t k = 0; k < bed.size(); ++k) {
    const double *v = &bed.velocity[3 * k], *w = &bed.spin[3 * k];
    out << fmt::format("{} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n", k + 1, v[0], v[1], v[2], w[0], w[1],
                       w[2]);
  }
  if (!out.flush()) throw std::runtime_error("cannot write " + file.string());
}

void write_particles(const Bed& bed, const std::filesystem::path& file) {
  std::ofstream out(file);
  out << "id,x,y,z,radius,vx,vy,vz,wx,wy,wz\n";
  for (std::size_t k = 0; k < bed.size(); ++k) {
    const double *x = &bed.position[3 * k], *v = &bed.velocity[3 * k], *w = &bed.spin[3 * k];
    out << fmt::format("{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", k, x[0],
                       x[1], x[2], bed.R, v[0], v[1], v[2], w[0], w[1], w[2]);
  }
  if (!out.flush()) throw std::runtime_error("cannot write " + file.string());
}

}  // namespace platen::bench
