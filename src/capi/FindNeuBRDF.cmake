# Finds neubrdf where `make install` put it:
#
#   list(APPEND CMAKE_MODULE_PATH /usr/local/share/neubrdf/cmake)
#   find_package(NeuBRDF REQUIRED)
#   find_package(Vulkan REQUIRED)                                               # its header is what ours includes
#   target_link_libraries(engine PRIVATE NeuBRDF::NeuBRDF Vulkan::Vulkan)       # or NeuBRDF::Static
#
# NeuBRDF_ROOT names another prefix.
get_filename_component(NeuBRDF_PREFIX "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
find_path(NeuBRDF_INCLUDE_DIR neubrdf.h HINTS "${NeuBRDF_PREFIX}/include")
find_library(NeuBRDF_LIBRARY NAMES libneubrdf.so HINTS "${NeuBRDF_PREFIX}/lib")
find_library(NeuBRDF_STATIC_LIBRARY NAMES libneubrdf.a HINTS "${NeuBRDF_PREFIX}/lib")

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(NeuBRDF REQUIRED_VARS NeuBRDF_LIBRARY NeuBRDF_INCLUDE_DIR)
mark_as_advanced(NeuBRDF_INCLUDE_DIR NeuBRDF_LIBRARY NeuBRDF_STATIC_LIBRARY)

if(NeuBRDF_FOUND AND NOT TARGET NeuBRDF::NeuBRDF)
  add_library(NeuBRDF::NeuBRDF SHARED IMPORTED)
  set_target_properties(NeuBRDF::NeuBRDF PROPERTIES
    IMPORTED_LOCATION "${NeuBRDF_LIBRARY}"
    IMPORTED_NO_SONAME TRUE
    INTERFACE_INCLUDE_DIRECTORIES "${NeuBRDF_INCLUDE_DIR}")
endif()
if(NeuBRDF_FOUND AND NeuBRDF_STATIC_LIBRARY AND NOT TARGET NeuBRDF::Static)
  add_library(NeuBRDF::Static STATIC IMPORTED)
  set_target_properties(NeuBRDF::Static PROPERTIES
    IMPORTED_LOCATION "${NeuBRDF_STATIC_LIBRARY}"
    INTERFACE_LINK_LIBRARIES "stdc++;gcc_s;util;rt;pthread;m;dl"
    INTERFACE_INCLUDE_DIRECTORIES "${NeuBRDF_INCLUDE_DIR}")
endif()
