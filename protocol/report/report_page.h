// The page of `platen report`: one HTML file that needs nothing else, curves by Chart.js, the bed by three.js.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace platen {

// The page of these run folders; several are compared. Throws OutputError as run_data does.
std::string report_page(const std::vector<std::filesystem::path>& folders);

}  // namespace platen
