/// A bounded queue between one producer and one consumer that never makes the producer wait: when
/// it is full, the oldest entries are overwritten.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <type_traits>

namespace variator_sim {

/// boost::lockfree::spsc_queue refuses the newest entry when full, and its oldest can be taken by
/// the consumer only; a state that is shown late is worth less than a new one. So each slot here is
/// a sequence lock: the producer marks it odd, writes, and marks it with the entry's number; the
/// consumer copies and then checks that the mark is still that number. The payload is copied in
/// atomic words, so that an overwritten copy is stale and no data race.
///
/// An entry may be followed by numbers, whose count is known at run time.
template <class T, std::size_t kCapacity>
class SampleRing {
  static_assert(std::is_trivially_copyable_v<T>, "entries are copied word by word");

 public:
  /// At most `most_numbers` numbers follow an entry.
  explicit SampleRing(std::size_t most_numbers = 0)
      : most_numbers_(most_numbers),
        stride_(kHeader + kWords + most_numbers),
        words_(std::make_unique<std::atomic<std::uint64_t>[]>(kCapacity * stride_)) {}

  /// Producer only. Wait-free, allocates nothing. [loop]
  void push(const T& entry, const double* numbers = nullptr, std::size_t number_count = 0) {
    const std::uint64_t number = written_.load(std::memory_order_relaxed);
    std::atomic<std::uint64_t>* slot = slotOf(number);
    slot[kMark].store(2 * number + 1, std::memory_order_relaxed);
    // A reader that sees one of the words below also sees the odd mark above.
    slot[kCount].store(number_count, std::memory_order_release);
    std::array<std::uint64_t, kWords> words{};
    std::memcpy(words.data(), &entry, sizeof(T));
    for (std::size_t i = 0; i < kWords; ++i) {
      slot[kHeader + i].store(words[i], std::memory_order_release);
    }
    for (std::size_t i = 0; i < number_count; ++i) {
      std::uint64_t word;
      std::memcpy(&word, numbers + i, sizeof(word));
      slot[kHeader + kWords + i].store(word, std::memory_order_release);
    }
    slot[kMark].store(2 * number + 2, std::memory_order_release);
    written_.store(number + 1, std::memory_order_release);
  }

  /// Consumer only. Returns false when there is no new entry. `numbers`, unless null, has room for
  /// the maximum; numbers beyond the entry's own are undefined.
  bool pop(T& entry, double* numbers = nullptr) {
    for (;;) {
      const std::uint64_t written = written_.load(std::memory_order_acquire);
      if (read_ == written) return false;
      if (written - read_ > kCapacity) {
        drop(written - read_ - kCapacity);
        read_ = written - kCapacity;
      }
      const std::uint64_t number = read_++;
      const std::atomic<std::uint64_t>* slot = slotOf(number);
      if (slot[kMark].load(std::memory_order_acquire) == 2 * number + 2) {
        std::array<std::uint64_t, kWords> words;
        for (std::size_t i = 0; i < kWords; ++i) {
          words[i] = slot[kHeader + i].load(std::memory_order_acquire);
        }
        const std::size_t count = slot[kCount].load(std::memory_order_acquire);
        for (std::size_t i = 0; numbers != nullptr && i < std::min(count, most_numbers_); ++i) {
          const std::uint64_t word = slot[kHeader + kWords + i].load(std::memory_order_acquire);
          std::memcpy(numbers + i, &word, sizeof(word));
        }
        if (slot[kMark].load(std::memory_order_relaxed) == 2 * number + 2) {
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
  // A slot: its mark, how many numbers it has, the words of the entry, the numbers.
  static constexpr std::size_t kMark = 0;
  static constexpr std::size_t kCount = 1;
  static constexpr std::size_t kHeader = 2;
  static constexpr std::size_t kWords = (sizeof(T) + 7) / 8;

  void drop(std::uint64_t count) { dropped_.fetch_add(count, std::memory_order_relaxed); }

  std::atomic<std::uint64_t>* slotOf(std::uint64_t number) const {
    return words_.get() + (number % kCapacity) * stride_;
  }

  const std::size_t most_numbers_;
  const std::size_t stride_;
  const std::unique_ptr<std::atomic<std::uint64_t>[]> words_;
  alignas(64) std::atomic<std::uint64_t> written_{0};
  alignas(64) std::uint64_t read_ = 0;
  std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace variator_sim
