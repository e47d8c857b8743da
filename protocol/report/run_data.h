// What the report shows of a run, read from its folder alone.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

namespace platen {

// {name, title, folder, state, good, state_hash, version, case,
//  performance {threads, wall_seconds, particle_steps_per_second, ...},
//  stages [as in summary.json, with profile {z, porosity, coordination_number}],
//  series {stage [numbers], time, strain, ...: rows of the run, thinned},
//  limits [{time, dt from then on, dt_crit, dt_limit}],
//  particles {count, unit [m], radius [units; one number where all are equal]},
//  beds [{stage, position [units, x y z], moved [units] since the end of the stage `since`}]: spheres at the ends of stages}
// What a run has not got is left out or empty; numbers that are none are null. A run that is not finished gives what there is
// so far. Throws OutputError when the folder holds no run or a file in it is damaged.
nlohmann::ordered_json run_data(const std::filesystem::path& folder);

}  // namespace platen
