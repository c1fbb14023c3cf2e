/// Restricts the addresses on which a node's ports are open. If ROS_HOSTNAME or ROS_IP names the
/// loopback interface, roscpp binds its topics and services to it, but opens its XML-RPC port, by
/// which any client can shut a node down, on all interfaces. This bind() replaces the C library's:
/// xmlrpcpp has no other way to choose the address.
#include <arpa/inet.h>
#include <dlfcn.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cstdlib>
#include <cstring>
#include <initializer_list>

namespace {

bool isThisMachine(const char* name) {
  return std::strcmp(name, "localhost") == 0 || std::strncmp(name, "127.", 4) == 0 ||
         std::strcmp(name, "::1") == 0;
}

/// ROS_HOSTNAME takes precedence over ROS_IP.
bool isForThisMachineOnly() {
  for (const char* variable : {"ROS_HOSTNAME", "ROS_IP"}) {
    const char* name = std::getenv(variable);
    if (name != nullptr && *name != '\0') return isThisMachine(name);
  }
  return false;
}

/// Returns `address`, with the loopback interface in place of all interfaces.
sockaddr_storage restricted(const sockaddr* address, socklen_t length) {
  sockaddr_storage to{};
  std::memcpy(&to, address, length);
  if (to.ss_family == AF_INET) {
    auto& v4 = reinterpret_cast<sockaddr_in&>(to);
    if (v4.sin_addr.s_addr == htonl(INADDR_ANY)) v4.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  } else if (to.ss_family == AF_INET6) {
    auto& v6 = reinterpret_cast<sockaddr_in6&>(to);
    if (IN6_IS_ADDR_UNSPECIFIED(&v6.sin6_addr)) v6.sin6_addr = in6addr_loopback;
  }
  return to;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) int bind(int socket, const sockaddr* address,
                                                           socklen_t length) noexcept {
  using Bind = int (*)(int, const sockaddr*, socklen_t);
  static const auto next = reinterpret_cast<Bind>(::dlsym(RTLD_NEXT, "bind"));
  if (address == nullptr || length > sizeof(sockaddr_storage) || !isForThisMachineOnly()) {
    return next(socket, address, length);
  }
  const sockaddr_storage to = restricted(address, length);
  return next(socket, reinterpret_cast<const sockaddr*>(&to), length);
}
