"""Models: .onnx files as classifiers, checked, opened and run, one by one or as a ladder of fallbacks."""
