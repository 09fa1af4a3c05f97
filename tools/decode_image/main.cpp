// The process that an ImageDecoder starts: its standard input is a socket to the program that packs a scene.

#include <OpenImageIO/imageio.h>
#include <unistd.h>

#include <csignal>

#include "pipeline/pack/image_decoder.h"

int main() {
  // An interrupt goes to the whole group; the program that packs decides, and closes the socket.
  std::signal(SIGINT, SIG_IGN);
  OIIO::attribute("threads", 1);  // side by side with others of its kind
  spillway::pipeline::serve_image_decoder(STDIN_FILENO);
}
