// The sample as it stands when the compression begins, and its porosity.
//
// The porosity is the mean over the slabs of the profile without the lowest and the highest one. The layer on the bottom
// plate and the rough surface, where one sphere counts as the height of the bed, are as thick as a sphere is large: with
// them, beds of equal packing but different sizes would not have equal porosities.
#pragma once

#include <optional>

#include "protocol/case_file.h"
#include "protocol/output/hdf5_file.h"

namespace platen {

// The stage before the first `compress`; nullptr where there is none.
const StageSpec* settled_stage(const Case& c);

// From results.h5, also of a run that has not ended yet. Empty where that stage has not reached its goal, or the profile
// has fewer than three slabs. Throws OutputError.
std::optional<double> settled_porosity(const Hdf5Group& results, const Case& c);

}  // namespace platen
