// From the tree of a case file to a Case, section by section, and the checks that need more than one section.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "protocol/case_document.h"
#include "protocol/case_file.h"
#include "protocol/case_reader.h"

namespace platen {

// What the later checks need to know of the reading beside the values themselves: a check is only made on values that
// were read well, so that one mistake gives one message.
struct CaseFacts {
  CaseUse use = CaseUse::run;
  std::filesystem::path folder;  // where particle files are looked for
  Position file, particles, count, particle_file, box, width, depth, height, sides;
  bool has_count = false, has_file = false;
  bool sizes_good = false;   // largest() has a meaning
  bool box_present = false;  // there is a [box]
  bool width_good = false, depth_good = false, height_good = false, sides_good = false;
  bool plates_good = false;
  bool gravity_good = false;
  std::vector<Position> stage;          // of the kind of each stage
  std::vector<bool> stage_good;         // its kind is known
  std::vector<std::string> stage_path;  // "stage.compress"
};

// All tables but the stages.
void read_sections(TableReader& root, Case& c, CaseFacts& facts, Problems& problems);

// The list `stage`. A broken stage still takes its place in c.stages.
void read_stages(const CaseEntry* entry, Case& c, CaseFacts& facts, Problems& problems);

// What no section can see alone; reads the particle file too.
void check_case(Case& c, const CaseFacts& facts, Problems& problems);

}  // namespace platen
