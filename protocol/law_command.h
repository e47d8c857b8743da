// `platen law`: one contact driven quasi-statically along given overlaps, through the engine's own law.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/snapshot.h"
#include "kernels/law_parameters.h"

namespace platen {

struct LawRow {
  double overlap = 0.0;          // delta [m], as given
  double f_hys = 0.0;            // spring force, positive repels [N]
  double plastic_overlap = 0.0;  // delta_p after the step [m]
  double friction_limit = 0.0;   // mu |f_hys + k_adh s - f0| or mu |f_hys| between spheres, mu F at a plate [N]
  Branch branch = Branch::none;  // of Eq. 2 with the history as it was before this step
};

// One row for each overlap [m]. A contact that starts fresh; an overlap <= 0 ends it and clears its history
// [Thakur2016, Eq. 2, 10; kernels/eepa.h].
std::vector<LawRow> drive_pair(const PairLaw& law, const std::vector<double>& overlaps);

// A sphere of radius R [m] against a plate: Hertz, no history [kernels/hertz_mindlin.h].
std::vector<LawRow> drive_plate(const PlateLaw& law, double R, const std::vector<double>& overlaps);

// About 200 overlaps that show the whole law of a pair: load to delta_max [m], unload until half the spring's force is
// left, re-load to 1.5 delta_max, unload through zero and along the adhesive branch until 0.3 of the overlap where it
// began, re-load to 1.125 delta_max, unload until the spheres are apart.
std::vector<double> cycle_overlaps(const PairLaw& law, double delta_max);

// One overlap a line, in metres or with a unit; `#` starts a comment, empty lines are skipped. `name` stands in messages.
// Throws CaseError with every bad line, as `name:line: what is wrong; what is allowed`.
std::vector<double> parse_overlaps(const std::string& text, const std::string& name);

// Header overlap,f_hys,plastic_overlap,friction_limit,branch; numbers with 17 significant digits.
std::string law_csv(const std::vector<LawRow>& rows);

struct LawCommand {
  std::filesystem::path case_file;
  std::vector<std::string> overrides;      // --set
  std::string overlap_file;                // "-": standard input; empty: the cycle
  bool plate = false;                      // contact with a plate instead of a pair
  std::optional<double> radius;            // of the sphere [m], instead of the case's
  std::filesystem::path output;            // empty: standard output
};

// Returns the exit code; throws CaseError, OutputError.
int law_command(const LawCommand& command);

}  // namespace platen
