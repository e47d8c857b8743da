// Makes the beds of the benches ahead of them, and writes them for other programs: bench_beds --help.
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include <exception>

#include "bench/beds.h"

using namespace platen::bench;

int main(int argc, char** argv) {
  CLI::App app("beds of the benches");
  std::filesystem::path beds = std::filesystem::temp_directory_path() / "platen-bench-beds";
  std::vector<std::int64_t> dense, rain;
  std::string lammps, csv;
  app.add_option("--beds", beds, "folder where beds are kept");
  app.add_option("--dense", dense, "numbers of particles of dense beds")->delimiter(',');
  app.add_option("--rain", rain, "numbers of particles of rain")->delimiter(',');
  app.add_option("--lammps", lammps, "write the last bed as a LAMMPS data file");
  app.add_option("--csv", csv, "write the last bed as platen's particles.csv");
  CLI11_PARSE(app, argc, argv);
  try {
    Bed bed;
    for (const std::int64_t n : dense) bed = dense_bed(n, beds);
    for (const std::int64_t n : rain) bed = rain_bed(n, beds);
    if (!lammps.empty()) write_lammps(bed, lammps);
    if (!csv.empty()) write_particles(bed, csv);
    fmt::print("{{\"particles\": {}, \"radius\": {}, \"width\": {}, \"depth\": {}, \"height\": {}}}\n", bed.size(),
               bed.R, bed.width, bed.depth, bed.height);
  } catch (const std::exception& error) {
    fmt::print(stderr, "bench_beds: {}\n", error.what());
    return 2;
  }
  return 0;
}
