"""The simulated autopilot's UDP link: carries a MAVLink face's bytes to the application and to whoever writes to it.

As PX4's offboard link in SITL it sends to the application's port from a port of its own, and answers every station that
writes to that port.
"""

import socket

from sitl.mavlink import MavlinkFace

_OWN_PORT_OFFSET = 40  # PX4: 14580 speaks to 14540
_LAST_PORT = 65535

Address = tuple[str, int]


class UdpLink:
    """One face's sockets. Use it as a context manager, or `close` it. `service` never blocks."""

    def __init__(self, face: MavlinkFace, port: int, host: str = "127.0.0.1") -> None:
        """Speak to `host`:`port` from port + 40; raises OSError with a sentence when it cannot have that port."""
        self._face = face
        if port + _OWN_PORT_OFFSET > _LAST_PORT:
            raise OSError(
                f"UDP port {port} leaves none for the simulated autopilot, which speaks from {_OWN_PORT_OFFSET} above; "
                f"choose a port up to {_LAST_PORT - _OWN_PORT_OFFSET}"
            )
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind(("127.0.0.1", port + _OWN_PORT_OFFSET))
        except OSError as error:
            self._socket.close()
            raise OSError(
                f"UDP port {port + _OWN_PORT_OFFSET} for the simulated autopilot cannot be had ({error.strerror}); "
                "end the other simulation or choose another port"
            ) from error
        # The application is spoken to unasked, other stations once they were heard.
        self._stations: list[Address] = [(host, port)]

    def __enter__(self) -> "UdpLink":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the port."""
        self._socket.close()

    def service(self) -> None:
        """Hand on what came, and send what is due."""
        while True:
            try:
                data, address = self._socket.recvfrom(65535)
            except (BlockingIOError, ConnectionRefusedError):
                break
            if address not in self._stations:
                self._stations.append(address)
            self._face.receive(data)
        for packet in self._face.service():
            for station in self._stations:
                try:
                    self._socket.sendto(packet, station)
                except OSError:
                    continue  # a full queue or a station that went away loses messages, as any UDP link does
