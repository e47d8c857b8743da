#include "protocol/study/statements.h"

#include <fmt/format.h>

#include <algorithm>

#include "protocol/study/judge.h"

namespace platen {

const std::vector<std::string>& statement_groups() {
  static const std::vector<std::string> groups{"figures-4-7",  "figures-8-10", "figure-11",    "figures-12-14",
                                               "quasi-static", "similarity-2", "similarity-3", "friction-limit",
                                               "like-reference", "cross-checks"};
  return groups;
}

std::vector<Statement> judge(const StudyPlan& plan, const std::vector<PartResults>& results) {
  std::vector<Statement> out;
  for (const PartResults& part : results) {
    Judge judge(part, out);
    for (const std::string& group : part.plan->study->statements) {
      if (group == "figures-4-7") judge_figures_4_7(judge);
      if (group == "figures-8-10") judge_figures_8_10(judge);
      if (group == "figure-11") judge_figure_11(judge, plan);
      if (group == "figures-12-14") judge_figures_12_14(judge);
      if (group == "quasi-static") judge_quasi_static(judge, plan);
      if (group == "similarity-2") judge_similarity_2(judge);
      if (group == "similarity-3") judge_similarity_3(judge);
      if (group == "friction-limit") judge_friction_limit(judge);
      if (group == "like-reference") judge_like_reference(judge);
      if (group == "cross-checks") judge_cross_checks(judge);
    }
    judge_scans(judge);
  }
  return out;
}

const char* verdict(const Statement& statement) {
  if (!statement.holds) return "not judged";
  return *statement.holds ? "holds" : "does not hold";
}

std::string statements_markdown(const std::vector<Statement>& statements) {
  std::string out = "| study | figure | statement | number | seeds | |\n|---|---|---|---|---|---|\n";
  const auto cell = [](std::string text) {
    for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2) text.replace(at, 1, "\\|");
    return text;
  };
  for (const Statement& s : statements)
    out += fmt::format("| {} | {} | {} | {} | {} | {} |\n", s.part, s.figure, cell(s.text), cell(s.number), s.seeds,
                       s.holds.value_or(true) ? verdict(s) : fmt::format("**{}**", verdict(s)));
  return out;
}

}  // namespace platen
