// The fuzzer of .ptx files. See docs/testing.md.

#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/ptx_entry.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string fault = spillway::pipeline::fault_of_ptx({reinterpret_cast<const char*>(data), size});
  if (fault.empty()) return 0;
  std::fprintf(stderr, "%s\n", fault.c_str());
  std::abort();
}
