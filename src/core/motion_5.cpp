#include "make_motion.h"

namespace variator_sim {

template std::unique_ptr<Motion> makeMotion<5>(Scene scene);

}  // namespace variator_sim
