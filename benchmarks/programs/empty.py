"""An empty uvloop DatagramProtocol: what receiving costs at least, without any work."""

import asyncio
import json
import socket

import uvloop


class Nothing(asyncio.DatagramProtocol):
    def datagram_received(self, data: bytes, source: tuple[str, int]) -> None:
        pass


async def main() -> None:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
    sock.bind(("127.0.0.1", 0))
    await asyncio.get_running_loop().create_datagram_endpoint(Nothing, sock=sock)
    print(json.dumps({"port": sock.getsockname()[1]}), flush=True)
    await asyncio.Event().wait()


uvloop.run(main())
