/// libFuzzer's way in: a program for each target, named at compile time.
#include "fuzz/targets.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  variator_sim::fuzz::VARIATOR_SIM_FUZZ_TARGET(
      std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
