// Samples of equal porosity: every curve's run of a seed gets the settled porosity of the same seed of the curve that it
// is compared with (docs/studies.md). Seed by seed and not the mean over seeds, so that a run does not depend on how many
// seeds there are.
//
//   tries/<job>/1, 2, ...   run folders up to the settled sample, one setting each; all that the search knows is there
//   cases/<job>.toml        the case with the setting that was found
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "protocol/study/plan.h"
#include "protocol/study/porosity_search.h"

namespace platen {

// The key of the case that is adjusted: "stage.vibrate.duration".
std::string adjusted_key(const PorosityMatch& match, const Case& c);

// Vibration: whole periods of the first vibrate stage before the settled sample, since the bottom plate swings whole ones
// only; the other vibrate stages stay in proportion. Growth: porosity in units of 1e-5.
// Throws CaseError where the case has nothing to adjust or cannot be run over the whole range.
PorosityKnob knob_of(const PorosityMatch& match, const Case& start);

double knob_value(const PorosityMatch& match, const Case& start, std::int64_t knob);  // of the key: [s], [-]

Case with_knob(const PorosityMatch& match, const Case& start, std::int64_t knob);

struct MatchState {
  enum class Kind {
    waits,    // for the settled sample of the reference's run
    attempt,  // `c` must be tried, as number tries.size() + 1
    met,      // `c` has the wanted porosity
    failed    // it cannot be had, `message` says why
  };
  Kind kind = Kind::waits;
  std::optional<double> target;    // porosity of the reference's sample; empty: waits
  std::vector<PorosityTry> tries;  // finished ones
  std::int64_t knob = 0;           // attempt, met: the setting; failed: the nearest, 0 where there is none
  Case c;
  std::string message;
};

std::filesystem::path try_folder(const std::filesystem::path& study_folder, const Job& job, std::size_t number);

// Where the search of a matched job stands, from what is on disk alone. Throws OutputError.
MatchState match_state(const StudyPlan& plan, const Job& job, const std::filesystem::path& study_folder);

// Gives the job its case where the search has met its aim.
void take_match(Job& job, const MatchState& state);

}  // namespace platen
