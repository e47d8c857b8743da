// What a run says while it goes: a line rewritten in place on a terminal, a line every ten seconds elsewhere, and one
// that stays for each closed stage.
#pragma once

#include <cstddef>
#include <cstdio>
#include <string>
#include <vector>

#include "protocol/experiment.h"
#include "protocol/records.h"

namespace platen {

// "0.4 s", "12 s", "3 min 20 s", "2 h 05 min", "3 d 4 h".
std::string duration_text(double seconds);

// One line of at most `columns` characters: stage, how far, simulated time, stress, strain, porosity, coordination
// number, speed, time left. What does not fit is left out, the least wanted first.
std::string progress_line(const Progress& progress, std::size_t columns);

// The line that stays when a stage is closed; `number` from 1.
std::string stage_line(const StageResult& stage, int number, int stages);

class ProgressPrinter {
 public:
  enum class Style { quiet, lines, in_place };
  // `stages`: the names of the case's stages, in order.
  ProgressPrinter(std::FILE* stream, Style style, std::vector<std::string> stages);
  ~ProgressPrinter() { clear(); }
  ProgressPrinter(const ProgressPrinter&) = delete;
  ProgressPrinter& operator=(const ProgressPrinter&) = delete;

  void update(const Progress& progress);
  void stage_closed(const StageResult& stage);
  void clear();  // takes the line in place away, before something else is printed

 private:
  std::FILE* stream_;
  Style style_;
  std::vector<std::string> stages_;
  double next_ = 0.0;     // wall clock of the run at which the next line is due [s]
  bool started_ = false;
  bool shown_ = false;    // a line in place stands on the screen
};

// How to print to a stream: in place on a terminal that can, unless told to be quiet.
ProgressPrinter::Style progress_style(std::FILE* stream, bool quiet);

// Whether a stream may be coloured: a terminal, and NO_COLOR is not set.
bool may_colour(std::FILE* stream);

}  // namespace platen
