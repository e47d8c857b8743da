#include "protocol/export_command.h"

#include <fmt/format.h>

#include "protocol/experiment.h"
#include "protocol/export/formats.h"

namespace platen {

int export_command(const ExportCommand& command) {
  const RunStates run = run_states(command.folder);
  const std::filesystem::path folder = command.output.empty() ? command.folder / "export" : command.output;
  std::filesystem::create_directories(folder);
  const auto write = command.format == "csv" ? export_csv : command.format == "vtu" ? export_vtu : command.format == "lammps" ? export_lammps : export_h5md;
  for (const std::string& name : write(run, folder))
    if (!command.quiet) fmt::print("{}\n", (folder / name).string());
  return exit_done;
}

}  // namespace platen
