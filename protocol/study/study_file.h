// The study: which cases are run, what is measured on them and what it is compared with, read from a TOML file
// (docs/studies.md). Only this file and its reader know the names of the keys.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "protocol/case_document.h"
#include "protocol/scaling.h"

namespace platen {

// A key of the case and the TOML values that it takes, one after the other.
struct VariedKey {
  std::string key;
  std::vector<std::string> values;
};

// [[curve]]: the product of its radii, powers and varied keys; every member of the product is one curve with its seeds.
struct CurveSpec {
  std::string name;
  Position where;
  std::vector<double> radii;                                          // [m]; empty: the reference radius
  std::vector<double> stiffness{1.0}, adhesion{2.0}, time_step{0.0};  // powers of R
  std::optional<double> dashpots;                                     // power of R; empty: restitution kept
  std::vector<VariedKey> vary;
  std::vector<std::string> set;  // `--set` texts
  std::string against;           // name of the [[curve]] that it is compared with; empty: the first one
};

// [[figure]]: one observable of some curves in one picture.
struct FigureSpec {
  std::string name, title;
  std::vector<std::string> observables;  // drawn together: loading and unloading
  std::vector<std::string> curves;       // names of [[curve]]; empty: all
};

// [[scan]]: the power of least collapse error.
struct ScanSpec {
  Position where;
  enum class Power { stiffness, adhesion };
  Power power = Power::stiffness;
  std::vector<std::string> curves;       // names of [[curve]]; empty: all
  std::vector<std::string> observables;  // empty: all of the study
};

// match_porosity: the settled samples of all curves get the porosity of those that they are compared with.
struct PorosityMatch {
  enum class Adjust { vibration, growth };
  Adjust adjust = Adjust::vibration;
  double tolerance = 0.0;                          // of porosity
  std::optional<std::pair<double, double>> range;  // vibration: duration [s]; growth: porosity; empty: around the case's
  int most_tries = 12;                             // of each run
  Position where;
};

struct Study {
  std::string title;
  std::string name;  // stem of its file
  std::filesystem::path file;
  std::string text;            // as read, overrides applied
  std::filesystem::path base;  // base case; empty when it includes others
  Position base_where;
  std::optional<double> reference_radius;  // [m]; empty: that of the base case
  std::vector<std::uint64_t> seeds{1};
  std::vector<std::string> set;          // `--set` texts for all curves
  std::vector<std::string> observables;  // names from observable_kinds()
  std::optional<double> strain_zero;     // [Pa]; empty: that of the case's compress stage
  std::vector<std::string> statements;   // groups of statements to judge, from statement_groups()
  bool timed = false;                    // runs alone, interleaved, their wall time is a result
  int repeats = 1;                       // of timed runs
  int threads = 1;                       // of each run
  std::optional<PorosityMatch> match_porosity;
  std::vector<CurveSpec> curves;
  std::vector<FigureSpec> figures;
  std::vector<ScanSpec> scans;
  std::vector<Study> parts;  // include = [...]: these and nothing of its own
};

// Reads and checks a study file and those that it includes. `overrides` are `--set` texts for the study itself
// (study.seeds=[1, 2, 3]). Base cases are found relative to the study file and not read here.
// Throws CaseError with every semantic error at once.
Study read_study(const std::filesystem::path& file, const std::vector<std::string>& overrides = {});

}  // namespace platen
