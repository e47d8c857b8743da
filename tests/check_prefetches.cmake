# The machine code of AskForOthers::chunk [kernels/ask_ahead.h] asks for something, and somebody calls it: g++ 12 leaves out calls of a
# function in which it sees nothing but prefetches, and no result would tell. So do the motion kernels [kernels/motion_kernel.h].
#
#   cmake -DOBJDUMP=objdump -DOBJECTS=a.o,b.o -P check_prefetches.cmake      looks at every object named isa_<set>
string(REPLACE "," ";" objects "${OBJECTS}")
set(looked 0)
foreach(object IN LISTS objects)
  if(NOT object MATCHES "isa_[0-9a-z]*[.]cpp[.]o$")
    continue()
  endif()
  execute_process(COMMAND ${OBJDUMP} -dr --no-show-raw-insn ${object}
    COMMAND awk "/>:$/ {inside = /AskForOthers/ && /chunk/} inside && /prefetch/ {++asks} !inside && /R_X86_64_(PLT32|PC32).*AskForOthers.*chunk/ {++calls} END {print (asks > 0) + 2 * (calls > 0)}"
    OUTPUT_VARIABLE found OUTPUT_STRIP_TRAILING_WHITESPACE RESULTS_VARIABLE status)
  if(NOT status STREQUAL "0;0")
    message(FATAL_ERROR "${OBJDUMP} cannot read ${object}")
  elseif(NOT found EQUAL 3)
    message(FATAL_ERROR "AskForOthers::chunk of ${object} has no prefetch, or nobody calls it")
  endif()
  if(NOT object MATCHES "isa_scalar")  # single numbers are never waited for
    execute_process(COMMAND ${OBJDUMP} -d --no-show-raw-insn ${object}
      COMMAND awk "/>:$/ {inside = /motion_kernel/ && !/[.]cold/ && !/Ul/; kernels += inside; asks = 0} inside && /prefetch/ && !asks {asks = 1; ++asking} END {print (kernels > 0 && asking == kernels)}"
      OUTPUT_VARIABLE found OUTPUT_STRIP_TRAILING_WHITESPACE)
    if(NOT found EQUAL 1)
      message(FATAL_ERROR "a motion kernel of ${object} has no prefetch")
    endif()
  endif()
  math(EXPR looked "${looked} + 1")
endforeach()
if(looked EQUAL 0)
  message(FATAL_ERROR "no object of an instruction set among ${OBJECTS}")
endif()
message(STATUS "${looked} objects looked at")
