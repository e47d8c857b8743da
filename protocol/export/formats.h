// What `platen export` writes, one function a format. Each makes files in `folder`, which exists, and returns their names.
// All throw OutputError.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "protocol/export/run_states.h"

namespace platen {

// NUMBER-STAGE.csv: spheres, in the form that `file` of a case reads; contacts.csv: those of the last stage.
std::vector<std::string> export_csv(const RunStates& run, const std::filesystem::path& folder);
// NUMBER-STAGE.vtu: VTK's XML, and stages.pvd with their times.
std::vector<std::string> export_vtu(const RunStates& run, const std::filesystem::path& folder);
// stages.dump: a text dump of all stages, for LAMMPS' own tools and OVITO; last.data: the last stage for read_data with atom_style
// sphere.
std::vector<std::string> export_lammps(const RunStates& run, const std::filesystem::path& folder);
// stages.h5md: H5MD 1.1, a frame a stage.
std::vector<std::string> export_h5md(const RunStates& run, const std::filesystem::path& folder);

}  // namespace platen
