// `platen info`: what is in a run folder, an HDF5 file or a case file.
#pragma once

#include <filesystem>
#include <string>

namespace platen {

// Text for people, or with `json` one JSON object with the same facts (key "kind": "run", "hdf5" or "case"); ends with a
// newline. Throws OutputError when the path is none of these or cannot be read, CaseError when a case file is wrong.
std::string describe(const std::filesystem::path& path, bool json);

}  // namespace platen
