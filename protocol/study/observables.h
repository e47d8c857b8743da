// What a study measures on a finished run: curves on a common axis, and single numbers.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/case_file.h"

namespace platen {

// y over x, x strictly increasing.
struct Curve {
  std::vector<double> x, y;
  bool empty() const { return x.size() < 2; }
};

// Linear interpolation; NaN outside the curve and for an empty one.
double value_at(const Curve& curve, double x);

struct ObservableKind {
  std::string name;
  std::string x_label, x_unit;
  std::string y_label, y_unit;
  std::string description;
};

// All curves that can be measured:
//   stress_strain, stress_strain_unloading      strain over stress_top while compress goes down, unload goes up
//   porosity, porosity_unloading                porosity over stress_top
//   coordination, coordination_unloading        coordination number over stress_top
//   porosity_height                             porosity over relative height at the end of compress
//   unconfined                                  stress_top over strain in crush
const std::vector<ObservableKind>& observable_kinds();
const ObservableKind& observable_kind(std::string_view name);  // the name must exist

struct ScalarKind {
  std::string name, unit, description;
};
const std::vector<ScalarKind>& scalar_kinds();

struct RunMeasures {
  std::map<std::string, Curve> curves;    // by name of the observable; absent where the run has no such stage
  std::map<std::string, double> scalars;  // by name of the scalar; absent likewise
};

// Measures a finished run. `strain_zero` is the stress at which strain starts to count [Pa]; empty: that of the case's
// compress stage. Stresses are centred means over 5 ms, because the instantaneous force flickers by single contacts; a
// branch over stress keeps, for each stress, where it was reached for the first time. Throws OutputError.
RunMeasures measure_run(const std::filesystem::path& folder, const Case& c, std::optional<double> strain_zero);

}  // namespace platen
