// What a bed says under compression and crushing, over the step and the speed of the plates.
//
// Every seed gives one settled bed (made with a small step). Each variant starts from that same bed, so that differences
// are taken in pairs: variant minus reference of the same seed, mean and standard error over seeds. The scatter between
// seeds is the yardstick: below it, more precision buys nothing.
#pragma once

#include <cmath>
#include <filesystem>
#include <map>

#include "bench/accuracy/processes.h"
#include "protocol/output/hdf5_file.h"

namespace platen::bench {

constexpr double scale_radius = 3.75e-3;  // of all parts but the particle scale [m]

struct BulkCase {
  std::string name;
  double f0 = 0.0, k_adh = 0.0;            // at scale_radius [N, N/m]
  bool vibrate = false, crush = true;
};

// Case I, II or III of [Thakur2016].
inline BulkCase bulk_case(const std::string& name) {
  if (name == "I") return {name, 0.0, 0.0, true, false};
  if (name == "II") return {name, -0.9, 0.0, false, true};
  if (name == "III") return {name, 0.0, 7500.0, false, true};
  throw std::invalid_argument("no case " + name + "; there are I, II, III");
}

struct BulkSize {
  int count = 1700;            // at scale_radius
  double side = 0.05;          // of the square box [m]
  double speed = 0.01;         // of plates in all parts but their speed [m/s]
  double stress = 40e3;        // [Pa]
  int seeds = 8, scale_seeds = 3;
  std::vector<double> shares;  // steps, of dt_crit, smallest first: that is the reference
  std::vector<double> safeties;  // of the automatic step
  std::vector<double> speeds;  // [m/s], slowest first: the reference
  std::vector<double> radii;   // [m], finest first: the reference
  double safety = 0.3;         // of the automatic step, in all parts but the two on steps
  double bed_share = 0.1;        // step of the beds at scale_radius, of dt_crit; at other radii that of the runs (0.3)
  double vibration = 1.0;        // [s]
  bool strict = true;          // settle by the experiment's own criterion
};

inline BulkSize bulk_size(bool quick) {
  BulkSize s;
  s.shares = {0.0625, 0.125, 0.2, 0.3, 0.4, 0.5, 0.6, 0.75, 0.9};
  s.safeties = {0.2, 0.3, 0.4, 0.5};
  s.speeds = {0.0025, 0.005, 0.01, 0.02, 0.04, 0.08};
  s.radii = {2e-3, 2.5e-3, 3e-3, 3.75e-3, 5e-3};
  if (!quick) return s;
  s.count = 140, s.side = 0.02, s.speed = 0.2, s.stress = 20e3, s.seeds = 3, s.scale_seeds = 2;
  s.shares = {0.1, 0.2, 0.4}, s.safeties = {0.2, 0.4}, s.speeds = {0.1, 0.4}, s.radii = {3e-3, 3.75e-3};
  s.bed_share = 0.2, s.vibration = 0.05, s.strict = false;
  return s;
}

// One run of the bed: everything that the parts of the measurement change.
struct Setting {
  std::string part, name;      // "step", "speed", "same", "scale"; the name begins the run folder's
  double value = 0.0;          // of what the part varies
  double share = 0.0, speed = 0.0, radius = scale_radius;
  double skin = 0.0;           // 0: chosen by the engine [m]
  bool automatic = false;      // share is the safety of step = "auto"
  bool reproducible = false;
  int seeds = 0;
};

inline int count_of(const BulkSize& s, double radius) { return static_cast<int>(std::lround(s.count * std::pow(scale_radius / radius, 3))); }

// `step`: the lines of [time].
inline std::string bulk_text(const BulkCase& b, const BulkSize& s, int seed, double radius, const std::string& step, const std::string& particles, double skin = 0.0) {
  const double scale = radius / scale_radius;
  const double volume = s.count * 4.0 / 3.0 * 3.14159265358979 * std::pow(scale_radius, 3);
  return fmt::format(
             "[case]\ntitle = \"accuracy, case {}\"\nseed = {}\n[particles]\ndensity = 2000.0\nradius = {}\n{}[particles.law]\n"
             "k1 = {}\nk2 = {}\nk_adh = {}\nf0 = {}\nrestitution = 0.4\nfriction = 0.5\nrolling_friction = 0.001\n",
             b.name, seed, radius, particles, 7500.0 * scale, 37500.0 * scale, b.k_adh * scale, b.f0 * scale * scale) +
         fmt::format("[box]\nwidth = {}\ndepth = {}\nheight = {}\n[time]\n{}\n[output]\nseries = 5e-3\nframes = \"off\"\ncontacts = false\n",
                     s.side, s.side, 1.2 * volume / (0.5 * s.side * s.side), step) +
         (skin > 0.0 ? fmt::format("[engine]\nskin = {}\n", skin) : "");
}

inline std::string settle_text(bool strict) {
  return strict ? "[[stage]]\nkind = \"settle\"\n" : "[[stage]]\nkind = \"settle\"\nuntil = { kinetic_to_potential = 1e-4, window = \"20 ms\" }\n";
}

inline std::string bed_name(double radius, int seed) {
  return radius == scale_radius ? fmt::format("bed-{}", seed) : fmt::format("bed-{:g}mm-{}", 1e3 * radius, seed);
}

// A share of dt_crit, which is given at scale_radius and grows with R when the stiffness does.
inline std::string fixed_step(double share, double dt_crit, double radius) { return fmt::format("step = {}", share * dt_crit * radius / scale_radius); }

inline Job bed_job(const BulkCase& b, const BulkSize& s, int seed, double radius, double dt_crit) {
  // Beds of other sizes are compared by their means alone, so they need no finer step than the runs; they are what costs most.
  const double share = radius == scale_radius ? s.bed_share : s.safety;
  std::string text = bulk_text(b, s, seed, radius, fixed_step(share, dt_crit, radius), fmt::format("count = {}\n", count_of(s, radius)));
  text += "[[stage]]\nkind = \"fill\"\n";
  if (b.vibrate) text += fmt::format("[[stage]]\nkind = \"vibrate\"\nfrequency = 60.0\namplitude = 1.5e-3\nduration = {}\n", s.vibration);
  return {bed_name(radius, seed), text + settle_text(s.strict)};
}

inline Job variant_job(const BulkCase& b, const BulkSize& s, int seed, const Setting& v, double dt_crit) {
  std::string text = bulk_text(b, s, seed, v.radius, v.automatic ? fmt::format("step = \"auto\"\nsafety = {}", v.share) : fixed_step(v.share, dt_crit, v.radius), fmt::format("file = \"{}.csv\"\n", bed_name(v.radius, seed)), v.skin);
  text += settle_text(s.strict);
  text += fmt::format("[[stage]]\nkind = \"compress\"\nspeed = {}\nstart_gap = 1e-4\nuntil = {{ stress = {} }}\n", v.speed, s.stress);
  if (b.crush)
    text += fmt::format("[[stage]]\nkind = \"unload\"\nspeed = {}\n[[stage]]\nkind = \"release\"\n{}"
                        "[[stage]]\nkind = \"crush\"\nspeed = {}\nstart_gap = 1e-4\nuntil = {{ strain = 0.2, drop = 0.2 }}\n",
                        v.speed, s.strict ? "" : "until = { kinetic_to_potential = 1e-4, window = \"20 ms\" }\n", v.speed);
  return {fmt::format("{}-{}", v.name, seed), text, v.reproducible};
}

// The settled bed as a particle file: positions and radii; its contacts start fresh in every variant alike.
inline void write_bed(const std::filesystem::path& run, const std::filesystem::path& csv) {
  const Hdf5File file = Hdf5File::open(run / "results.h5");
  const Hdf5Group particles = file.root().group("particles");
  const auto x = particles.read<double>("position");
  const auto id = particles.read<std::int64_t>("id");
  std::ofstream out(csv);
  out << "id,x,y,z\n";
  for (std::size_t k = 0; k < id.size(); ++k) out << fmt::format("{},{:.17g},{:.17g},{:.17g}\n", id[k], x[3 * k], x[3 * k + 1], x[3 * k + 2]);
  if (!out) throw std::runtime_error("cannot write " + csv.string());
}

// Figures of one run; NaN where the run did not get so far, and the strength of a column that fell over.
inline std::map<std::string, double> bulk_figures(const std::filesystem::path& run) {
  std::map<std::string, double> r;
  for (const char* key : {"strain", "porosity", "coordination_number", "strength", "energy", "dt", "work", "seconds", "exit_code"}) r[key] = std::nan("");
  const nlohmann::json summary = summary_of(run);
  if (!summary.is_object()) return r;
  r["exit_code"] = summary.value("exit_code", -1);
  r["work"] = 1e-9 * summary.at("performance").value("particle_steps", std::nan(""));  // [1e9 particle-steps]
  r["seconds"] = summary.at("performance").value("wall_seconds", std::nan(""));
  double height = 0.0;
  bool fell = false;
  for (const auto& stage : summary.at("stages")) {
    const auto& values = stage.at("values");
    if (stage.at("kind") == "compress" && stage.at("end_reason") != "failed") {
      for (const char* key : {"strain", "porosity", "coordination_number"}) r[key] = values.value(key, std::nan(""));
      r["dt"] = stage.at("time").get<double>() / stage.at("steps").get<double>();
      double dissipated = 0.0;
      for (const char* key : {"plastic_dissipation", "viscous_dissipation", "sliding_dissipation", "rolling_dissipation"}) dissipated += values.value(key, 0.0);
      r["energy"] = std::fabs(values.value("energy_residual", std::nan(""))) / dissipated;
    }
    if (stage.at("kind") == "unload") height = values.value("height", 0.0);
    // A slender column may fall over without its sides. What a plate finds then is no strength.
    if (stage.at("kind") == "release") fell = values.value("height", 0.0) < 0.8 * height;
    if (stage.at("kind") == "crush" && !fell) r["strength"] = stage.value("strength", std::nan(""));
  }
  return r;
}

}  // namespace platen::bench
