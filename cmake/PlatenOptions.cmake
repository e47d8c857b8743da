# Compiler options shared by every target, through the interface target platen_options.
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Debug, Release or RelWithDebInfo" FORCE)
endif()
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)

# Debian's own Python, because python3-h5py is installed for that one; another python3 may come first on the PATH.
set(PLATEN_PYTHON /usr/bin/python3 CACHE FILEPATH "Python 3 with h5py, used by tests only")

add_library(platen_options INTERFACE)
target_include_directories(platen_options INTERFACE ${CMAKE_SOURCE_DIR})
# Contraction is off for the whole build: fma stands where it is written, so every build gives the same bits.
# Paths are mapped away so that builds are reproducible.
target_compile_options(platen_options INTERFACE
  -ffp-contract=off -fno-math-errno -fno-trapping-math
  -ffile-prefix-map=${CMAKE_SOURCE_DIR}=. -ffile-prefix-map=${CMAKE_BINARY_DIR}=build
  -Wall -Wextra -Wpedantic -Wshadow
  -Wno-restrict)  # g++ 12 sees overlapping copies in std::string + const char*
if(PLATEN_SANITIZE)
  # A finding ends the program, so that a test cannot pass over it.
  target_compile_options(platen_options INTERFACE
    -fsanitize=${PLATEN_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(platen_options INTERFACE -fsanitize=${PLATEN_SANITIZE})
endif()
