#include "protocol/usable_cores.h"

#include <sched.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>
#include <string>
#include <thread>

namespace platen {
namespace {

namespace fs = std::filesystem;

constexpr int no_limit = std::numeric_limits<int>::max();

std::string first_line(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

std::optional<double> number(const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (end == text.c_str() || !(value > 0.0)) return std::nullopt;  // "max" and -1: no limit
  return value;
}

int whole_cores(const std::optional<double>& quota, const std::optional<double>& period) {
  if (!quota || !period) return no_limit;
  return static_cast<int>(std::clamp(*quota / *period, 1.0, 1e6));
}

int limit_of_v2(const fs::path& group) {
  std::istringstream words(first_line(group / "cpu.max"));
  std::string quota, period;
  words >> quota >> period;
  return whole_cores(number(quota), number(period));
}

int limit_of_v1(const fs::path& group) {
  return whole_cores(number(first_line(group / "cpu.cfs_quota_us")), number(first_line(group / "cpu.cfs_period_us")));
}

// The group and all above it, up to the mount point: each may have its own limit. Inside a container the path of
// /proc/self/cgroup need not exist; then only the mount point itself speaks.
template <class Limit>
int least_upwards(const fs::path& mount, const std::string& group, const Limit& limit_of) {
  int least = limit_of(mount);
  fs::path here = mount;
  for (const fs::path& part : fs::path(group).relative_path()) {
    if (part == "..") return least;  // a group outside of what this container sees
    here /= part;
    least = std::min(least, limit_of(here));
  }
  return least;
}

int quota_of_control_groups(const fs::path& root) {
  int least = no_limit;
  std::ifstream groups(root / "proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {  // number:controllers:path
    const auto first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",", group = line.substr(second + 1);
    const fs::path mount = root / "sys/fs/cgroup";
    if (controllers == ",,") {
      least = std::min(least, least_upwards(mount, group, limit_of_v2));
    } else if (controllers.find(",cpu,") != std::string::npos) {
      for (const char* folder : {"cpu", "cpu,cpuacct"})
        least = std::min(least, least_upwards(mount / folder, group, limit_of_v1));
    }
  }
  return least;
}

int affinity() {
  // A mask of 1024 processors is what the C library offers; larger machines need a larger one.
  for (int processors = 1024; processors <= 1 << 20; processors *= 2) {
    cpu_set_t* mask = CPU_ALLOC(static_cast<std::size_t>(processors));
    if (mask == nullptr) break;
    const std::size_t size = CPU_ALLOC_SIZE(static_cast<std::size_t>(processors));
    const bool good = sched_getaffinity(0, size, mask) == 0;
    const int count = good ? CPU_COUNT_S(size, mask) : 0;
    CPU_FREE(mask);
    if (good) return count;
  }
  return static_cast<int>(std::thread::hardware_concurrency());
}

}  // namespace

int usable_cores(const fs::path& root) {
  int cores = std::min(affinity(), quota_of_control_groups(root));
  if (const char* slurm = std::getenv("SLURM_CPUS_PER_TASK"))
    if (const auto wanted = number(slurm)) cores = std::min(cores, whole_cores(wanted, 1.0));
  return std::max(cores, 1);
}

}  // namespace platen
