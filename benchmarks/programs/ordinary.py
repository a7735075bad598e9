"""The ordinary script: python-osc's asyncio server, torch in the same process, each frame classified anew.

It is what a user would write: the last two seconds of frames, the same two convolutions and LSTM (its weights are
random, which costs the same), one line of JSON to each client for each frame. It has no baseline, no segments and no
unknown.
"""

import asyncio
import json
import sys
from collections import deque
from typing import Any

import numpy as np
import torch
from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_server import AsyncIOOSCUDPServer
from torch import nn


class Net(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.convolutions = nn.Sequential(
            nn.Conv2d(1, 16, 3, padding=1),
            nn.ReLU(),
            nn.MaxPool2d(2, ceil_mode=True),
            nn.Conv2d(16, 32, 3, padding=1),
            nn.ReLU(),
            nn.MaxPool2d(2),
        )
        self.lstm = nn.LSTM(128, 32, batch_first=True)
        self.head = nn.Linear(32, 10)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        y = self.convolutions(x.reshape(-1, 1, 9, 9)).reshape(len(x), -1, 128)
        scores: torch.Tensor = self.head(self.lstm(y)[0][:, -1]).softmax(1)
        return scores


torch.set_num_threads(1)
net = Net().eval()
frames: deque[Any] = deque(maxlen=30)
clients: set[asyncio.StreamWriter] = set()


def pressure(address: str, *values: float) -> None:
    frames.append(np.array(values[-81:], np.float32).reshape(9, 9))
    with torch.no_grad():
        window = torch.from_numpy(np.stack(frames))[None]
        scores = net(window / window.max().clamp(min=1e-6))[0]
    best = int(scores.argmax())
    line = json.dumps({"sensor": address, "gesture": best, "confidence": float(scores[best])}) + "\n"
    for client in [c for c in clients if not c.is_closing()]:
        client.write(line.encode())


async def accept(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    clients.add(writer)


async def main() -> None:
    dispatcher = Dispatcher()
    dispatcher.map("/*/pressure", pressure)
    loop: Any = asyncio.get_running_loop()
    udp, _ = await AsyncIOOSCUDPServer(("127.0.0.1", 0), dispatcher, loop).create_serve_endpoint()
    server = await asyncio.start_unix_server(accept, sys.argv[1])
    print(json.dumps({"port": udp.get_extra_info("sockname")[1]}), flush=True)
    async with server:
        await server.serve_forever()


asyncio.run(main())
