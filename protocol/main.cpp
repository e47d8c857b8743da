// The program `platen`: command line in, exit code out. What the commands do is in *_command.cpp.
#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/simulation.h"
#include "kernels/kernel_table.h"
#include "protocol/case_reader.h"
#include "protocol/check_command.h"
#include "protocol/experiment.h"
#include "protocol/export_command.h"
#include "protocol/info.h"
#include "protocol/law_command.h"
#include "protocol/output/output_error.h"
#include "protocol/progress.h"
#include "protocol/report_command.h"
#include "protocol/run_command.h"
#include "protocol/study_command.h"
#include "protocol/units.h"
#include "protocol/usage_error.h"

namespace platen {
namespace {

constexpr int exit_internal = 1;  // a mistake of ours, or no memory
constexpr int most_threads = 4096;

void set_up_log() {
  auto sink = std::make_shared<spdlog::sinks::stderr_color_sink_st>(
      may_colour(stderr) ? spdlog::color_mode::always : spdlog::color_mode::never);
  auto log = std::make_shared<spdlog::logger>("platen", sink);
  sink->set_color(spdlog::level::info, "");  // only warnings and errors stand out
  log->set_pattern("%^%v%$");
  spdlog::set_default_logger(log);
}

struct Command {
  CLI::App* app = nullptr;
  const char* example = "";
  std::function<int()> carry_out;
};

CLI::Option* add_case(CLI::App& app, std::filesystem::path& file) {
  return app.add_option("CASE", file, "the case file (TOML)")->type_name("FILE")->required();
}

void add_overrides(CLI::App& app, std::vector<std::string>& overrides, const char* help = "change one key of the case; stages by name or number. May be repeated",
                   const char* form = "KEY.PATH=VALUE") {
  app.add_option("--set", overrides, help)
      ->type_name(form)
      ->take_all()
      ->allow_extra_args(false);
}

void add_threads(CLI::App& app, std::optional<int>& threads) {
  app.add_option("--threads", threads, "threads (default: the cores that this process may use)")
      ->type_name("N")
      ->check(CLI::Range(1, most_threads));
}

// Lengths of options, plain numbers being metres; with the message of the unit reader.
double option_value(const char* option, const std::string& text, Quantity quantity) {
  double plain = 0.0;
  if (const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), plain); error == std::errc{} && end == text.data() + text.size() && std::isfinite(plain)) return plain;
  try {
    return to_si(text, quantity);
  } catch (const UnitError& error) {
    throw UsageError(std::string(option) + ": " + error.what());
  }
}

// Before a case is read: the user may have asked for kernels that this processor does not have.
void check_instruction_set() {
  try {
    preferred_instruction_set();
  } catch (const std::invalid_argument& error) {
    throw UsageError(error.what());
  }
}

Command add_run(CLI::App& program) {
  CLI::App* app = program.add_subcommand("run", "run a case into a folder");
  auto command = std::make_shared<RunCommand>();
  auto walltime = std::make_shared<std::string>();
  add_case(*app, command->case_file);
  app->add_option("-o,--output", command->folder, "run folder (default: runs/<name of the case>, with the next free number)")
      ->type_name("DIR");
  add_threads(*app, command->threads);
  add_overrides(*app, command->overrides);
  app->add_option("--from", command->from, "begin with the bed of another run, stopped by --stop-after; stages up to there must be the same")->type_name("DIR");
  app->add_option("--max-walltime", *walltime, "stop after this time, e.g. \"90 s\", \"10 min\", \"2 h\"")->type_name("T");
  app->add_option("--stop-after", command->stop_after, "end after this stage, by name or number")->type_name("STAGE");
  app->add_flag("--reproducible", command->reproducible, "the same bits on every instruction set; somewhat slower");
  app->add_flag("--force", command->force, "replace the run that is in the folder");
  app->add_flag_callback("--no-report", [command] { command->report = false; }, "write no report.html");
  app->add_flag("--json", command->json, "print the summary as JSON");
  app->add_flag("-q,--quiet", command->quiet, "print nothing but errors, and warnings about files");
  return {app, "platen run protocol/cases/quick.toml -o runs/first --set stage.compress.speed='\"20 mm/s\"'", [=] {
            check_instruction_set();
            if (!walltime->empty()) command->max_walltime = parse_walltime(*walltime);
            return run_command(*command);
          }};
}

Command add_resume(CLI::App& program) {
  CLI::App* app = program.add_subcommand("resume", "go on with a run that was stopped or killed, from its last checkpoint");
  auto command = std::make_shared<ResumeCommand>();
  auto walltime = std::make_shared<std::string>();
  app->add_option("DIR", command->folder, "run folder")->type_name("DIR")->required();
  add_threads(*app, command->threads);
  add_overrides(*app, command->overrides, "give a stage that is not over more time: stage.NAME.max_duration=T. May be repeated");
  app->add_option("--max-walltime", *walltime, "stop after this time, e.g. \"90 s\", \"10 min\", \"2 h\"")->type_name("T");
  app->add_option("--stop-after", command->stop_after, "end after this stage, by name or number")->type_name("STAGE");
  app->add_flag_callback("--no-report", [command] { command->report = false; }, "write no report.html");
  app->add_flag("--json", command->json, "print the summary as JSON");
  app->add_flag("-q,--quiet", command->quiet, "print nothing but errors, and warnings about files");
  return {app, "platen resume runs/first", [=] {
            check_instruction_set();
            if (!walltime->empty()) command->max_walltime = parse_walltime(*walltime);
            return resume_command(*command);
          }};
}

Command add_check(CLI::App& program) {
  CLI::App* app = program.add_subcommand("check", "say whether a case is right, and what follows from it");
  auto command = std::make_shared<CheckCommand>();
  add_case(*app, command->case_file);
  add_overrides(*app, command->overrides);
  add_threads(*app, command->threads);
  app->add_flag("--json", command->json, "print JSON");
  return {app, "platen check protocol/cases/cohesive.toml", [=] {
            check_instruction_set();
            return check_command(*command);
          }};
}

Command add_law(CLI::App& program) {
  CLI::App* app = program.add_subcommand("law", "drive one contact along overlaps and print its force as CSV");
  auto command = std::make_shared<LawCommand>();
  auto contact = std::make_shared<std::string>("pair");
  auto radius = std::make_shared<std::string>();
  auto cycle = std::make_shared<bool>(false);
  add_case(*app, command->case_file);
  add_overrides(*app, command->overrides);
  auto* overlap = app->add_option("--overlap", command->overlap_file, "the overlaps, one a line, in metres or with a unit; - reads standard input")
                      ->type_name("FILE");
  app->add_flag("--cycle", *cycle, "instead: loading, unloading, re-loading, adhesion, separation")->excludes(overlap);
  app->add_option("--contact", *contact, "between two spheres, or a sphere and a plate")
      ->type_name("pair|plate")
      ->check(CLI::IsMember({"pair", "plate"}));
  app->add_option("--radius", *radius, "of the sphere (default: the case's; of a distribution the largest)")->type_name("LENGTH");
  app->add_option("-o,--output", command->output, "write the CSV there")->type_name("CSV");
  return {app, "platen law protocol/cases/load-dependent.toml --cycle -o law.csv", [=] {
            if (!*cycle && command->overlap_file.empty()) throw UsageError("the overlaps are missing; allowed: --overlap FILE, or --cycle");
            command->plate = *contact == "plate";
            if (!radius->empty()) {
              command->radius = option_value("--radius", *radius, Quantity::length);
              if (!(*command->radius > 0.0)) throw UsageError("--radius: " + *radius + " is not a positive length");
            }
            return law_command(*command);
          }};
}

Command add_study(CLI::App& program) {
  CLI::App* app = program.add_subcommand("study", "run a scaling study: radii, scaling powers, seeds; resumable");
  auto command = std::make_shared<StudyCommand>();
  app->add_option("STUDY", command->study_file, "the study file (TOML)")->type_name("FILE")->required();
  app->add_option("-o,--output", command->folder, "folder of the results; a study that is there already goes on")
      ->type_name("DIR")
      ->required();
  app->add_option("--jobs", command->jobs, "runs at a time (default: the cores that this process may use, over the threads of a run)")
      ->type_name("J")
      ->check(CLI::Range(1, most_threads));
  add_overrides(*app, command->overrides, "change one key of the study, as study.seeds='[1, 2, 3]'. May be repeated", "KEY=VALUE");
  app->add_flag("--reproducible", command->reproducible, "the same bits on every instruction set; somewhat slower");
  app->add_flag("--dry-run", command->dry_run, "print the runs and end");
  app->add_flag("-q,--quiet", command->quiet, "print nothing but errors, and warnings about files");
  return {app, "platen study protocol/studies/fig4-7.toml -o studies/fig4-7", [=] {
            check_instruction_set();
            return study_command(*command);
          }};
}

Command add_report(CLI::App& program) {
  CLI::App* app = program.add_subcommand("report", "write a page with the curves and the bed of a run, or compare several");
  auto command = std::make_shared<ReportCommand>();
  app->add_option("DIR", command->folders, "run folders")->type_name("DIR")->required();
  app->add_option("-o,--output", command->output, "the page (default: report.html in the folder; of several, here)")->type_name("FILE");
  app->add_flag("-q,--quiet", command->quiet, "print nothing but errors, and warnings about files");
  return {app, "platen report runs/soft runs/stiff -o comparison.html", [=] { return report_command(*command); }};
}

Command add_export(CLI::App& program) {
  CLI::App* app = program.add_subcommand("export", "write the spheres at the ends of stages in another format");
  auto command = std::make_shared<ExportCommand>();
  app->add_option("DIR", command->folder, "run folder")->type_name("DIR")->required();
  app->add_option("--to", command->format, "format")->type_name("csv|vtu|lammps|h5md")->required()->check(CLI::IsMember({"csv", "vtu", "lammps", "h5md"}));
  app->add_option("-o,--output", command->output, "folder of the files (default: DIR/export)")->type_name("DIR");
  app->add_flag("-q,--quiet", command->quiet, "print nothing but errors, and warnings about files");
  return {app, "platen export runs/first --to csv", [=] { return export_command(*command); }};
}

Command add_info(CLI::App& program) {
  CLI::App* app = program.add_subcommand("info", "say what is in a run folder, an HDF5 file or a case file");
  auto path = std::make_shared<std::filesystem::path>();
  auto json = std::make_shared<bool>(false);
  app->add_option("PATH", *path, "run folder, HDF5 file or case file")->type_name("FILE|DIR")->required();
  app->add_flag("--json", *json, "print JSON");
  return {app, "platen info runs/quick", [=] {
            const std::string text = describe(*path, *json);
            std::fwrite(text.data(), 1, text.size(), stdout);
            return static_cast<int>(exit_done);
          }};
}

int usage_error(const std::string& message, const std::string& command) {
  spdlog::error("platen: {}\nplaten {}--help says what there is", message, command);
  return exit_usage;
}

// The first word of the command line that looks like an option and is none, with the nearest one that there is.
std::optional<std::string> unknown_option(const CLI::App& app, int argc, char** argv) {
  std::vector<std::string> known{"--help", "--version"};
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  for (int k = 1; k < argc; ++k) {
    const std::string word = argv[k], name = word.substr(0, word.find('='));
    if (word == "--") break;
    if (!word.starts_with("--") || std::find(known.begin(), known.end(), name) != known.end()) continue;
    std::string nearest = nearest_word(name, known);
    if (nearest == "--help" && !name.starts_with("--h")) nearest.clear();
    return fmt::format("there is no option {}{}", name, nearest.empty() ? "" : "; did you mean " + nearest + "?");
  }
  return std::nullopt;
}

int run_program(int argc, char** argv) {
  CLI::App program("Discrete element simulation of the uniaxial test of powders: fill, compress, unload, crush.", "platen");
  program.set_version_flag("--version", PLATEN_VERSION, "print the version");
  program.set_help_flag("-h,--help", "print this help");
  program.require_subcommand(1);
  program.footer("platen COMMAND --help explains a command.");
  const std::vector<Command> commands = {add_run(program), add_resume(program), add_check(program), add_law(program), add_study(program),
                                         add_report(program), add_export(program), add_info(program)};
  for (const Command& command : commands) command.app->footer(std::string("Example:\n  ") + command.example);

  if (argc == 1) {
    std::fputs(program.help().c_str(), stderr);
    return exit_usage;
  }
  for (const Command& command : commands)
    if (argc == 2 && command.app->get_name() == argv[1]) {
      std::fputs(command.app->help("platen").c_str(), stderr);
      return exit_usage;
    }
  std::vector<std::string> names;
  for (const Command& command : commands) names.push_back(command.app->get_name());
  if (argv[1][0] != '-' && std::find(names.begin(), names.end(), argv[1]) == names.end()) {
    const std::string nearest = nearest_word(argv[1], names);
    return usage_error(fmt::format("there is no command \"{}\"; allowed: {}{}", argv[1], fmt::join(names, ", "),
                                   nearest.empty() ? "" : "; did you mean " + nearest + "?"), "");
  }
  try {
    program.parse(argc, argv);
  } catch (const CLI::Success& asked) {  // --help, --version
    return program.exit(asked);
  } catch (const CLI::ParseError& error) {
    const auto chosen = program.get_subcommands();
    const CLI::App& app = chosen.empty() ? program : *chosen.front();
    return usage_error(unknown_option(app, argc, argv).value_or(error.what()), chosen.empty() ? "" : app.get_name() + " ");
  }
  for (const Command& command : commands)
    if (command.app->parsed()) {
      try {
        return command.carry_out();
      } catch (const UsageError& error) {
        return usage_error(error.what(), command.app->get_name() + " ");
      }
    }
  return exit_usage;
}

// The promise of the exit codes; a message names file and line itself where there is one.
int guarded(int argc, char** argv) {
  try {
    const int code = run_program(argc, argv);
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) throw OutputError("standard output: cannot write");
    return code;
  } catch (const CaseError& error) {
    spdlog::error("{}", error.what());
    return exit_case;
  } catch (const RunError& error) {
    spdlog::error("{}", error.what());
    return exit_numerical;
  } catch (const OutputError& error) {
    spdlog::error("{}", error.what());
    return exit_io;
  } catch (const std::filesystem::filesystem_error& error) {
    spdlog::error("{}", error.what());
    return exit_io;
  } catch (const std::bad_alloc&) {
    spdlog::error("there is not enough memory for this case");
    return exit_internal;
  } catch (const std::exception& error) {
    spdlog::error("internal error: {}", error.what());
    return exit_internal;
  }
}

}  // namespace
}  // namespace platen

int main(int argc, char** argv) {
  platen::set_up_log();
  return platen::guarded(argc, argv);
}
