// What the finished runs of a part of a study say: its curves with their seeds, collapse errors, scans.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "protocol/study/collapse.h"
#include "protocol/study/observables.h"
#include "protocol/study/plan.h"
#include "protocol/study/runner.h"

namespace platen {

// A planned curve with what its runs measured; a failed run is missing from `runs`.
struct MeasuredCurve {
  const PlannedCurve* planned = nullptr;
  std::vector<std::uint64_t> seeds;  // of each run here
  std::vector<std::size_t> jobs;     // of each run here
  std::vector<RunMeasures> runs;
  std::vector<double> wall_seconds;   // of each run, as its summary says; NaN where it does not
  std::vector<double> steal_seconds;  // of timed runs; 0 otherwise

  std::vector<Curve> curves(const std::string& observable) const;  // of the runs that have it
  std::vector<double> values(const std::string& scalar) const;     // of the runs that have it
};

struct CollapseRow {
  std::size_t curve = 0, reference = 0;  // places in PartResults::curves
  std::string observable;
  CollapseError error;
};

struct ScanResult {
  ScanSpec::Power power = ScanSpec::Power::stiffness;
  std::string observable;                 // "all": root of the mean of the squared relative errors of all observables
  double radius = 0.0;                    // [m]
  double other_power = 0.0;               // the one that is not scanned
  std::map<std::string, std::string> varied;  // of its curves: key -> TOML value
  std::string reference;                  // label of the curve it is judged against
  std::vector<double> powers;             // increasing
  std::vector<double> errors;             // root mean square over seeds, relative to the reference's range
  int seeds = 0;
  std::optional<Minimum> minimum;
  double best_tried = 0.0;  // the tried power of least error
};

struct PartResults {
  const PlannedPart* plan = nullptr;
  std::vector<MeasuredCurve> curves;  // as plan->curves
  std::vector<CollapseRow> collapse;  // every curve that is not its own reference, every observable
  std::vector<ScanResult> scans;
};

// Reads the folders of all jobs that are done. Runs that cannot be read are left out, with a message in `damaged`.
std::vector<PartResults> analyse(const StudyPlan& plan, const std::filesystem::path& folder, std::set<std::string>& damaged);

}  // namespace platen
