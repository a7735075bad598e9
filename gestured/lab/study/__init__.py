"""Every method of the paper on one front end, under several protocols: `gestured-lab study`.

The rooms, from the data to the figures:

    cohort, material      what is learned from and judged on
    shifting              the paper's Algorithm 1
    views, wavelets       what a classifier sees of a gesture
    nets, training        the networks; vectors: a support vector machine for many features
    onnx_form             what was learned, as it would ship
    methods               the registry: each method, its hyperparameters, the paper's figures
    protocols             who learns and who is judged; one cell of a table
    cells                 checkpoints and the schedule
    run_time, fields      error against run time, in three fields
    report, picture       study.json as Markdown and its pictures
    everything else       one section of study.json each; `study` puts them together
"""
