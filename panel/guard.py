"""Access control of the panel.

On the loopback address: requests by a name of the loopback address (a page of another
host whose name was made to mean 127.0.0.1, DNS rebinding, asks by its own name) and, in a browser,
from the panel's own page (Origin). Beyond it, also a token is needed: once in the address, then in
a cookie that other pages cannot make a browser send.
"""

import hmac
import ipaddress
import urllib.parse

LOOPBACK_NAMES = {"localhost", "127.0.0.1", "::1"}


def is_loopback(address):
    if address == "localhost":
        return True
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return False


def host_name(host):
    """The name in a Host header, without the port; "" where there is none."""
    try:
        return urllib.parse.urlsplit("//" + host).hostname or ""
    except ValueError:
        return ""


class Guard:
    """`address` is what is listened on, `names` are further names the panel may be asked for by."""

    def __init__(self, address, names=(), token=None):
        self.names = LOOPBACK_NAMES | {name.lower() for name in names}
        if not is_loopback(address):
            if not token:
                raise ValueError(f"beyond the loopback address ({address}) a token is needed")
            if not ipaddress.ip_address(address).is_unspecified:
                self.names.add(address)
        self._unspecified = address in ("0.0.0.0", "::")
        self.token = token

    def allows_host(self, host):
        name = host_name(host)
        if name in self.names:
            return True
        if not self._unspecified:
            return False
        # Any address of this machine by number: a number cannot be rebound.
        try:
            ipaddress.ip_address(name)
            return True
        except ValueError:
            return False

    @staticmethod
    def allows_origin(origin, host):
        """A browser tells whose page asks; other programs tell nothing. Raises ValueError where that is
        no address."""
        return origin is None or urllib.parse.urlsplit(origin).netloc.lower() == host.lower()

    def allows_token(self, token):
        if self.token is None:
            return True
        return token is not None and hmac.compare_digest(token.encode(), self.token.encode())
