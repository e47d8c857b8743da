// `platen info`: what is in a run folder, an HDF5 file or a case file.
#pragma once

#include <filesystem>
#include <string>

namespace platen {

// Text for people, or with `json` one JSON object with the same facts (key "kind": "run", "hdf5" or "case"); ends with a
// newline. Throws OutputError when the path is none of these or cannot be read, CaseError when a case file is wrong.
std::string describe(const std::filesystem::path& path, bool json);

// How far a run folder's run is: "done (exit code 0)", "running", "failed (exit code 4)"; `good`: nothing is wrong with it.
struct RunState {
  std::string text;
  bool good = true;
};
RunState run_state(const std::filesystem::path& folder);

// Its title, from its case. Throws OutputError when that is no TOML.
std::string run_title(const std::filesystem::path& folder);

}  // namespace platen
