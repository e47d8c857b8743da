// A study and its base case in a folder of their own, and what is wrong with them as their user reads it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "protocol/study/plan.h"
#include "protocol/study/study_file.h"
#include "tests/program.h"

namespace platen::test {

struct StudyFolder {
  TemporaryFolder folder;
  StudyFolder(const std::string& study, const std::string& base) {
    write_file(folder / "tiny.toml", base);
    write_file(folder / "study.toml", study);
  }
  std::filesystem::path file() const { return folder / "study.toml"; }
  // Arguments of the program.
  std::vector<std::string> words(const std::string& results, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> out{"study", file().string(), "-o", (folder / results).string(), "--jobs", "2"};
    out.insert(out.end(), more.begin(), more.end());
    return out;
  }
};

inline std::string complaint(const std::string& study, const std::string& base) {
  const StudyFolder folder(study, base);
  try {
    const Study s = read_study(folder.file());
    make_plan(s);
  } catch (const CaseError& error) {
    return error.what();
  }
  return "nothing";
}

}  // namespace platen::test
