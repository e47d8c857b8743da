// A command line that cannot be carried out as it stands; the program ends with exit code 2.
#pragma once

#include <stdexcept>

namespace platen {

class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace platen
