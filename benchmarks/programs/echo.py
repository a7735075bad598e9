"""A UDP-to-Unix-socket echo under uvloop: each datagram becomes one line to each client, without any work."""

import asyncio
import json
import socket
import sys

import uvloop

clients: set[asyncio.StreamWriter] = set()


class Echo(asyncio.DatagramProtocol):
    def datagram_received(self, data: bytes, source: tuple[str, int]) -> None:
        for client in [c for c in clients if not c.is_closing()]:
            client.write(b'{"type":"echo"}\n')


async def accept(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    clients.add(writer)


async def main() -> None:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", 0))
    await asyncio.get_running_loop().create_datagram_endpoint(Echo, sock=sock)
    server = await asyncio.start_unix_server(accept, sys.argv[1])
    print(json.dumps({"port": sock.getsockname()[1]}), flush=True)
    async with server:
        await server.serve_forever()


uvloop.run(main())
