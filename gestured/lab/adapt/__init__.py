"""`gestured-lab adapt`: a shipped model goes on learning, from somebody's own recordings.

The rooms, in the order in which a run goes through them:

    weights     the networks of an .onnx file, as they were trained
    material    somebody's own recordings, cut as the daemon cuts, and who is held out
    learning    the simulated takes beside them, and a few hundred steps from there
    adaptation  people held out in turn, the decision, the threshold
    command     the command line's side of it
"""
