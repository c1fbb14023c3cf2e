/// How messages come to subscribers.
#pragma once

namespace variator_sim {

/// Whether messages are handed to subscribers in the same process as they are. Then each message is
/// a new one; otherwise one is filled again and again.
enum class Sharing { kNothing, kMessages };

}  // namespace variator_sim
