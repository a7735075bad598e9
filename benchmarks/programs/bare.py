"""The imports that the daemon cannot do without, and its model opened: what start and memory are held against."""

import json
import os
import sys
from importlib import import_module

os.environ["ORT_DISABLE_TELEMETRY"] = "1"
import_module("numpy")
onnxruntime = import_module("onnxruntime")

options = onnxruntime.SessionOptions()
options.intra_op_num_threads = options.inter_op_num_threads = 1
with open(sys.argv[1], "rb") as file:
    session = onnxruntime.InferenceSession(file.read(), options, providers=["CPUExecutionProvider"])
print(json.dumps({"inputs": len(session.get_inputs())}), flush=True)
sys.stdin.read()
