/// Lists in messages to the node, read only where the bytes that came can hold them: roscpp makes
/// room for as many entries as a message says that it has before it looks, so that a dozen bytes
/// would take gigabytes. To be included wherever one of these messages is read, before it is.
#pragma once

#include <dynamic_reconfigure/Config.h>
#include <ros/serialization.h>
#include <variator_sim/Commands.h>
#include <variator_sim/SetState.h>
#include <variator_sim/Step.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace variator_sim {

// The bytes that an entry takes at least: its numbers, and 4 for the length of each text.

inline std::uint32_t leastBytes(const std::string& /*type*/) {
  return 4;
}
inline std::uint32_t leastBytes(double /*type*/) {
  return 8;
}
inline std::uint32_t leastBytes(const dynamic_reconfigure::BoolParameter& /*type*/) {
  return 5;
}
inline std::uint32_t leastBytes(const dynamic_reconfigure::IntParameter& /*type*/) {
  return 8;
}
inline std::uint32_t leastBytes(const dynamic_reconfigure::StrParameter& /*type*/) {
  return 8;
}
inline std::uint32_t leastBytes(const dynamic_reconfigure::DoubleParameter& /*type*/) {
  return 12;
}
inline std::uint32_t leastBytes(const dynamic_reconfigure::GroupState& /*type*/) {
  return 13;
}

// The fields of each message, in their order.

template <class Visit>
void forEachField(const Commands& /*type*/, Visit visit) {
  visit(&Commands::header);
  visit(&Commands::topics);
  visit(&Commands::values);
}
template <class Visit>
void forEachField(const Step::Request& /*type*/, Visit visit) {
  visit(&Step::Request::duration);
  visit(&Step::Request::command_topics);
  visit(&Step::Request::command_values);
}
template <class Visit>
void forEachField(const SetState::Request& /*type*/, Visit visit) {
  visit(&SetState::Request::text);
  visit(&SetState::Request::angle);
  visit(&SetState::Request::velocity);
  visit(&SetState::Request::acceleration);
  visit(&SetState::Request::project);
}
template <class Visit>
void forEachField(const dynamic_reconfigure::Config& /*type*/, Visit visit) {
  visit(&dynamic_reconfigure::Config::bools);
  visit(&dynamic_reconfigure::Config::ints);
  visit(&dynamic_reconfigure::Config::strs);
  visit(&dynamic_reconfigure::Config::doubles);
  visit(&dynamic_reconfigure::Config::groups);
}

template <class Stream, class T>
void readField(Stream& stream, T& field) {
  stream.next(field);
}
/// Throws ros::serialization::StreamOverrunException, as roscpp does where a message is too short.
template <class Stream, class T>
void readField(Stream& stream, std::vector<T>& list) {
  std::uint32_t count = 0;
  if (stream.getLength() >= sizeof count) {
    std::memcpy(&count, stream.getData(), sizeof count);
    const auto rest = static_cast<std::uint32_t>(stream.getLength() - sizeof count);
    if (count > rest / leastBytes(T{})) ros::serialization::throwStreamOverrun();
  }
  stream.next(list);
}

template <class Message>
struct CheckedSerializer {
  template <class Stream>
  static void write(Stream& stream, const Message& message) {
    forEachField(message, [&](auto field) { stream.next(message.*field); });
  }
  template <class Stream>
  static void read(Stream& stream, Message& message) {
    forEachField(message, [&](auto field) { readField(stream, message.*field); });
  }
  static std::uint32_t serializedLength(const Message& message) {
    ros::serialization::LStream stream;
    write(stream, message);
    return stream.getLength();
  }
};

}  // namespace variator_sim

namespace ros::serialization {

template <>
struct Serializer<variator_sim::Commands>
    : variator_sim::CheckedSerializer<variator_sim::Commands> {};
template <>
struct Serializer<variator_sim::Step::Request>
    : variator_sim::CheckedSerializer<variator_sim::Step::Request> {};
template <>
struct Serializer<variator_sim::SetState::Request>
    : variator_sim::CheckedSerializer<variator_sim::SetState::Request> {};
template <>
struct Serializer<dynamic_reconfigure::Config>
    : variator_sim::CheckedSerializer<dynamic_reconfigure::Config> {};

}  // namespace ros::serialization
