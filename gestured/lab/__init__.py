"""The program `gestured-lab`: data, training, export, evaluation. Needs `[lab]`; the daemon never imports it."""
