// What the paper says its figures show, and what dimensional analysis demands, judged by the runs: one line each.
// The bands are those of docs/studies.md, "Statements".
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "protocol/study/analysis.h"

namespace platen {

struct Statement {
  std::string part;           // name of the study
  std::string figure;         // "4", "filling", "S2"
  std::string text;           // what must hold
  std::string number;         // what was found
  std::optional<bool> holds;  // empty: cannot be judged, `number` says why, or a figure without a bar
  int seeds = 0;              // of the curve of the study that has fewest
};

// Names that a study may ask for: figures-4-7, figures-8-10, figure-11, figures-12-14, quasi-static, similarity-2,
// similarity-3, friction-limit, like-reference, cross-checks.
const std::vector<std::string>& statement_groups();

// All groups that the parts ask for, and for every scan whether the power that the paper names is the best.
std::vector<Statement> judge(const StudyPlan& plan, const std::vector<PartResults>& results);

// A table for people, ends with a newline.
std::string statements_markdown(const std::vector<Statement>& statements);

const char* verdict(const Statement& statement);  // "holds", "does not hold", "not judged"

}  // namespace platen
