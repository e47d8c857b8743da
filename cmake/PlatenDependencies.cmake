# Libraries, all of them Debian packages (bootstrap installs them).
find_package(Threads REQUIRED)
find_package(TBB REQUIRED)
find_package(Eigen3 REQUIRED NO_MODULE)
find_package(xsimd REQUIRED)
# Debian's target asks the linker for the optional header-only xtl, which is not installed and not used.
set_target_properties(xsimd PROPERTIES INTERFACE_LINK_LIBRARIES "")
find_package(fmt REQUIRED)
find_package(spdlog REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(CLI11 REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(TOMLPP REQUIRED IMPORTED_TARGET tomlplusplus)
# By its pkg-config name, because CMake's FindHDF5 needs the C language, may pick a parallel HDF5 that is also
# installed, and links every library that h5cc mentions.
pkg_check_modules(HDF5 REQUIRED IMPORTED_TARGET hdf5-serial)
set(HDF5_C_LIBRARIES PkgConfig::HDF5)
find_library(UDUNITS2_LIBRARY udunits2 REQUIRED)
find_library(XXHASH_LIBRARY xxhash REQUIRED)

# Scripts of the report's page.
set(PLATEN_JAVASCRIPT "/usr/share/javascript" CACHE PATH "Folder with chart.js/ and three/")
