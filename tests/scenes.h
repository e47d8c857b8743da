// Small beds that tests and benches share.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "core/simulation.h"

namespace platen::scenes {

// A specified sequence in [0, 1), independent of the program's own generator.
class Sequence {
 public:
  explicit Sequence(std::uint64_t seed) : state_(seed * 0x9e3779b97f4a7c15ULL + 0x1234567) {}
  double next() {
    state_ ^= state_ << 13, state_ ^= state_ >> 7, state_ ^= state_ << 17;
    return static_cast<double>(state_ >> 11) * 0x1p-53;
  }
  double between(double a, double b) { return a + (b - a) * next(); }

 private:
  std::uint64_t state_;
};

struct BedOptions {
  int nx = 4, ny = 4, nz = 4;    // spheres on a jittered grid
  double R = 0.0025;             // [m]
  double spread = 0.0;           // radii between (1 - spread) R and R
  double speed = 0.2;            // random velocities up to this [m/s]
  double spacing = 1.9;          // grid spacing over R: below 2 starts overlapping
  std::uint64_t seed = 1;
  bool periodic = true;
};

inline PairLaw full_law() {
  PairLaw law;
  law.k1 = 5e3, law.k2 = 2.5e4, law.k_adh = 2e3, law.f0 = -0.02;
  law.restitution = 0.4, law.friction = 0.5, law.rolling_friction = 0.01;
  return law;
}

// Spheres on a jittered grid in a box periodic in x and y, between a bottom plate at 0 and a top plate.
inline SimulationSetup bed(const BedOptions& o, const PairLaw& law, const EngineOptions& engine) {
  SimulationSetup setup;
  setup.pair = law;
  setup.engine = engine;
  Sequence random(o.seed);
  const double a = o.spacing * o.R;
  setup.width = o.nx * a, setup.depth = o.ny * a;
  setup.periodic = o.periodic;
  std::int64_t id = 0;
  for (int k = 0; k < o.nz; ++k)
    for (int j = 0; j < o.ny; ++j)
      for (int i = 0; i < o.nx; ++i) {
        const double jitter = 0.05 * o.R;
        setup.spheres.id.push_back(10 + 3 * id++);
        for (const int cell : {i, j, k})
          setup.spheres.position.push_back((cell + 0.5) * a + random.between(-jitter, jitter));
        for (int axis = 0; axis < 3; ++axis) setup.spheres.velocity.push_back(random.between(-o.speed, o.speed));
        for (int axis = 0; axis < 3; ++axis) setup.spheres.spin.push_back(random.between(-o.speed, o.speed) / o.R);
        setup.spheres.radius.push_back(o.R * (1.0 - o.spread * random.next()));
        setup.spheres.density.push_back(2000.0);
      }
  return setup;
}

// Laws that need what a built scene offers, with every branch in use by spheres that collide at some 0.1 m/s.
struct LawCase {
  const char* name;
  PairLaw law;
  double spread;  // of radii, BedOptions::spread
  int scene;      // that was made for it, a number of built_scenes
};

inline int scene_number(const char* name) {
  for (std::size_t k = 0; k < built_scenes.size(); ++k)
    if (std::strcmp(built_scenes[k].name, name) == 0) return static_cast<int>(k);
  throw std::invalid_argument(name);
}

inline std::vector<LawCase> laws_of_scenes() {
  const PairLaw full = full_law();
  PairLaw elastic = full;
  elastic.k2 = elastic.k1, elastic.k_adh = elastic.f0 = elastic.rolling_friction = 0.0;
  PairLaw cohesionless = full;
  cohesionless.k_adh = cohesionless.f0 = 0.0;
  PairLaw hertzian = full;
  hertzian.exponent = 1.5, hertzian.k1 = 5e5, hertzian.k2 = 2e6, hertzian.k_adh = 2e5;
  PairLaw soft = full;
  soft.exponent = 0.8, soft.k1 = 1e3, soft.k2 = 4e3, soft.k_adh = 500;
  PairLaw square = full;
  square.exponent = 2.0, square.k1 = 5e7, square.k2 = 2e8, square.k_adh = 2e7;
  square.rolling_model = RollingModel::relative, square.rolling_friction = 0.05;
  return {{"elastic", elastic, 0.0, scene_number("elastic")},
          {"cohesionless", cohesionless, 0.0, scene_number("cohesionless")},
          {"full", full, 0.0, scene_number("full")},
          {"full, unequal", full, 0.4, scene_number("full_wide")},
          {"n = 3/2", hertzian, 0.4, scene_number("three_halves")},
          {"n = 0.8", soft, 0.4, scene_number("any_exponent")},
          {"n = 2, relative rolling", square, 0.4, scene_number("relative_rolling")}};
}

// Top of the grid of a bed.
inline double height_of(const BedOptions& o) { return o.nz * o.spacing * o.R; }

inline void add_plates(Simulation& sim, double z_top, double top_velocity) {
  PlaneMotion bottom, top;
  top.origin = z_top, top.velocity = top_velocity;
  sim.set_plane(plate_bottom, bottom);
  sim.set_plane(plate_top, top);
}

}  // namespace platen::scenes
