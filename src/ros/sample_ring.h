/// A bounded queue between one producer and one consumer that never makes the producer wait: when
/// it is full, the oldest entries are overwritten.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace variator_sim {

/// boost::lockfree::spsc_queue refuses the newest entry when full, and its oldest can be taken by
/// the consumer only; a state that is shown late is worth less than a new one. So each slot here is
/// a sequence lock: the producer marks it odd, writes, and marks it with the entry's number; the
/// consumer copies and then looks whether the mark is still that number. The payload is copied in
/// atomic words, so that an overwritten copy is stale and no data race.
template <class T, std::size_t kCapacity>
class SampleRing {
  static_assert(std::is_trivially_copyable_v<T>, "entries are copied word by word");

 public:
  /// Producer only. Wait-free, allocates nothing. [loop]
  void push(const T& entry) {
    const std::uint64_t number = written_.load(std::memory_order_relaxed);
    Slot& slot = slots_[number % kCapacity];
    std::array<std::uint64_t, kWords> words{};
    std::memcpy(words.data(), &entry, sizeof(T));
    slot.mark.store(2 * number + 1, std::memory_order_relaxed);
    // A reader that sees one of these words also sees the odd mark above.
    for (std::size_t i = 0; i < kWords; ++i) {
      slot.words[i].store(words[i], std::memory_order_release);
    }
    slot.mark.store(2 * number + 2, std::memory_order_release);
    written_.store(number + 1, std::memory_order_release);
  }

  /// Consumer only. False when there is nothing new.
  bool pop(T& entry) {
    for (;;) {
      const std::uint64_t written = written_.load(std::memory_order_acquire);
      if (read_ == written) return false;
      if (written - read_ > kCapacity) {
        drop(written - read_ - kCapacity);
        read_ = written - kCapacity;
      }
      const std::uint64_t number = read_++;
      const Slot& slot = slots_[number % kCapacity];
      if (slot.mark.load(std::memory_order_acquire) == 2 * number + 2) {
        std::array<std::uint64_t, kWords> words;
        for (std::size_t i = 0; i < kWords; ++i) {
          words[i] = slot.words[i].load(std::memory_order_acquire);
        }
        if (slot.mark.load(std::memory_order_relaxed) == 2 * number + 2) {
          std::memcpy(static_cast<void*>(&entry), words.data(), sizeof(T));
          return true;
        }
      }
      drop(1);  // overwritten before or while it was copied
    }
  }

  /// Entries overwritten unread so far. For any thread.
  std::uint64_t dropped() const { return dropped_.load(std::memory_order_relaxed); }

 private:
  void drop(std::uint64_t count) { dropped_.fetch_add(count, std::memory_order_relaxed); }

  static constexpr std::size_t kWords = (sizeof(T) + 7) / 8;
  struct Slot {
    std::atomic<std::uint64_t> mark{0};
    std::array<std::atomic<std::uint64_t>, kWords> words{};
  };

  std::array<Slot, kCapacity> slots_{};
  alignas(64) std::atomic<std::uint64_t> written_{0};
  alignas(64) std::uint64_t read_ = 0;
  std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace variator_sim
