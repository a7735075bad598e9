"""The daemon: sockets, files and time around one pure `core.hub.Hub`. `gestured.daemon.cli:main` starts it."""

import os

# Before numpy is imported: its BLAS starts a thread for every core otherwise, and no matrix here is large.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Before pydantic is: it would search all packages for plugins, and load what it finds (logfire is one).
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
