"""`gestured-lab adapt`: a trained model learns further, from a user's own recordings.

The modules, in the order in which a run uses them:

    weights     the networks of an .onnx file, as they were trained
    material    own recordings, cut as the daemon cuts, and who is held out
    learning    the simulated takes beside them, and a few hundred training steps
    adaptation  people held out in turn, the decision, the threshold
    silence     instead of the last two, if there are tapes in which nobody made a gesture: the verifier learns
    command     the command line
"""
