"""The daemon with a counter: how many bytecode instructions its packets take, and which modules it has loaded.

A count does not depend on how busy the machine is. It leaves out what numpy, onnxruntime and the kernel do within one
instruction, and what timers do apart from packets. The output is the daemon's line, one line for each reading of
packets ([packets, whether more wait, instructions]), and at the end the names of all modules.
"""

import json
import runpy
import sys
from types import FrameType
from typing import Any

from gestured.daemon.udp import Receiver

count = found = 0
read, receive = Receiver.read, Receiver._receive


def traced(frame: FrameType, event: str, _: Any) -> Any:
    """Trace function that counts the instructions of each Python frame."""
    global count
    if event == "opcode":
        count += 1
    elif event == "call":
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
    return traced


def counted(receiver: Receiver) -> None:
    """Replaces `Receiver.read`, within which all work on packets is done."""
    global count, found
    count = found = 0
    sys.settrace(traced)
    try:
        read(receiver)
    finally:
        sys.settrace(None)
        print(json.dumps([found, receiver._again is not None, count]), flush=True)


def taken(receiver: Receiver) -> Any:
    """Replaces `Receiver._receive`, to count packets."""
    global found
    packets, stamps, full = receive(receiver)
    found += len(packets)
    return packets, stamps, full


setattr(Receiver, "read", counted)  # noqa: B010
setattr(Receiver, "_receive", taken)  # noqa: B010
try:
    runpy.run_module("gestured.daemon", run_name="__main__", alter_sys=True)
except SystemExit:
    pass
finally:
    print(json.dumps(sorted(sys.modules)), flush=True)
