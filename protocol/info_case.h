// What `platen info` says about a case file.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "protocol/case_file.h"

namespace platen {

std::string case_text_summary(const Case& c);
nlohmann::ordered_json case_json_summary(const Case& c);

}  // namespace platen
