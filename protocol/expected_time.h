// How long a run will take on this machine: a short measurement of the engine, times a guess of what the stages do.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "protocol/case_file.h"
#include "protocol/sphere_facts.h"

namespace platen {

struct EngineSpeed {
  double particle_steps_per_second = 0.0;  // dense bed of the case's spheres and law; 0 where that bed fails
  std::string scene;                       // kernels that the engine chose
  std::string instruction_set;
  int threads = 1;                         // in use
};

// Runs a made-up dense bed (as many spheres as `count`, up to 40,000, on a shaken cubic lattice between two plates) for
// about 0.3 s of wall time with steps of `dt` [s]. `equal`: one radius and one mass. The number of spheres in the case
// enters through a measured law for the caches.
EngineSpeed measure_speed(const Case& c, std::int64_t count, bool equal, double dt, int threads);

// What the guess starts from.
struct BedGuess {
  double rain_height = 0.0;  // of the gas that rains down [m]
  double height = 0.0;       // of the settled bed [m]
  double porosity = 0.42;    // of the settled bed
};

// None without a box.
std::optional<BedGuess> guess_bed(const Case& c, const SphereFacts& spheres);

struct ExpectedStage {
  std::string name;
  StageKind kind = StageKind::run;
  double simulated = 0.0;  // [s]
  double needed = 0.0;     // the same if it had all the time that it needs: more than max_duration is a goal missed [s]
  double wall = 0.0;       // [s]
};

std::vector<ExpectedStage> expected_stages(const Case& c, const BedGuess& bed, std::int64_t count, double dt,
                                           double particle_steps_per_second);

// Of all stages, a guess; rain counts less per step than a dense bed.
double expected_particle_steps(const Case& c);

}  // namespace platen
