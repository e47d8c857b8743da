// Beds of platen's own making that the benches run on, and the scenes that are run on them.
//
// Dense: spheres of R = 2.5 mm between two plates, periodic sides, about 6.25 contacts a sphere (Z): spheres grown to a
// porosity of 0.4 (protocol/stages/grow.h), pressed together evenly in small steps with frictionless contacts until Z is
// there, then left to rest with the full law. Larger beds are tiles of a smaller one, left to rest again.
// Rain: a gas of solid fraction 0.25 that falls with 1 m/s, up to 0.3 m/s of random velocity (even) per component.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/simulation.h"

namespace platen::bench {

struct Bed {
  double R = 0.0;                                 // [m]
  double density = 0.0;                           // [kg/m3]
  double width = 0.0, depth = 0.0, height = 0.0;  // periodic lengths, gap between the plates [m]
  std::vector<double> position, velocity, spin;   // N x 3 [m, m/s, rad/s]
  std::size_t size() const { return position.size() / 3; }
};

inline constexpr double bench_radius = 2.5e-3;   // [m]
inline constexpr double bench_density = 2000.0;  // [kg/m3]
inline constexpr double bench_step_size = 1e-5;  // dt [s]

// EEPA, n = 1, everything in use: k1 5 kN/m, k2 25 kN/m, k_adh 1 kN/m, f0 -0.02 N, mu 0.5, mu_r 0.001, e 0.4.
PairLaw full_law();
// Linear spring, history and friction only: the law of LAMMPS' gran/hooke/history.
PairLaw linear_law();

// Makes a bed or takes it from `cache` (a folder, made if need be). Sizes: 5000, 35000, 280000 (8 tiles of 35000),
// 1000000 (32 of 31250), or any other below 50000. Progress goes to standard error.
Bed dense_bed(std::int64_t particles, const std::filesystem::path& cache);
Bed rain_bed(std::int64_t particles, const std::filesystem::path& cache);

// What is run on a bed.
struct BenchScene {
  std::string name;
  PairLaw law;
  PlateLaw plate;
  double spread = 0.0;  // of radii: (1 - spread) R to R
  bool plates = true;   // bottom and top plate, the top one moving down with 10 mm/s
  bool top = true;      // false: no top plate (rain)
  bool walls = false;   // rigid walls one radius outside the periodic box
  bool periodic = true;
  bool energy = true;
  bool reproducible = false;
  double gravity = 9.81;
};

std::vector<BenchScene> bench_scenes();
// Throws std::invalid_argument with the known names.
BenchScene bench_scene(const std::string& name);

struct BenchEngine {
  InstructionSet set = InstructionSet::scalar;
  int threads = 1;
  int batch = 0;                 // particles; 0 = chosen, here and below
  double skin = 0.0, gap = 0.0;  // [m]
  double cache = 0.0;            // that the order of a large bed's tasks counts on [bytes]; 0: chosen
  int unroll = 0;                // most steps between two looks at the lists
  Executor executor = Executor::automatic;
  bool fused = false;  // one task per batch and step
};

// A Simulation ready to advance, with dt and planes set, as `platen run` sets them up.
std::unique_ptr<Simulation> make_simulation(const Bed& bed, const BenchScene& scene, const BenchEngine& engine);

// LAMMPS data file (atom_style sphere; LIGGGHTS' granular style reads the same columns): id type diameter density x y z
// and velocities. The box is periodic in x and y and ends at the plates.
void write_lammps(const Bed& bed, const std::filesystem::path& file);
// particles.csv of a case (`particles.file`).
void write_particles(const Bed& bed, const std::filesystem::path& file);

}  // namespace platen::bench
