// `--set KEY.PATH=VALUE`: changes to a case before it is read.
#pragma once

#include <string>

#include "protocol/case_document.h"
#include "protocol/case_reader.h"

namespace platen {

// Puts the value into the tree; tables on the way are made. VALUE is TOML; what is not valid TOML is taken as a string,
// because shells eat quotes. Stages are found by name or, if none has that name, by number from 1.
// What is wrong with the override itself goes to problems; unknown keys are found when the tree is read.
void apply_override(CaseValue& root, const std::string& override_text, Problems& problems);

}  // namespace platen
