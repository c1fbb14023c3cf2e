#include "make_motion.h"

namespace variator_sim {

template std::unique_ptr<Motion> makeMotion<6>(Scene scene);

}  // namespace variator_sim
