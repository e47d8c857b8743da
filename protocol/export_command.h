// `platen export`.
#pragma once

#include <filesystem>
#include <string>

namespace platen {

struct ExportCommand {
  std::filesystem::path folder;
  std::string format;             // csv, vtu, lammps, h5md
  std::filesystem::path output;   // empty: FOLDER/export
  bool quiet = false;
};

// Writes the files and prints their names; returns the exit code. Throws OutputError, CaseError.
int export_command(const ExportCommand& command);

}  // namespace platen
