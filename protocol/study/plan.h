// From a study to the runs that it needs. Curves that need the same case share its run, also across included studies.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "protocol/case_file.h"
#include "protocol/study/study_file.h"

namespace platen {

// How the case of a job comes about where its porosity is matched.
struct JobMatch {
  const PorosityMatch* settings = nullptr;
  std::size_t reference = 0;  // place in StudyPlan::jobs of the run whose porosity is wanted, itself not matched
  Case start;                 // the case as it would be without matching
  bool met = false;           // Job::c is the case that was found
};

// One run.
struct Job {
  std::string name;     // of its folder, unique in the study
  Case c;               // c.text is the case.toml that the run folder must hold
  std::optional<JobMatch> match;
  double weight = 0.0;  // expected cost in particle-steps
  bool timed = false;
  int threads = 1;
  bool reproducible = false;  // its run and its tries are made with --reproducible; finished ones that were not do not count
};

// One curve: one point of the product of a [[curve]], with a run for every seed (timed: and repetition).
struct PlannedCurve {
  std::string label;    // unique in its part: "quadratic R=3 mm"
  std::string block;    // name of its [[curve]]
  double radius = 0.0;  // [m]
  ScalingPowers powers;
  std::map<std::string, std::string> varied;  // key -> TOML value
  std::vector<std::uint64_t> seeds;           // of each run
  std::vector<std::size_t> jobs;              // of each run: place in StudyPlan::jobs
  std::size_t reference = 0;                  // place in PlannedPart::curves of what it is compared with
};

struct PlannedPart {
  const Study* study = nullptr;
  Case base;
  double reference_radius = 0.0;  // [m]
  std::vector<PlannedCurve> curves;
};

struct StudyPlan {
  const Study* study = nullptr;
  std::vector<PlannedPart> parts;
  std::vector<Job> jobs;
};

// Reads the base cases and makes every case; each is checked as `platen run` would. Throws CaseError with everything
// that is wrong; `study` must outlive the plan.
StudyPlan make_plan(const Study& study);

}  // namespace platen
