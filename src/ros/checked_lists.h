/// Reads lists in messages only if the received bytes can hold them: roscpp allocates as many
/// entries as a message claims before it checks, so that a dozen bytes would take gigabytes.
/// Include it before each of these messages.
#pragma once

#include <dynamic_reconfigure/Config.h>
#include <ros/serialization.h>
#include <variator_sim/Commands.h>
#include <variator_sim/SetState.h>
#include <variator_sim/Step.h>

#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

namespace variator_sim {

/// Reads fields from a stream of roscpp, lists only if they fit.
template <class Stream>
class CheckedReader {
 public:
  explicit CheckedReader(Stream& stream) : stream_(stream) {}

  template <class T>
  void next(T& field) {
    stream_.next(field);
  }
  /// Throws ros::serialization::StreamOverrunException, as roscpp does where a message is too
  /// short.
  template <class T>
  void next(std::vector<T>& list) {
    std::uint32_t count = 0;
    if (stream_.getLength() >= sizeof count) {
      // An empty entry is the shortest: its numbers, and 4 bytes for the length of each text.
      const std::uint32_t least = ros::serialization::serializationLength(T{});
      std::memcpy(&count, stream_.getData(), sizeof count);
      const auto rest = static_cast<std::uint32_t>(stream_.getLength() - sizeof count);
      if (count > rest / least) ros::serialization::throwStreamOverrun();
    }
    stream_.next(list);
  }

 private:
  Stream& stream_;
};

/// Reads checked lists by the generated field list, instantiated for another allocator.
template <template <class> class Message>
struct CheckedSerializer : ros::serialization::Serializer<Message<std::allocator<char>>> {
  template <class Stream, class T>
  static void read(Stream& stream, T& message) {
    CheckedReader<Stream> reader(stream);
    CheckedSerializer::template allInOne<CheckedReader<Stream>, T&>(reader, message);
  }
};

}  // namespace variator_sim

namespace ros::serialization {

template <>
struct Serializer<variator_sim::Commands>
    : variator_sim::CheckedSerializer<variator_sim::Commands_> {};
template <>
struct Serializer<variator_sim::Step::Request>
    : variator_sim::CheckedSerializer<variator_sim::StepRequest_> {};
template <>
struct Serializer<variator_sim::SetState::Request>
    : variator_sim::CheckedSerializer<variator_sim::SetStateRequest_> {};
template <>
struct Serializer<dynamic_reconfigure::Config>
    : variator_sim::CheckedSerializer<dynamic_reconfigure::Config_> {};

}  // namespace ros::serialization
