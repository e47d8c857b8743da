// Figures by gnuplot: <name>.dat (numbers), <name>.gp (script), <name>.svg and <name>.png side by side in figures/.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "protocol/study/analysis.h"

namespace platen {

// Writes data and scripts of every figure of a part, its scans and its run times, and draws them. Returns what could not
// be drawn and why, one line each (gnuplot missing or failed); the data are there all the same. Throws OutputError.
std::vector<std::string> draw_figures(const std::filesystem::path& folder, const StudyPlan& plan,
                                      const PartResults& part);

}  // namespace platen
