"""numpy, onnxruntime and an opened model, without a daemon: the comparison for start and memory."""

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
