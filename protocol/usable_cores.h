// How many cores this process may use: the default number of threads.
#pragma once

#include <filesystem>

namespace platen {

// The least of: the cores of its affinity mask, the quota of its control group and of those above it (version 2 cpu.max,
// version 1 cpu.cfs_quota_us; a fraction of a core is not counted), and the environment variable SLURM_CPUS_PER_TASK.
// At least 1. `root` is where /proc and /sys are looked for.
int usable_cores(const std::filesystem::path& root = "/");

}  // namespace platen
