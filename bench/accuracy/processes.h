// Runs of the experiment side by side, each in a process of its own: the HDF5 library is not made for threads.
#pragma once

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "protocol/experiment.h"

namespace platen::bench {

struct Job {
  std::string name;                // of its folder below `folder`
  std::string text;                // the case
  bool reproducible = false;       // as platen run --reproducible
};

inline nlohmann::json summary_of(const std::filesystem::path& run) {
  std::ifstream file(run / "summary.json");
  if (!file) return {};
  return nlohmann::json::parse(file, nullptr, false);
}

// A job whose folder holds the summary of the same case is not run again. Particle files are looked for in `folder`.
inline void run_jobs(const std::vector<Job>& jobs, const std::filesystem::path& folder, int processes) {
  const auto done = [&](const Job& job) {
    std::ifstream file(folder / job.name / "bench-case.toml");
    const std::string before((std::istreambuf_iterator<char>(file)), {});
    return before == job.text && !summary_of(folder / job.name).is_null();
  };
  const auto work = [&](const Job& job) -> int {
    try {
      const Case c = parse_case(job.text, job.name, folder);
      RunFolder run = RunFolder::create(folder / job.name, c.text, true);
      RunOptions options;
      options.reproducible = job.reproducible;
      const RunOutcome outcome = run_experiment(c, run, options);
      std::ofstream(folder / job.name / "bench-case.toml") << job.text;
      if (outcome.exit_code != exit_done) std::fprintf(stderr, "%s: exit %d: %s\n", job.name.c_str(), outcome.exit_code, outcome.message.c_str());
      return outcome.exit_code;
    } catch (const std::exception& error) {
      std::fprintf(stderr, "%s: %s\n", job.name.c_str(), error.what());
      return exit_case;
    }
  };
  int running = 0;
  std::size_t finished = 0;
  const auto wait_for_one = [&] {
    int status = 0;
    if (::wait(&status) > 0) --running, ++finished;
    std::fprintf(stderr, "\r  %zu of %zu%s", finished, jobs.size(), finished == jobs.size() ? "\n" : "");
  };
  for (const Job& job : jobs) {
    if (done(job)) {
      ++finished;
      continue;
    }
    while (running >= processes) wait_for_one();
    std::fflush(nullptr);
    const pid_t child = ::fork();
    if (child < 0) throw std::runtime_error("fork failed");
    if (child == 0) {
      const int code = work(job);
      std::fflush(nullptr);
      ::_exit(code);
    }
    ++running;
  }
  while (running > 0) wait_for_one();
}

}  // namespace platen::bench
