"""The pure core: numpy and the standard library's data modules, no clock, no socket, no file."""
