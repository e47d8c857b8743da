// The tables of a study: CSV files and study.h5 (docs/studies.md lists them). Nothing in them depends on when or how
// often the study was started, run times apart, which have tables of their own.
#pragma once

#include <filesystem>
#include <vector>

#include "protocol/study/analysis.h"
#include "protocol/study/statements.h"

namespace platen {

// Where tables and figures of a part go: the study's own folder, or one for each part where there are several.
std::filesystem::path part_folder(const std::filesystem::path& folder, const StudyPlan& plan, const PlannedPart& part);

// All members throw OutputError.
void write_run_table(const std::filesystem::path& folder, const StudyPlan& plan,
                     const std::vector<JobOutcome>& outcomes);
void write_part_tables(const std::filesystem::path& folder, const StudyPlan& plan, const PartResults& part);
void write_statements(const std::filesystem::path& folder, const std::vector<Statement>& statements);
void write_study_h5(const std::filesystem::path& folder, const StudyPlan& plan,
                    const std::vector<PartResults>& results, const std::vector<Statement>& statements);

}  // namespace platen
