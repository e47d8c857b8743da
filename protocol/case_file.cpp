#include "protocol/case_file.h"

#include <algorithm>
#include <fstream>
#include <iterator>

#include "protocol/case_document.h"
#include "protocol/case_overrides.h"
#include "protocol/case_reader.h"
#include "protocol/case_sections.h"

namespace platen {
namespace {

// What was changed, for people who read the run folder. Control characters may not stand in a TOML comment.
std::string comment(const std::vector<std::string>& overrides) {
  std::string out;
  for (const std::string& override_text : overrides) {
    std::string line = override_text;
    std::replace_if(
        line.begin(), line.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, ' ');
    out += "# --set " + line + "\n";
  }
  return out + "\n";
}

}  // namespace

double SizeDistribution::largest() const {
  switch (kind) {
    case Kind::mono:
      return radius;
    case Kind::list: {
      double R = 0.0;
      for (std::size_t i = 0; i < radii.size(); ++i) {
        if (i >= weights.size() || weights[i] > 0.0) R = std::max(R, radii[i]);
      }
      return R;
    }
    case Kind::cumulative: {
      std::size_t i = radii.size() - 1;
      while (i > 1 && !(below[i] > below[i - 1])) --i;  // nothing is made where the curve is flat
      return radii[i];
    }
    default:
      return max;
  }
}

double SizeDistribution::smallest() const {
  switch (kind) {
    case Kind::mono:
      return radius;
    case Kind::list: {
      double R = largest();
      for (std::size_t i = 0; i < radii.size(); ++i) {
        if (i >= weights.size() || weights[i] > 0.0) R = std::min(R, radii[i]);
      }
      return R;
    }
    case Kind::cumulative: {
      std::size_t i = 0;
      while (i + 2 < radii.size() && !(below[i + 1] > below[i])) ++i;
      return radii[i];
    }
    default:
      return min;
  }
}

const char* to_string(Sides sides) {
  switch (sides) {
    case Sides::periodic:
      return "periodic";
    case Sides::walls:
      return "walls";
    case Sides::open:
      return "open";
  }
  return "";
}

Case parse_case(const std::string& text, const std::string& name, const std::filesystem::path& folder,
                const std::vector<std::string>& overrides, CaseUse use) {
  CaseValue document = parse_document(text, name);
  Problems problems;
  for (const std::string& override_text : overrides) apply_override(document, override_text, problems);

  Case c;
  CaseFacts facts;
  facts.use = use;
  facts.folder = folder;
  facts.file = {name, 1, 1};
  if (const CaseEntry* study = document.find("study"))
    throw CaseError(to_string(study->where) + ": [study]: this is a study, not a case; use `platen study`, or its `base` as the case");
  TableReader root(&document, "", facts.file, problems);
  read_sections(root, c, facts, problems);
  check_case(c, facts, problems);
  if (!problems.empty()) throw CaseError(problems.text());
  c.text = overrides.empty() ? text : comment(overrides) + to_toml(document);
  c.file = folder / name;
  return c;
}

Case read_case(const std::filesystem::path& file, const std::vector<std::string>& overrides, CaseUse use) {
  std::error_code error;
  if (std::filesystem::is_directory(file, error)) {
    throw CaseError(file.string() + ": is a folder; allowed: a case file");
  }
  std::ifstream in(file, std::ios::binary);
  if (!in) {
    throw CaseError(file.string() + (std::filesystem::exists(file, error) ? ": cannot be read" : ": does not exist") +
                    "; allowed: a case file");
  }
  const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  if (in.bad()) throw CaseError(file.string() + ": cannot be read to its end; allowed: a case file");
  Case c = parse_case(text, file.string(), file.parent_path(), overrides, use);
  c.file = file;
  return c;
}

}  // namespace platen
