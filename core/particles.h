// The state of the spheres: a structure of arrays along a Morton curve [docs/architecture.md, "Data"].
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "core/aligned.h"
#include "core/ids.h"
#include "core/parallel_for.h"

namespace platen {

inline constexpr int most_steps_of_run = std::numeric_limits<std::int8_t>::max();  // a sphere goes through a side at most once a step

struct Particles {
  std::int32_t count = 0;   // N
  std::int32_t padded = 0;  // N rounded up to whole vectors; the rest rests at the origin and touches nothing
  bool equal = true;        // one radius and one mass: no columns for them

  // What a step needs. While a large bed makes a run of steps the rows alone hold the state, and the first nine columns what the run goes
  // back to.
  AlignedArray<double> x, y, z;     // [m], wrapped into a periodic box
  AlignedArray<double> vx, vy, vz;  // half-step velocity [m/s]
  AlignedArray<double> ux, uy, uz;  // R omega at the half step [m/s]
  AlignedArray<double> radius, inverse_radius, mass, inverse_mass;  // [m, 1/m, kg, 1/kg]; empty where equal
  AlignedArray<double> rows;        // copies in the shape that contacts fetch, kernels/views.h
  double common_radius = 0.0, common_mass = 0.0;

  // What it does not.
  std::vector<std::int32_t> rank;   // place of each particle in the order of ids
  Ids id_of_rank;
  // Box lengths left behind in x and y, 2 per particle: until the last run of steps began, and since then. A run of at most
  // most_steps_of_run goes back to where it began by forgetting the latter.
  AlignedArray<std::int32_t> image;
  AlignedArray<std::int8_t> crossed;
  std::int32_t boxes(std::size_t p, std::size_t axis) const { return image[2 * p + axis] + crossed[2 * p + axis]; }
  void keep_crossings(std::int32_t first, std::int32_t spheres);  // nobody goes back behind them any more

  double radius_of(std::int32_t p) const { return equal ? common_radius : radius[static_cast<std::size_t>(p)]; }
  double mass_of(std::int32_t p) const { return equal ? common_mass : mass[static_cast<std::size_t>(p)]; }

  std::vector<std::int32_t> places() const;  // where the particle of each rank stands now

  void resize(std::int32_t n, bool equal_spheres);
  void permute(const std::vector<std::int32_t>& order, const ParallelFor& parallel = in_turn);  // order[new place] = old place
  void write_rows(const ParallelFor& parallel = in_turn);  // rows from the arrays
};

// Mass of a sphere, 4/3 pi R^3 rho [kg].
double sphere_mass(double R, double rho);

}  // namespace platen
