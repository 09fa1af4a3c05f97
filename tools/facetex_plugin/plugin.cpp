// facetex.imageio.so: OpenImageIO, and all that is built on it, opens .facetex files when this plugin's folder is on
// OIIO_LIBRARY_PATH.

#include <OpenImageIO/imageio.h>

#include "cache/facetex_source.h"

extern "C" {

OIIO_EXPORT int facetex_imageio_version = OIIO_PLUGIN_VERSION;
OIIO_EXPORT const char* facetex_imageio_library_version() { return "Spillway"; }
OIIO_EXPORT OIIO::ImageInput* facetex_input_imageio_create() {
  return static_cast<OIIO::ImageInput*>(spillway::cache::make_facetex_input());
}
OIIO_EXPORT const char* facetex_input_extensions[] = {"facetex", nullptr};

}
