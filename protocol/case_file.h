// The case: everything a run needs to know, read from a TOML file (docs/case_file.md), SI units throughout.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "kernels/law_parameters.h"

namespace platen {

enum class Sides { periodic, walls, open };

struct SizeDistribution {
  enum class Kind { mono, lognormal, normal, uniform, list, cumulative };
  enum class Basis { number, volume };
  Kind kind = Kind::mono;
  Basis basis = Basis::number;  // what the distribution is one of: how many spheres, or how much of the solid
  double radius = 0.0;          // mono [m]
  double median = 0.0;          // lognormal: median; normal: mean [m]
  double sigma = 0.0;           // lognormal: of ln R [-]; normal: of R [m]
  double min = 0.0, max = 0.0;  // truncation (uniform: the range) [m]
  std::vector<double> radii;    // list; cumulative, ascending [m]
  std::vector<double> weights;  // list: relative numbers or volumes, same length as radii; empty = equal
  std::vector<double> below;    // cumulative: what part is below each of the radii; straight in between [-]
  double largest() const;       // largest radius that can occur [m]
  double smallest() const;      // smallest radius that can occur [m]
  bool operator==(const SizeDistribution&) const = default;
};

// Explicit particles, one entry each. Velocities are those at t = 0.
struct ParticleTable {
  std::vector<std::int64_t> id;
  std::vector<double> x, y, z;     // [m]
  std::vector<double> radius;      // [m]
  std::vector<double> vx, vy, vz;  // [m/s]
  std::vector<double> wx, wy, wz;  // [rad/s]
  std::vector<double> density;     // [kg/m3]
  std::size_t size() const { return x.size(); }
};

struct ParticleSpec {
  SizeDistribution sizes;
  double density = 0.0;              // [kg/m3]
  std::int64_t count = 0;
  std::string file;                  // as written in the case; empty: particles are made by `fill`
  std::optional<ParticleTable> table;  // contents of `file`
  PairLaw law;
  std::vector<std::pair<std::string, std::string>> law_origins;  // key and formula of what material data gave
};

struct PlateSpec {
  bool top = true;
  bool bottom = true;
  PlateLaw law;
  bool operator==(const PlateSpec&) const = default;
};

struct BoxSpec {
  bool given = false;  // [box] may be left out when sides are open and no plate is present
  double width = 0.0;  // x [m]
  double depth = 0.0;  // y [m]
  double height = 0.0; // gap between the plates at the start [m]
  Sides sides = Sides::periodic;
  bool operator==(const BoxSpec&) const = default;
};

struct TimeSpec {
  std::optional<double> step;  // fixed step [s]; empty = "auto"
  std::string step_where;      // file:line:column of a fixed step, for messages
  double safety = 0.3;  // justified in docs/accuracy.md
  bool allow_unstable = false;
};

struct OutputSpec {
  double series = 1e-3;           // [s]
  std::optional<double> frames;   // [s]; empty = "off"
  bool contacts = true;
  double checkpoint = 60.0;       // wall clock [s]; 0 = "off"
  int slabs = 12;
  bool energy = true;
};

struct EngineSpec {
  std::optional<double> skin;       // [m]; empty = "auto"
  std::optional<double> inner_gap;  // [m]; empty = "auto"
  std::optional<int> batch;         // particles; empty = "auto"
  int check_every = 32;             // steps
  bool operator==(const EngineSpec&) const = default;
};

enum class StageKind { fill, vibrate, settle, compress, unload, hold, release, crush, run };
enum class FillMethod { rain, grow };

// Goals of a stage; which keys are legal depends on the kind (docs/case_file.md).
struct Until {
  std::optional<double> stress;        // [Pa]
  std::optional<double> strain;        // [-]
  std::optional<double> porosity;      // [-]
  std::optional<double> displacement;  // [m]
  std::optional<double> duration;      // [s]
  std::optional<double> drop;          // [-] fraction below the peak stress
  double kinetic_to_potential = 1e-5;  // [-]   settle, release
  double coordination_change = 0.005;  // [-]   settle, release
  double window = 0.1;                 // [s]   settle, release
  bool operator==(const Until&) const = default;
};

struct StageSpec {
  StageKind kind = StageKind::run;
  std::string name;                    // unique; default: the kind, numbered when repeated (compress, compress-2)
  double max_duration = 60.0;          // simulated [s]
  std::optional<double> frames;        // overrides output.frames [s]; 0 = off
  FillMethod method = FillMethod::rain;
  double drop_speed = 0.5;             // fill by rain: downward [m/s]
  std::optional<double> outlet;        // fill by rain with a duration: height that spheres fall from [m]
  std::optional<double> porosity;      // fill by growth: target [-]
  double frequency = 0.0;              // vibrate [Hz]
  double amplitude = 0.0;              // vibrate, peak to mean [m]
  std::optional<double> duration;      // vibrate, hold, run; fill by rain: how long it rains [s]
  double speed = 0.0;                  // compress, unload, crush [m/s] > 0
  Until until;
  double strain_zero = 0.0;            // stress at which strain starts to count [Pa]; compress 5 kPa, crush 20 Pa
  bool own_strain_zero = false;        // compress: given, so strain counts anew after an earlier compression
  std::optional<double> start_gap;     // compress, crush [m]
  double stress = 0.0;                 // hold [Pa]
  bool operator==(const StageSpec&) const = default;
};

struct Case {
  std::string title;
  std::uint64_t seed = 1;
  ParticleSpec particles;
  PlateSpec plates;
  BoxSpec box;
  double gravity = 9.81;  // along -z [m/s2]
  TimeSpec time;
  OutputSpec output;
  EngineSpec engine;
  std::vector<StageSpec> stages;

  std::string text;             // the exact case as TOML with overrides applied; written to case.toml of the run folder
  std::filesystem::path file;   // where it was read from
};

// One or more things wrong with a case file. what() holds all of them, one a line, each as
// `file:line:column: key: what is wrong; what is allowed; nearest known key`.
class CaseError : public std::runtime_error {
 public:
  explicit CaseError(const std::string& messages) : std::runtime_error(messages) {}
};

enum class CaseUse {
  run,      // everything must be there and consistent
  resume,   // as run, but the particle file is not read: the particles are in the checkpoint
  law_only  // only [particles.law] and, if wanted, [plates] need to be there (platen law)
};

// Reads, checks and converts a case file. `overrides` are KEY.PATH=VALUE with TOML values; stages by name or by number
// from 1 (stage.compress.speed="20 mm/s"). Particle files are looked for relative to the case file.
// Throws CaseError with every semantic error at once.
Case read_case(const std::filesystem::path& file, const std::vector<std::string>& overrides = {},
               CaseUse use = CaseUse::run);

// The same from a text; `name` stands in messages instead of the file, `folder` is where particle files are looked for.
Case parse_case(const std::string& text, const std::string& name, const std::filesystem::path& folder,
                const std::vector<std::string>& overrides = {}, CaseUse use = CaseUse::run);

const char* to_string(StageKind kind);
const char* to_string(Sides sides);

}  // namespace platen
