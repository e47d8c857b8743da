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

struct BulkCase {
  std::string name, law;  // case I, II or III of [Thakur2016] at R = 3.75 mm: k1, k2, k_adh ~ R, f0 ~ R^2
  bool vibrate = false, crush = true;
};

inline BulkCase bulk_case(const std::string& name) {
  const std::string common = "k1 = 7500.0\nk2 = 37500.0\nrestitution = 0.4\nfriction = 0.5\nrolling_friction = 0.001\n";
  if (name == "I") return {name, common, true, false};
  if (name == "II") return {name, common + "f0 = -0.9\n", false, true};
  if (name == "III") return {name, common + "k_adh = 7500.0\n", false, true};
  throw std::invalid_argument("no case " + name + "; there are I, II, III");
}

struct BulkSize {
  int count = 1700;
  double side = 0.05;          // of the square box [m]
  double speed = 0.01;         // of plates in variants of the step [m/s]
  double stress = 40e3;        // [Pa]
  int seeds = 6;
  std::vector<double> shares;  // of dt_crit, smallest first: that is the reference
  std::vector<double> speeds;  // [m/s], slowest first: the reference
  double share_of_speeds = 0.2;
  double bed_share = 0.1, vibration = 1.0;  // [s]
};

inline BulkSize bulk_size(bool quick) {
  if (!quick) return {1700, 0.05, 0.01, 40e3, 6, {0.025, 0.05, 0.1, 0.2, 0.3, 0.4}, {0.0025, 0.005, 0.01, 0.02, 0.04}, 0.2, 0.1, 1.0};
  return {140, 0.02, 0.2, 20e3, 3, {0.1, 0.2, 0.4}, {0.1, 0.4}, 0.2, 0.2, 0.05};
}

inline std::string bulk_text(const BulkCase& b, const BulkSize& s, int seed, double dt, const std::string& particles) {
  return fmt::format(
      "[case]\ntitle = \"accuracy, case {}\"\nseed = {}\n[particles]\ndensity = 2000.0\n{}[particles.law]\n{}[box]\nwidth = {}\ndepth = {}\n"
      "height = {}\n[time]\nstep = {}\n[output]\nseries = 5e-3\nframes = \"off\"\ncontacts = false\n",
      b.name, seed, particles, b.law, s.side, s.side, 1.2 * s.count * 2.209e-7 / (0.5 * s.side * s.side), dt);
}

inline std::string settle_text(bool strict) {
  return strict ? "[[stage]]\nkind = \"settle\"\n" : "[[stage]]\nkind = \"settle\"\nuntil = { kinetic_to_potential = 1e-4, window = \"20 ms\" }\n";
}

inline std::string bed_name(int seed) { return fmt::format("bed-{}", seed); }

inline Job bed_job(const BulkCase& b, const BulkSize& s, int seed, double dt_crit) {
  std::string text = bulk_text(b, s, seed, s.bed_share * dt_crit, fmt::format("radius = 3.75e-3\ncount = {}\n", s.count));
  text += "[[stage]]\nkind = \"fill\"\n";
  if (b.vibrate) text += fmt::format("[[stage]]\nkind = \"vibrate\"\nfrequency = 60.0\namplitude = 1.5e-3\nduration = {}\n", s.vibration);
  return {bed_name(seed), text + settle_text(s.seeds > 3)};
}

inline Job variant_job(const BulkCase& b, const BulkSize& s, int seed, const std::string& name, double dt, double speed) {
  std::string text = bulk_text(b, s, seed, dt, fmt::format("radius = 3.75e-3\nfile = \"{}.csv\"\n", bed_name(seed)));
  text += settle_text(s.seeds > 3);
  text += fmt::format("[[stage]]\nkind = \"compress\"\nspeed = {}\nstart_gap = 1e-4\nuntil = {{ stress = {} }}\n", speed, s.stress);
  if (b.crush)
    text += fmt::format("[[stage]]\nkind = \"unload\"\nspeed = {}\n[[stage]]\nkind = \"release\"\n{}"
                        "[[stage]]\nkind = \"crush\"\nspeed = {}\nstart_gap = 1e-4\nuntil = {{ strain = 0.2, drop = 0.2 }}\n",
                        speed, s.seeds > 3 ? "" : "until = { kinetic_to_potential = 1e-4, window = \"20 ms\" }\n", speed);
  return {fmt::format("{}-{}", name, seed), text};
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

// Figures of one run; NaN where the run did not get so far.
inline std::map<std::string, double> bulk_figures(const std::filesystem::path& run) {
  std::map<std::string, double> r;
  for (const char* key : {"strain", "porosity", "coordination_number", "strength", "energy", "seconds", "exit_code"}) r[key] = std::nan("");
  const nlohmann::json summary = summary_of(run);
  if (!summary.is_object()) return r;
  r["exit_code"] = summary.value("exit_code", -1);
  r["seconds"] = summary.at("performance").value("wall_seconds", std::nan(""));
  for (const auto& stage : summary.at("stages")) {
    const auto& values = stage.at("values");
    if (stage.at("kind") == "compress" && stage.at("end_reason") != "failed") {
      for (const char* key : {"strain", "porosity", "coordination_number"}) r[key] = values.value(key, std::nan(""));
      double dissipated = 0.0;
      for (const char* key : {"plastic_dissipation", "viscous_dissipation", "sliding_dissipation", "rolling_dissipation"}) dissipated += values.value(key, 0.0);
      r["energy"] = std::fabs(values.value("energy_residual", std::nan(""))) / dissipated;
    }
    if (stage.at("kind") == "crush") r["strength"] = stage.value("strength", std::nan(""));
  }
  return r;
}

struct Difference {
  double mean = 0.0, error = 0.0;  // of the pairs: mean and standard error
  int pairs = 0;
};

inline Difference paired(const std::vector<double>& a, const std::vector<double>& reference) {
  Difference d;
  double sum = 0.0, squares = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    const double x = a[k] - reference[k];
    if (!std::isfinite(x)) continue;
    sum += x, squares += x * x, ++d.pairs;
  }
  d.mean = d.pairs > 0 ? sum / d.pairs : std::nan("");
  d.error = d.pairs > 1 ? std::sqrt(std::max(0.0, squares - sum * d.mean) / (d.pairs - 1) / d.pairs) : std::nan("");
  return d;
}

inline double scatter(const std::vector<double>& x) {  // standard deviation between seeds
  double sum = 0.0, squares = 0.0;
  int n = 0;
  for (const double v : x)
    if (std::isfinite(v)) sum += v, squares += v * v, ++n;
  return n > 1 ? std::sqrt(std::max(0.0, squares - sum * sum / n) / (n - 1)) : std::nan("");
}

}  // namespace platen::bench
