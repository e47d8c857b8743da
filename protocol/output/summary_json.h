// summary.json: what a script wants to know about a finished run.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/records.h"

namespace platen {

// The text of summary.json; keys in docs/output.md. A key without meaning for a stage is left out.
std::string summary_json(int exit_code, std::optional<std::uint64_t> state_hash, const Performance& performance,
                         const std::vector<StageResult>& stages);

}  // namespace platen
