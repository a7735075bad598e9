"""Every method of the paper on one front end, under several protocols: `gestured-lab study`.

The modules, from the data to the figures:

    cohort                the data that teach and judge; material: the same with the paper's Algorithm 1
    views                 the inputs of a classifier
    training              the networks, and how they learn
    methods               the registry: each method, its hyperparameters, the paper's figures
    protocols             who learns and who is judged; one cell of a table
    cells                 checkpoints and the schedule
    tables, choices, sessions    one section of study.json each
    run_time              error against run time, in three fields, of models as they would ship
    report, picture       study.json as Markdown and its pictures; `study` puts all together
"""
