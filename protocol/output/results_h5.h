// results.h5: the series, every closed stage and the final state, rewritten whole when a stage closes.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/measures.h"
#include "core/snapshot.h"
#include "protocol/output/series_csv.h"
#include "protocol/records.h"

namespace platen {

struct RunInfo;

struct ResultsContent {
  const SeriesTable& series;
  const std::vector<StageResult>& closed;  // the last one is new, the others are in the file already
  const Snapshot& snapshot;                // at the end of the last stage
  const Profile& profile;
  const RunInfo& info;
  const std::string& case_text;
  const std::string& start_time;  // ISO 8601
};

// Writes the file; stages that closed before are copied from the file's present version. Throws OutputError, the present
// version stays then.
void write_results(const std::filesystem::path& path, const ResultsContent& content);

// Start of the run as an existing results.h5 knows it; empty when there is none.
std::string start_time_of(const std::filesystem::path& path);

// A stage's name as the name of an HDF5 group: "/" would make a path of it.
std::string stage_group_name(const std::string& stage);

}  // namespace platen
