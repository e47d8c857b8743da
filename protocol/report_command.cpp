#include "protocol/report_command.h"

#include <fmt/format.h>

#include <cstdio>

#include "protocol/experiment.h"
#include "protocol/output/files.h"
#include "protocol/report/report_page.h"

namespace platen {

namespace fs = std::filesystem;

void write_report(const fs::path& folder) { write_whole_file(folder / "report.html", report_page({folder})); }

int report_command(const ReportCommand& command) {
  fs::path output = command.output;
  if (output.empty()) output = command.folders.size() == 1 ? command.folders.front() / "report.html" : fs::path("report.html");
  write_whole_file(output, report_page(command.folders));
  if (!command.quiet) fmt::print("report: {}\n", output.string());
  return exit_done;
}

}  // namespace platen
