// The one error of everything that reads or writes files of a run; the program ends with exit code 5.
#pragma once

#include <stdexcept>
#include <string>

namespace platen {

// what() names the path and the system's reason: `runs/a/series.csv: cannot write: No space left on device`.
class OutputError : public std::runtime_error {
 public:
  explicit OutputError(const std::string& message) : std::runtime_error(message) {}
};

}  // namespace platen
