// Runs the platen program as a user does: arguments as a list (no shell, so nothing needs quoting), a folder of its
// own, and everything that it prints. PLATEN_PROGRAM is the path of the program, set by CMake.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

extern char** environ;

namespace platen::test {

// A fresh folder under the system's temporary folder; removed at the end. After a failed test it is kept and named on
// standard error, unless told otherwise.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(bool keep_after_failure = true) : keep_after_failure_(keep_after_failure) {
    std::string name = (std::filesystem::temp_directory_path() / "platen-test-XXXXXX").string();
    if (!mkdtemp(name.data())) throw std::runtime_error("mkdtemp: " + std::string(std::strerror(errno)));
    path_ = name;
  }
  ~TemporaryFolder() {
    if (keep_after_failure_ && ::testing::Test::HasFailure()) {
      std::fprintf(stderr, "kept: %s\n", path_.c_str());
      return;
    }
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
  bool keep_after_failure_;
};

inline void write_file(const std::filesystem::path& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
}

inline std::string read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("cannot read " + path.string());
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

// A double as text that reads back to the same bits.
inline std::string exact(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", x);
  return text;
}

struct ProgramResult {
  int exit_code = -1;      // -1 when a signal ended it
  int signal = 0;          // 0 when it exited by itself
  bool timed_out = false;  // killed by run_program
  std::string out, err;
  std::string report() const {
    return "exit " + std::to_string(exit_code) + ", signal " + std::to_string(signal) +
           (timed_out ? ", timed out" : "") + "\n--- standard output\n" + out + "--- standard error\n" + err;
  }
};

struct ProgramOptions {
  std::filesystem::path folder{};                    // working folder; empty: this process's own
  std::map<std::string, std::string> environment{};  // added to, or replacing, this process's variables
  double timeout = 300.0;                            // wall clock [s]
  std::string program = PLATEN_PROGRAM;
};

// A started program, for tests that send it signals. Ended by force if it still runs when this goes away.
class RunningProgram {
 public:
  RunningProgram(const std::vector<std::string>& arguments, const ProgramOptions& options) {
    std::vector<std::string> words{options.program};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<std::string> variables;
    for (char** v = environ; *v; ++v) {
      const std::string entry = *v;
      if (!options.environment.contains(entry.substr(0, entry.find('=')))) variables.push_back(entry);
    }
    for (const auto& [key, value] : options.environment) variables.push_back(key + "=" + value);

    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    const std::string out = (captured_ / "out").string(), err = (captured_ / "err").string();
    const int flags = O_WRONLY | O_CREAT | O_TRUNC;
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, out.c_str(), flags, 0644);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, err.c_str(), flags, 0644);
    if (!options.folder.empty()) posix_spawn_file_actions_addchdir_np(&actions, options.folder.c_str());
    std::vector<char*> argv = pointers(words), envp = pointers(variables);
    const int error = posix_spawn(&pid_, options.program.c_str(), &actions, nullptr, argv.data(), envp.data());
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) {
      pid_ = -1;
      throw std::runtime_error("cannot start " + options.program + ": " + std::strerror(error));
    }
  }
  ~RunningProgram() {
    if (pid_ < 0) return;
    ::kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  // Does nothing once wait() has returned: the process id may belong to somebody else by then.
  void send(int signal_number) {
    if (pid_ >= 0) ::kill(pid_, signal_number);
  }

  // What it has printed so far.
  std::string out() const { return read_file(captured_ / "out"); }
  std::string err() const { return read_file(captured_ / "err"); }

  // Waits for its end, at most `timeout` [s], then kills it.
  ProgramResult wait(double timeout) {
    if (pid_ < 0) throw std::logic_error("the program has ended already");
    ProgramResult result;
    int status = 0;
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout);
    pid_t done;
    while ((done = waitpid(pid_, &status, WNOHANG)) == 0 || (done < 0 && errno == EINTR)) {
      if (!result.timed_out && std::chrono::steady_clock::now() > end) {
        result.timed_out = true;
        ::kill(pid_, SIGKILL);
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    if (done < 0) throw std::runtime_error("waitpid: " + std::string(std::strerror(errno)));
    pid_ = -1;
    if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
    if (WIFSIGNALED(status)) result.signal = WTERMSIG(status);
    result.out = out();
    result.err = err();
    return result;
  }

 private:
  static std::vector<char*> pointers(std::vector<std::string>& words) {
    std::vector<char*> list;
    for (std::string& w : words) list.push_back(w.data());
    list.push_back(nullptr);
    return list;
  }
  TemporaryFolder captured_{false};
  pid_t pid_ = -1;
};

inline ProgramResult run_program(const std::vector<std::string>& arguments, const ProgramOptions& options = {}) {
  return RunningProgram(arguments, options).wait(options.timeout);
}

// A table as platen prints it: one header row, cells `name` or `name [unit]`, commas, no quotes.
struct CsvTable {
  std::vector<std::string> names;  // without units
  std::vector<std::vector<std::string>> rows;

  std::size_t index(const std::string& name) const {
    for (std::size_t k = 0; k < names.size(); ++k)
      if (names[k] == name) return k;
    throw std::runtime_error("no column " + name);
  }
  const std::string& cell(std::size_t row, const std::string& name) const { return rows.at(row).at(index(name)); }
  // NaN for an empty cell; throws when it holds anything else than one number.
  double number(std::size_t row, const std::string& name) const {
    const std::string& text = cell(row, name);
    if (text.empty()) return std::nan("");
    char* end = nullptr;
    const double x = std::strtod(text.c_str(), &end);
    if (*end != '\0') throw std::runtime_error("column " + name + ": not a number: " + text);
    return x;
  }
  std::vector<double> column(const std::string& name) const {
    std::vector<double> values;
    for (std::size_t r = 0; r < rows.size(); ++r) values.push_back(number(r, name));
    return values;
  }
};

// Throws when a row has another number of cells than the header.
inline CsvTable parse_csv(const std::string& text) {
  const auto split = [](const std::string& line) {
    std::vector<std::string> cells(1);
    for (char c : line) {
      if (c == ',') cells.emplace_back();
      else if (c != '\r') cells.back() += c;
    }
    return cells;
  };
  CsvTable table;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty()) continue;
    std::vector<std::string> cells = split(line);
    if (table.names.empty()) {
      for (std::string& name : cells) table.names.push_back(name.substr(0, name.find(" [")));
    } else if (cells.size() != table.names.size()) {
      throw std::runtime_error("a row with " + std::to_string(cells.size()) + " cells: " + line);
    } else {
      table.rows.push_back(std::move(cells));
    }
  }
  return table;
}

inline CsvTable read_csv(const std::filesystem::path& path) { return parse_csv(read_file(path)); }

}  // namespace platen::test
