"""The scientist's half: data, training, export, evaluation. Needs `[lab]`; the daemon never imports it."""
