// `platen report`.
#pragma once

#include <filesystem>
#include <vector>

namespace platen {

struct ReportCommand {
  std::vector<std::filesystem::path> folders;
  std::filesystem::path output;  // empty: report.html in the folder; of several, in the working directory
  bool quiet = false;
};

// Writes the page; returns the exit code. Throws OutputError.
int report_command(const ReportCommand& command);

// report.html in the folder of a run.
void write_report(const std::filesystem::path& folder);

}  // namespace platen
