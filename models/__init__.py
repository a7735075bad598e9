"""The models that ship with gestured: .onnx files, their cards and manifest.json."""
